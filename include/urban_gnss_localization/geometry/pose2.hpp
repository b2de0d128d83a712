#pragma once

#include <Eigen/Core>
#include <cmath>

#include "urban_gnss_localization/geometry/angles.hpp"

namespace urban_gnss {

/// Pose of a robot in the plane, or the transform from its frame to its parent's: metres and radians, yaw
/// counter-clockwise from the parent's x axis (east in a map frame, REP-103).
struct Pose2 {
  double x{0.0};
  double y{0.0};
  double yaw{0.0};

  Eigen::Vector2d position() const { return {x, y}; }
};

/// A point given in the pose's own frame, expressed in the parent frame.
inline Eigen::Vector2d transform_point(const Pose2& pose, const Eigen::Vector2d& point) {
  const double c = std::cos(pose.yaw);
  const double s = std::sin(pose.yaw);
  return {pose.x + c * point.x() - s * point.y(), pose.y + s * point.x() + c * point.y()};
}

/// a followed by b, where b is given in a's frame. The yaw is wrapped to [-pi, pi).
inline Pose2 compose(const Pose2& a, const Pose2& b) {
  const Eigen::Vector2d position = transform_point(a, b.position());
  return {position.x(), position.y(), wrap_angle(a.yaw + b.yaw)};
}

/// The pose with compose(a, inverse(a)) = identity.
inline Pose2 inverse(const Pose2& a) {
  const double c = std::cos(a.yaw);
  const double s = std::sin(a.yaw);
  return {-c * a.x - s * a.y, s * a.x - c * a.y, wrap_angle(-a.yaw)};
}

/// b as seen from a: compose(a, relative_pose(a, b)) = b.
inline Pose2 relative_pose(const Pose2& a, const Pose2& b) { return compose(inverse(a), b); }

inline bool is_finite(const Pose2& pose) {
  return std::isfinite(pose.x) && std::isfinite(pose.y) && std::isfinite(pose.yaw);
}

/// A pose with its covariance (x, y, yaw; m^2, m rad, rad^2).
struct PoseEstimate {
  Pose2 pose;
  Eigen::Matrix3d covariance{Eigen::Matrix3d::Zero()};
};

}  // namespace urban_gnss
