#include "urban_gnss_localization/motion/standstill.hpp"

#include <cmath>

namespace urban_gnss {

bool is_standstill(const Twist2& twist, double yaw_rate_limit_radps) {
  return twist.ground_speed_mps() < kStandstill_mps && std::abs(twist.yaw_rate_radps) < yaw_rate_limit_radps;
}

void Travel::add(const Twist2& twist, double step_s) {
  distance_m += twist.ground_speed_mps() * step_s;
  duration_s += step_s;
}

bool Travel::is_standstill() const { return duration_s > 0.0 && distance_m < kStandstillMean_mps * duration_s; }

}  // namespace urban_gnss
