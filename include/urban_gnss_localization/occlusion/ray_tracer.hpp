#pragma once

#include <Eigen/Core>
#include <limits>

namespace urban_gnss {

/// What a ray from the antenna towards a satellite meets.
struct RayOutcome {
  bool blocked{false};
  /// m, to the obstacle; infinite where the ray is free
  double range_m{std::numeric_limits<double>::infinity()};
  /// m, length inside what lets many of the lidar's rays through (foliage): it attenuates, it does not block
  double vegetation_m{0.0};
};

/// Decides whether the signal path of a satellite is obstructed (Maier & Kleiner 2010, Algorithm 2).
class RayTracer {
 public:
  virtual ~RayTracer() = default;

  /// `origin` (m) is the antenna in the frame of the map, `direction` a unit vector. Free where one is not finite.
  virtual RayOutcome trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const = 0;
};

}  // namespace urban_gnss
