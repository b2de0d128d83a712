#pragma once

#include "urban_gnss_localization/motion/motion_model.hpp"
#include "urban_gnss_localization/motion/standstill.hpp"

namespace urban_gnss {

/// How wrong the odometry may be, for filters that estimate its errors beside the pose. With sigmas and walks of 0 they
/// do not estimate them.
struct OdometryErrorParameters {
  double motion_noise_factor{0.003};
  double speed_scale_sigma{0.1};
  double speed_scale_walk{5e-4};
  double yaw_rate_bias_sigma{0.005};
  double yaw_rate_bias_walk{1e-5};
  double position_walk{0.12};
  double heading_walk{0.002};
  double parked_walk{0.03};
  double standstill_radps{kStandstill_radps};  ///< not told by users: the yaw rate at which the method's robot stands

  void visit(ParameterVisitor& v) {
    v("motion_noise_factor", motion_noise_factor, non_negative(), "",
      "factor on the variances of the motion noise, most of which are due to scale and yaw-rate errors");
    v.basic()("speed_scale_sigma", speed_scale_sigma, non_negative(), "",
              "initial standard deviation of the odometry's relative speed error");
    v("speed_scale_walk", speed_scale_walk, non_negative(), "1/sqrt(s)",
      "random walk of the odometry's relative speed error");
    v("yaw_rate_bias_sigma", yaw_rate_bias_sigma, non_negative(), "rad/s",
      "initial standard deviation of the odometry's yaw-rate error");
    v("yaw_rate_bias_walk", yaw_rate_bias_walk, non_negative(), "rad/s/sqrt(s)",
      "random walk of the odometry's yaw-rate error");
    v("position_walk", position_walk, non_negative(), "m/sqrt(s) per axis", "random walk of the position while moving");
    v("heading_walk", heading_walk, non_negative(), "rad/sqrt(s)", "random walk of the heading while moving");
    v("parked_walk", parked_walk, non_negative(), "m/sqrt(s) per axis", "random walk of the position at a standstill");
  }
};

/// Leaves the noise that is not the errors'.
void scale_noise(MotionStep& step, const OdometryErrorParameters& errors);
/// The motion model's step with the noise that is left where the odometry's errors are states.
MotionStep make_motion_step(const Twist2& twist, double duration_s, const MotionParameters& motion,
                            const OdometryErrorParameters& errors);

}  // namespace urban_gnss
