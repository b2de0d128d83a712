#include "urban_gnss_localization/localizers/kim/complementary_ekf_parameters.hpp"

namespace urban_gnss {

EnumNames<ComplementaryMode> enum_names(ComplementaryMode) {
  return {{"standard", ComplementaryMode::kStandard},
          {"gated", ComplementaryMode::kGated},
          {"compensated", ComplementaryMode::kCompensated}};
}

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

}  // namespace urban_gnss
