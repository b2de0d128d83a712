#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"

namespace urban_gnss {

/// The constants of Maier and Kleiner 2010, Algorithm 3, by the paper's values.
struct CovarianceFilterParameters {
  double sigma_infinite{600.0};
  double sigma_threshold{6.0};
  double sigma_smooth{9.0};
  double smooth_length_scale{0.2};
  double smooth_length_max{12.0};

  void visit(ParameterVisitor& v) {
    v("sigma_infinite", sigma_infinite, positive(), "m per axis", "standard deviation of a fix without weight");
    v("sigma_threshold", sigma_threshold, positive(), "m", "root of the covariance's trace above which a fix is bad");
    v("sigma_smooth", sigma_smooth, positive(), "m",
      "root of the covariance's trace above which a fix is followed by a recovery of the receiver");
    v("smooth_length_scale", smooth_length_scale, non_negative(), "",
      "number of fixes of recovery for each fix above sigma_smooth");
    v("smooth_length_max", smooth_length_max, between(0.0, 1e6), "", "greatest number of fixes of recovery");
  }
  void check(std::vector<std::string>& faults) const;

  Eigen::Matrix2d infinite() const { return sigma_infinite * sigma_infinite * Eigen::Matrix2d::Identity(); }
};

/// sigma_p of Algorithm 3, m: the root of the trace; infinite for a covariance that is not finite or has a variance
/// that is not positive.
double position_sigma(const Eigen::Matrix2d& covariance);

/// Algorithm 3 as a state machine, fix by fix. It gives what the paper's form gives, which looks at a whole recording
/// (a test compares them): the recovery i : i + len after a run that ended at i - 1 is read as the fixes
/// i <= k < i + len, which are len fixes for a whole len and the next whole number of them otherwise. Recoveries that
/// overlap are united; a run that has not ended causes none.
class CovarianceFilter {
 public:
  struct Result {
    Eigen::Matrix2d covariance;  ///< R', m^2
    bool is_good;                ///< GPS_good: R' is not R_inf
    bool is_recovering;          ///< within the recovery after a run above sigma_smooth
  };

  /// Requires parameters without faults.
  explicit CovarianceFilter(const CovarianceFilterParameters& parameters) : parameters_(parameters) {}

  /// The next fix. One whose covariance is absent or cannot be used counts as infinitely uncertain.
  Result add(const std::optional<Eigen::Matrix2d>& covariance);

  void reset();

 private:
  CovarianceFilterParameters parameters_;
  long run_length_{0};  ///< fixes above sigma_smooth up to the last
  long recovery_{0};    ///< fixes that are still to be inflated
};

}  // namespace urban_gnss
