#pragma once

#include <cstddef>

namespace urban_gnss {

/// How long a pipeline remembers odometry, yaw rates and estimates.
inline constexpr double kHistory_s = 10.0;
/// A fix, velocity or yaw rate that is farther ahead of the odometry than this has a wrong stamp.
inline constexpr double kMaxAhead_s = 10.0;
/// How many fixes, or biases, may wait for what they need; the oldest go first.
inline constexpr std::size_t kMaxWaitingFixes = 1000;

/// How many epochs of satellites are remembered, for fixes that wait for odometry.
inline constexpr std::size_t kMaxWaitingSatellites = 100;
/// Satellites that are no farther from a fix are its own: some drivers round one of the two stamps. Half the interval of
/// a receiver with 50 Hz: those of its other fixes are farther.
inline constexpr double kSameEpoch_s = 0.01;

}  // namespace urban_gnss
