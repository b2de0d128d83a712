#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <vector>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/geometry/pose2.hpp"

namespace urban_gnss {

/// Where something was at one instant: metres and radians in the map frame.
struct TimedPose {
  Stamp stamp{0};
  Pose2 pose;
  /// Of x, y, yaw (m^2, m rad, rad^2); filled with NaN where there is none.
  Eigen::Matrix3d covariance{Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN())};
};

/// Poses in the order of their stamps, oldest first. Of several with one stamp, the last is the one that counts.
using Trajectory = std::vector<TimedPose>;

/// Brings poses into the order of their stamps; those with the same stamp keep theirs.
void sort_by_stamp(Trajectory& trajectory);

/// The pose at a stamp: position and covariance linearly, yaw along the shorter arc between the two neighbours. Nothing
/// outside the trajectory's span, nor between two poses that are more than max_gap apart. Requires a sorted trajectory.
std::optional<TimedPose> interpolate(const Trajectory& trajectory, Stamp stamp, Stamp max_gap);

}  // namespace urban_gnss
