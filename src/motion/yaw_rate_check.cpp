#include "urban_gnss_localization/motion/yaw_rate_check.hpp"

#include <cmath>

namespace urban_gnss {

std::optional<double> YawRateCheck::add(double odometry_radps, double imu_radps, double duration_s) {
  if (std::abs(odometry_radps) < kTurning_radps) return std::nullopt;
  turning_s_ += duration_s;
  cross_ += odometry_radps * imu_radps * duration_s;
  square_ += odometry_radps * odometry_radps * duration_s;
  if (turning_s_ < kTurningTime_s) return std::nullopt;
  const double factor = cross_ / square_;
  *this = {};
  return factor;
}

}  // namespace urban_gnss
