#pragma once

#include <Eigen/Cholesky>

#include "matchers.hpp"
#include "urban_gnss_localization/localizers/maier/ukf.hpp"

namespace urban_gnss {

inline FixMeasurement fix_at(const Eigen::Vector2d& position, double sigma, double time_s = 0.0) {
  FixMeasurement fix;
  fix.position = position;
  fix.covariance = isotropic(sigma);
  fix.time_s = time_s;
  return fix;
}

/// The textbook filter: nothing robust, independent errors, the motion model's noise as it is.
inline UkfParameters plain() {
  UkfParameters p = published_ukf();
  p.outliers = OutlierPolicy::kNone;
  p.fix_noise.errors = {0.0, 0.0};
  p.odometry.motion_noise_factor = 1.0;
  return p;
}

inline MotionParameters noise_free() { return with(MotionParameters(), "odom_noise_scale: 0.0"); }

inline bool is_sound(const Ukf& ukf) {
  const auto& p = ukf.covariance();
  return ukf.state().allFinite() && p.allFinite() && p == p.transpose() && Eigen::LLT<Ukf::Covariance>(p).info() == 0;
}

}  // namespace urban_gnss
