#pragma once

#include <Eigen/Geometry>

#include "urban_gnss_localization/geometry/pose2.hpp"

namespace urban_gnss {

/// A planar pose as a transform in space, at height 0.
inline Eigen::Isometry3d to_isometry(const Pose2& pose) {
  Eigen::Isometry3d isometry = Eigen::Isometry3d::Identity();
  isometry.translate(Eigen::Vector3d(pose.x, pose.y, 0.0));
  isometry.rotate(Eigen::AngleAxisd(pose.yaw, Eigen::Vector3d::UnitZ()));
  return isometry;
}

}  // namespace urban_gnss
