#include "urban_gnss_localization/localizers/kim/complementary_ekf_parameters.hpp"

namespace urban_gnss {

EnumNames<ComplementaryMode> enum_names(ComplementaryMode) {
  return {{"standard", ComplementaryMode::kStandard},
          {"gated", ComplementaryMode::kGated},
          {"compensated", ComplementaryMode::kCompensated},
          {"standard_as_printed", ComplementaryMode::kStandardAsPrinted},
          {"gated_as_printed", ComplementaryMode::kGatedAsPrinted},
          {"compensated_as_printed", ComplementaryMode::kCompensatedAsPrinted}};
}

bool is_as_printed(ComplementaryMode mode) { return mode >= ComplementaryMode::kStandardAsPrinted; }

EnumNames<LockoutPolicy> enum_names(LockoutPolicy) {
  return {{"automatic", LockoutPolicy::kAutomatic}, {"dead_reckoning", LockoutPolicy::kDeadReckoning}};
}

MotionParameters kim_motion() {
  MotionParameters motion;
  motion.odom_alpha1 = 4e-4;
  motion.odom_alpha4 = 9e-4;
  motion.odom_alpha2 = motion.odom_alpha3 = motion.odom_alpha5 = motion.odom_alpha6 = 0.0;
  return motion;
}

OdometryErrorParameters kim_odometry_errors() {
  OdometryErrorParameters odometry = middle_quality();
  odometry.motion_noise_factor = 1.0;
  odometry.yaw_rate_bias_walk = 3e-5;
  odometry.parked_walk = 0.0;
  odometry.standstill_radps = 1e-4;
  return odometry;
}

ComplementaryEkfParameters published_complementary_ekf() {
  ComplementaryEkfParameters p;
  p.errors = {0.0, 0.0};
  p.reacquisition.reacquisition_sigma = 0.0;
  p.common_error = {0.0, 0.0, 0.0};
  p.odometry = {1.0, 0.02, 2e-4, 0.005, 3e-5, 0.05, 0.003, 0.0, 1e-4};
  return p;
}

}  // namespace urban_gnss
