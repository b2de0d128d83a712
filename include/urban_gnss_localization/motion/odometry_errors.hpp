#pragma once

#include "urban_gnss_localization/motion/motion_model.hpp"

namespace urban_gnss {

/// How wrong the odometry may be, for filters that estimate that beside the pose. With sigmas and walks of 0 they do
/// not.
struct OdometryErrorParameters {
  double motion_noise_factor{0.003};  ///< on the motion model's variances, most of which are scale and bias
  double speed_scale_sigma{0.02};     ///< initial standard deviation of the odometry's relative speed error
  double speed_scale_walk{2e-4};      ///< its random walk, 1/sqrt(s)
  double yaw_rate_bias_sigma{0.005};  ///< rad/s, initial standard deviation of the odometry's yaw-rate error
  double yaw_rate_bias_walk{1e-5};    ///< its random walk, rad/s/sqrt(s)
  double position_walk{0.1};          ///< m/sqrt(s) per axis, random walk of the position while moving
  double heading_walk{0.002};         ///< rad/sqrt(s), random walk of the heading while moving
  double parked_walk{0.03};           ///< m/sqrt(s), random walk of the position at a standstill

  template <class V>
  void visit(V& v) {
    v("motion_noise_factor", motion_noise_factor, non_negative());
    v("speed_scale_sigma", speed_scale_sigma, non_negative());
    v("speed_scale_walk", speed_scale_walk, non_negative());
    v("yaw_rate_bias_sigma", yaw_rate_bias_sigma, non_negative());
    v("yaw_rate_bias_walk", yaw_rate_bias_walk, non_negative());
    v("position_walk", position_walk, non_negative());
    v("heading_walk", heading_walk, non_negative());
    v("parked_walk", parked_walk, non_negative());
  }
  void check(std::vector<std::string>&) const {}
};

/// The motion model's step with the noise that is left where the odometry's errors are states.
MotionStep make_motion_step(const Twist2& twist, double duration_s, const MotionParameters& motion,
                            const OdometryErrorParameters& errors);

}  // namespace urban_gnss
