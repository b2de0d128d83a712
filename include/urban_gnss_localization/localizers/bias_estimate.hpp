#pragma once

#include <Eigen/Core>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/gnss/fix_decision.hpp"

namespace urban_gnss {

/// The bias of the fixes after one of them: what gps/bias carries from a bias filter to a localizer.
struct BiasEstimate {
  Stamp stamp{0};                                       ///< of the fix
  Eigen::Vector2d bias{Eigen::Vector2d::Zero()};        ///< m, fix minus antenna
  Eigen::Vector2d rate{Eigen::Vector2d::Zero()};        ///< m/s
  Eigen::Matrix2d covariance{Eigen::Matrix2d::Zero()};  ///< m^2
  double radius_m{0.0};                                 ///< r-hat, Nishida et al. eq. (21)
  bool in_shadow{false};
  double shadow_statistic{0.0};                                         ///< squared Mahalanobis length of the bias
  double shadow_threshold{0.0};                                         ///< its chi-square quantile
  Eigen::Vector2d fix_position{Eigen::Vector2d::Zero()};                ///< m, map frame
  Eigen::Vector2d predicted_antenna_position{Eigen::Vector2d::Zero()};  ///< m, what the fix was compared with
  FixOutcome outcome;
};

}  // namespace urban_gnss
