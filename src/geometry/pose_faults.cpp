#include "urban_gnss_localization/geometry/pose_faults.hpp"

#include <cmath>
#include <sstream>

#include "urban_gnss_localization/common/covariance_faults.hpp"

namespace urban_gnss {
namespace {

constexpr double kMaxCoordinate_m = 1e7;  ///< as of the odometry

std::string position_fault(const char* name, double value_m) {
  if (std::abs(value_m) <= kMaxCoordinate_m) return {};
  std::ostringstream text;
  text << name << " = " << value_m << " m: must be within " << kMaxCoordinate_m << " m";
  return text.str();
}

}  // namespace

std::string estimate_fault(const PoseEstimate& estimate) {
  for (const std::string& fault : {position_fault("x", estimate.pose.x), position_fault("y", estimate.pose.y)}) {
    if (!fault.empty()) return fault;
  }
  if (!std::isfinite(estimate.pose.yaw)) return "yaw is not finite";
  return covariance_fault(estimate.covariance, {"x", "y", "yaw"});
}

}  // namespace urban_gnss
