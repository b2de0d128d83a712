#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "urban_gnss_localization/gnss/fix.hpp"

namespace urban_gnss {

/// A receiver's speed (m/s) and course over ground (rad, clockwise from north) as east and north, its covariance not
/// declared. Slower than 0.5 m/s without a course (NaN) the robot stands: zero, with the speed as its sigma, at least
/// 0.1 m/s. Nothing without a speed that a robot can have, or where the course of a fast one is missing.
inline std::optional<RawVelocity> ground_velocity(Stamp stamp, double speed_mps, double course_rad) {
  constexpr double kMostSpeed_mps = 600.0;  // receivers must stop at 515
  constexpr double kStanding_mps = 0.5;
  constexpr double kLeastSigma_mps = 0.1;
  if (!(speed_mps >= 0.0 && speed_mps <= kMostSpeed_mps)) return std::nullopt;
  RawVelocity velocity;
  velocity.stamp = stamp;
  if (std::isfinite(course_rad)) {
    velocity.velocity = speed_mps * Eigen::Vector2d(std::sin(course_rad), std::cos(course_rad));
  } else if (speed_mps < kStanding_mps) {
    const double sigma = std::max(speed_mps, kLeastSigma_mps);
    velocity.covariance = sigma * sigma * Eigen::Matrix2d::Identity();
  } else {
    return std::nullopt;
  }
  return velocity;
}

}  // namespace urban_gnss
