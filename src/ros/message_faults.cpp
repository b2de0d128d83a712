#include "urban_gnss_localization/ros/message_faults.hpp"

#include <Eigen/Core>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <sstream>

#include "urban_gnss_localization/common/covariance_faults.hpp"

namespace urban_gnss {
namespace {

using Names = std::initializer_list<const char*>;

const Names kPoseAxes = {"x", "y", "z", "roll", "pitch", "yaw"};
const Names kTwistAxes = {"vx", "vy", "vz", "roll rate", "pitch rate", "yaw rate"};
const Names kPointAxes = {"x", "y", "z"};
constexpr double kUnitTolerance = 0.1;
constexpr double kMaxRadius_m = 1e6;

std::string not_finite(const std::string& field) { return field + " is not finite"; }

template <class Vector>
bool is_finite(const Vector& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

std::string quaternion_fault(const geometry_msgs::Quaternion& q) {
  const double norm = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  if (norm == 0.0) return "orientation is 0 (x, y, z, w): a quaternion without a turn has w = 1";
  if (std::abs(norm - 1.0) <= kUnitTolerance) return {};
  std::ostringstream text;
  text << "orientation has length " << norm << ": must be 1";
  return text.str();
}

std::string pose_fault(const geometry_msgs::Pose& pose) {
  return is_finite(pose.position) ? quaternion_fault(pose.orientation) : not_finite("position");
}

template <class Array>
std::string square_fault(const Array& values, const Names& axes) {
  const auto size = static_cast<Eigen::Index>(axes.size());
  return covariance_fault(Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
                              values.data(), size, size),
                          axes);
}

/// The field's name before what is wrong with it.
std::string in(const char* field, const std::string& fault) { return fault.empty() ? fault : field + (": " + fault); }

std::string first_of(std::initializer_list<std::string> faults) {
  for (const std::string& fault : faults) {
    if (!fault.empty()) return fault;
  }
  return {};
}

}  // namespace

std::string message_fault(const geometry_msgs::PoseWithCovariance& pose) {
  return first_of({pose_fault(pose.pose), square_fault(pose.covariance, kPoseAxes)});
}

std::string message_fault(const geometry_msgs::TransformStamped& transform) {
  if (transform.header.frame_id.empty() || transform.child_frame_id.empty()) return "a frame's name is empty";
  if (!is_finite(transform.transform.translation)) return not_finite("translation");
  return in("rotation", quaternion_fault(transform.transform.rotation));
}

std::string message_fault(const geometry_msgs::Twist& twist) {
  return is_finite(twist.linear) && is_finite(twist.angular) ? std::string() : not_finite("twist");
}

std::string message_fault(const nav_msgs::Odometry& odometry) {
  return first_of({in("pose", message_fault(odometry.pose)), message_fault(odometry.twist.twist),
                   in("twist", square_fault(odometry.twist.covariance, kTwistAxes))});
}

std::string message_fault(const nav_msgs::Path& path) {
  for (const geometry_msgs::PoseStamped& each : path.poses) {
    const std::string fault = pose_fault(each.pose);
    if (!fault.empty()) return fault;
  }
  return {};
}

std::string message_fault(const sensor_msgs::NavSatFix& fix) {
  if (fix.status.status < sensor_msgs::NavSatStatus::STATUS_FIX) return {};
  if (!std::isfinite(fix.latitude) || !std::isfinite(fix.longitude)) return not_finite("latitude or longitude");
  return in("position_covariance", square_fault(fix.position_covariance, kPointAxes));
}

std::string message_fault(const geometry_msgs::PoseArray& poses) {
  for (const geometry_msgs::Pose& pose : poses.poses) {
    const std::string fault = pose_fault(pose);
    if (!fault.empty()) return fault;
  }
  return {};
}

std::string message_fault(const sensor_msgs::PointCloud2& cloud) {
  for (std::size_t at = 0; at + sizeof(float) <= cloud.data.size(); at += sizeof(float)) {
    float value = 0.0F;
    std::memcpy(&value, cloud.data.data() + at, sizeof value);
    if (!std::isfinite(value)) return not_finite("a point");
  }
  return {};
}

std::string message_fault(const visualization_msgs::Marker& marker) {
  if (!is_finite(marker.pose.position) || !is_finite(marker.scale)) return not_finite("pose or scale");
  for (const geometry_msgs::Point& point : marker.points) {
    if (!is_finite(point)) return not_finite("a point");
  }
  return {};
}

std::string message_fault(const visualization_msgs::MarkerArray& markers) {
  for (const visualization_msgs::Marker& marker : markers.markers) {
    const std::string fault = message_fault(marker);
    if (!fault.empty()) return marker.ns + ": " + fault;
  }
  return {};
}

std::string message_fault(const urban_gnss_localization::GpsBias& bias) {
  if (!is_finite(bias.bias) || !is_finite(bias.bias_rate)) return not_finite("bias or bias_rate");
  if (bias.fix.decision > urban_gnss_localization::FixDecision::REJECTED_DEGENERATE) return "fix.decision is none";
  if (!(bias.radius >= 0.0 && bias.radius <= kMaxRadius_m)) return "radius is no length";
  return in("covariance", square_fault(bias.covariance, kPointAxes));
}

std::string message_fault(const urban_gnss_localization::Visibility& visibility) {
  const Names axes = {"east", "north"};
  return first_of({in("conventional_covariance", square_fault(visibility.conventional_covariance, axes)),
                   in("weighted_covariance", square_fault(visibility.weighted_covariance, axes))});
}

}  // namespace urban_gnss
