#pragma once

#include <string>

#include "urban_gnss_localization/geometry/pose2.hpp"

namespace urban_gnss {

/// Beyond it (10 000 km) a coordinate is no place of a robot.
inline constexpr double kMaxCoordinate_m = 1e7;

/// Why a pose is none that a robot can have, with the numbers: it is not finite, or x or y is beyond kMaxCoordinate_m.
/// Empty where it is one.
std::string pose_fault(const Pose2& pose);

/// Why a pose with its covariance is none that a robot can have, with the numbers: that of pose_fault(), or the
/// covariance is none (covariance_fault()). Empty where it is one.
std::string estimate_fault(const PoseEstimate& estimate);

}  // namespace urban_gnss
