#include "urban_gnss_localization/motion/odometry_errors.hpp"

#include <cmath>

namespace urban_gnss {

bool is_parked(const Twist2& twist) {
  constexpr double kStandstill_mps = 1e-3;
  constexpr double kStandstill_radps = 0.01;
  return std::abs(twist.speed_mps) < kStandstill_mps && std::abs(twist.yaw_rate_radps) < kStandstill_radps;
}

MotionStep make_motion_step(const Twist2& twist, double duration_s, const MotionParameters& motion,
                            const OdometryErrorParameters& errors) {
  MotionStep step = make_motion_step(twist, duration_s, motion);
  const double factor = std::sqrt(errors.motion_noise_factor);
  step.speed_sigma *= factor;
  step.input_sigma *= factor;
  step.yaw_rate_sigma *= factor;
  return step;
}

}  // namespace urban_gnss
