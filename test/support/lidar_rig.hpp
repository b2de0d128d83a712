#pragma once

#include <algorithm>
#include <vector>

#include "urban_gnss_localization/simulation/lidar.hpp"

namespace urban_gnss {

/// No noise, no dropout, no body, the sensor 2 m above base_link.
inline LidarParameters exact(LidarType type = LidarType::kSpinning) {
  LidarParameters parameters;
  parameters.type = type;
  parameters.beams = 5;
  parameters.points_per_revolution = 360;
  parameters.range_sigma = parameters.dropout = 0.0;
  parameters.mount_x = 0.0;
  parameters.mount_z = 2.0;
  parameters.body_width = 0.0;
  return parameters;
}

inline Building block(double x0, double y0, double x1, double y1, double roof_m) {
  Building building;
  building.footprint = {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}};
  building.roof_m = roof_m;
  return building;
}

inline LidarScan scan_of(const LidarParameters& parameters, const World& world, const Pose2& pose = {},
                         const std::vector<Car>& cars = {}, std::uint64_t seed = 1) {
  const WallIndex index(world);
  Lidar lidar(parameters, world, index, seed);
  LidarScan scan;
  lidar.scan(pose, 0.0, cars, scan);
  return scan;
}

inline std::size_t count(const LidarScan& scan, Surface surface) {
  return static_cast<std::size_t>(std::count(scan.intensity.begin(), scan.intensity.end(), intensity(surface)));
}

inline Eigen::Vector3d point(const LidarScan& scan, std::size_t i) { return {scan.x[i], scan.y[i], scan.z[i]}; }

/// The point in the map frame, for a sensor 2 m above `pose`.
inline Eigen::Vector3d in_map(const LidarScan& scan, std::size_t i, const Pose2& pose) {
  const Eigen::Vector2d horizontal = transform_point(pose, {scan.x[i], scan.y[i]});
  return {horizontal.x(), horizontal.y(), scan.z[i] + 2.0};
}

/// A yard of 60 m by 60 m between buildings of 100 m, about the origin.
inline World hall() {
  World world;
  world.buildings = {block(30.0, -31.0, 31.0, 31.0, 100.0), block(-31.0, -31.0, -30.0, 31.0, 100.0),
                     block(-30.0, 30.0, 30.0, 31.0, 100.0), block(-30.0, -31.0, 30.0, -30.0, 100.0)};
  return world;
}

}  // namespace urban_gnss
