#include "urban_gnss_localization/motion/odometry_errors.hpp"

#include <cmath>

namespace urban_gnss {

void scale_noise(MotionStep& step, const OdometryErrorParameters& errors) {
  const double factor = std::sqrt(errors.motion_noise_factor);
  step.speed_sigma *= factor;
  step.input_sigma *= factor;
  step.yaw_rate_sigma *= factor;
}

MotionStep make_motion_step(const Twist2& twist, double duration_s, const MotionParameters& motion,
                            const OdometryErrorParameters& errors) {
  MotionStep step = make_motion_step(twist, duration_s, motion);
  scale_noise(step, errors);
  return step;
}

}  // namespace urban_gnss
