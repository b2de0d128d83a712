#pragma once

#include <Eigen/Core>

#include "urban_gnss_localization/common/parameters.hpp"

namespace urban_gnss {

/// What is known of a fix's noise without and with a bias.
struct FixSigmaParameters {
  bool use_fix_covariance{true};
  double direct_sigma{3.0};
  double shadow_sigma{3.0};

  void visit(ParameterVisitor& v) {
    v.basic()("use_fix_covariance", use_fix_covariance,
              "whether each fix's own covariance is used in place of direct_sigma");
    v.basic()("direct_sigma", direct_sigma, positive(), "m", "standard deviation of a fix in direct reception");
    v("shadow_sigma", shadow_sigma, positive(), "m",
      "standard deviation of a fix about its bias; with use_fix_covariance, its ratio to direct_sigma scales each "
      "fix's own");
  }

  /// Covariance (m^2) of a fix that declares `declared`, in direct reception.
  Eigen::Matrix2d direct_covariance(const Eigen::Matrix2d& declared) const;
  /// The same about its bias, in the shadow: larger by the ratio of the sigmas where the fix's own covariance is used.
  Eigen::Matrix2d shadow_covariance(const Eigen::Matrix2d& declared) const;
};

}  // namespace urban_gnss
