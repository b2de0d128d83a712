#pragma once

#include "urban_gnss_localization/common/parameters.hpp"

namespace urban_gnss {

/// Factor, 1 to 10^6, on the covariance of a fix `interval_s` after the last one, whose error is a first-order Markov
/// process: (1 + a) / (1 - a), a = exp(-interval / correlation time). With this factor a sequence of such fixes carries
/// as much information as independent ones. 1 where correlation_time_s is not positive.
double markov_inflation(double interval_s, double correlation_time_s);

/// How long the errors of fixes last: the correlation of two errors is exp(-distance / length - time / time constant).
/// A reflection goes with the place, what makes it change goes with time.
struct ErrorCorrelation {
  double distance{0.0};
  double time{0.0};

  void visit(ParameterVisitor& v) {
    v("correlation_distance", distance, non_negative(), "m",
      "way over which errors are correlated; 0: it does not matter");
    v("correlation_time", time, non_negative(), "s", "time over which errors are correlated; 0: it does not matter");
  }

  /// Factor, 1 to 10^6, on the covariance of a measurement so far and so long after the last one, as by
  /// markov_inflation(). 1 where neither matters. Requires finite numbers.
  double inflation(double moved_m, double interval_s) const;
};

/// What is taken of fixes where nothing else is said.
inline constexpr ErrorCorrelation kFixErrors{15.0, 40.0};

}  // namespace urban_gnss
