#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"

namespace urban_gnss {

/// The error that all fixes of a drive share (atmosphere, orbits, antenna): as large as a share of what the fixes' own
/// errors are learnt to be. It is no state: it is added to the covariance that is published.
struct CommonErrorParameters {
  double common_error_share{0.7};
  double common_error_min{0.7};
  double common_error_max{4.0};

  void visit(ParameterVisitor& v) {
    v("common_error_share", common_error_share, non_negative(), "",
      "standard deviation of the common error relative to that of a fix");
    v("common_error_min", common_error_min, non_negative(), "m per axis",
      "least standard deviation of the common error, but no more than what a fix declares");
    v("common_error_max", common_error_max, non_negative(), "m per axis",
      "greatest standard deviation of the common error");
  }
  void check(std::vector<std::string>& faults) const {
    if (common_error_min > common_error_max) faults.push_back("common_error_min: must not exceed common_error_max");
  }
  /// m^2 per axis, where fixes have `fix_variance_m2` per axis and declare `declared_m2`.
  double variance_m2(double fix_variance_m2, double declared_m2) const {
    return variance_m2(fix_variance_m2, declared_m2, common_error_share);
  }
  /// The same with another share.
  double variance_m2(double fix_variance_m2, double declared_m2, double share) const {
    const double least = std::min(common_error_min, std::sqrt(declared_m2));
    const double sigma_m = std::clamp(share * std::sqrt(fix_variance_m2), least, common_error_max);
    return sigma_m * sigma_m;
  }
};

}  // namespace urban_gnss
