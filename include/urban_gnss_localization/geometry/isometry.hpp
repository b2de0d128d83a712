#pragma once

#include <Eigen/Geometry>
#include <cmath>

#include "urban_gnss_localization/geometry/pose2.hpp"

namespace urban_gnss {

/// A planar pose as a transform in space, at height 0.
inline Eigen::Isometry3d to_isometry(const Pose2& pose) {
  Eigen::Isometry3d isometry = Eigen::Isometry3d::Identity();
  isometry.translate(Eigen::Vector3d(pose.x, pose.y, 0.0));
  isometry.rotate(Eigen::AngleAxisd(pose.yaw, Eigen::Vector3d::UnitZ()));
  return isometry;
}

/// Where the x axis points, rad from the parent's, seen from above.
inline double yaw_of(const Eigen::Isometry3d& pose) {
  const Eigen::Vector3d forward = pose.linear().col(0);
  return std::atan2(forward.y(), forward.x());
}

}  // namespace urban_gnss
