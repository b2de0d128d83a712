#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace urban_gnss {

/// m: what is placed is nearer to the origin, along each axis. The map frame is flat, and the Earth is not.
inline constexpr double kWorldReach_m = 1e5;

inline bool is_in_world(const Eigen::Vector2d& point) { return (point.array().abs() <= kWorldReach_m).all(); }

/// An extruded footprint. A building stands on the ground; a bridge or the roof of a tunnel has a base above it.
struct Building {
  std::string name;
  std::vector<Eigen::Vector2d> footprint;  ///< m, map frame; simple polygon, counter-clockwise, not closed
  double base_m{0.0};
  double roof_m{0.0};              ///< height of the roof above the ground, more than base_m
  double reflection_loss_db{6.0};  ///< of one specular reflection on its walls
};

/// A trunk (opaque cylinder) under a crown (cylinder that attenuates signals and lets a share of lidar rays through).
struct Tree {
  Eigen::Vector2d position{Eigen::Vector2d::Zero()};  ///< m, map frame
  double trunk_radius_m{0.2};
  double crown_radius_m{3.0};
  double crown_base_m{3.0};
  double crown_top_m{9.0};
  double attenuation_db_per_m{1.5};
};

/// All that stands on the ground, which is the plane z = 0 of the map frame. Moving obstacles are not part of it.
struct World {
  std::vector<Building> buildings;
  std::vector<Tree> trees;
};

}  // namespace urban_gnss
