#pragma once

#include <string>

#include "urban_gnss_localization/geometry/pose2.hpp"

namespace urban_gnss {

/// Why a pose with its covariance is none that a robot can have, with the numbers: something is not finite, the place
/// is farther than 10 000 km from the origin, or the covariance is none (covariance_fault()). Empty where it is one.
std::string estimate_fault(const PoseEstimate& estimate);

}  // namespace urban_gnss
