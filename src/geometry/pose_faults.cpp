#include "urban_gnss_localization/geometry/pose_faults.hpp"

#include <cmath>
#include <sstream>

#include "urban_gnss_localization/common/covariance_faults.hpp"

namespace urban_gnss {
namespace {

std::string position_fault(const char* name, double value_m) {
  if (std::abs(value_m) <= kMaxCoordinate_m) return {};
  std::ostringstream text;
  text << name << " = " << value_m << " m: must be within " << kMaxCoordinate_m << " m";
  return text.str();
}

}  // namespace

std::string pose_fault(const Pose2& pose) {
  for (const std::string& fault : {position_fault("x", pose.x), position_fault("y", pose.y)}) {
    if (!fault.empty()) return fault;
  }
  return std::isfinite(pose.yaw) ? "" : "yaw is not finite";
}

std::string estimate_fault(const PoseEstimate& estimate) {
  const std::string fault = pose_fault(estimate.pose);
  return fault.empty() ? covariance_fault(estimate.covariance, {"x", "y", "yaw"}) : fault;
}

}  // namespace urban_gnss
