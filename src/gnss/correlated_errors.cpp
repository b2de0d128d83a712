#include "urban_gnss_localization/gnss/correlated_errors.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {

double markov_inflation(double interval_s, double correlation_time_s) {
  return ErrorCorrelation{0.0, correlation_time_s}.inflation(0.0, interval_s);
}

double ErrorCorrelation::inflation(double moved_m, double interval_s) const {
  constexpr double kMostInflation = 1e6;
  if (distance <= 0.0 && time <= 0.0) return 1.0;
  double exponent = 0.0;
  if (distance > 0.0) exponent += std::max(moved_m, 0.0) / distance;
  if (time > 0.0) exponent += std::max(interval_s, 0.0) / time;
  return std::min(1.0 / std::tanh(0.5 * exponent), kMostInflation);
}

}  // namespace urban_gnss
