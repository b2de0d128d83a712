#include "urban_gnss_localization/localizers/localizer.hpp"

#include <cmath>

#include "urban_gnss_localization/common/positive_definite.hpp"

namespace urban_gnss {

bool is_usable(const FixMeasurement& fix) {
  return fix.position.allFinite() && fix.antenna_in_body.allFinite() && std::isfinite(fix.time_s) &&
         is_positive_definite<2>(fix.covariance);
}

bool is_usable(const VelocityMeasurement& velocity) {
  return velocity.velocity.allFinite() && velocity.antenna_velocity_in_body.allFinite() &&
         is_positive_definite<2>(velocity.covariance);
}

bool is_usable(const HeadingMeasurement& heading) {
  return std::isfinite(heading.yaw_rad) && std::isfinite(heading.sigma_rad) && heading.sigma_rad > 0.0;
}

bool is_usable(const Twist2& twist, double duration_s) {
  return std::isfinite(twist.speed_mps) && std::isfinite(twist.yaw_rate_radps) && std::isfinite(twist.lateral_mps) &&
         std::isfinite(duration_s) && duration_s > 0.0;
}

}  // namespace urban_gnss
