#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/occlusion/point_cloud.hpp"

namespace urban_gnss {

/// A rectangle in space: corner, and the two sides from it, at a right angle.
struct Rectangle {
  Eigen::Vector3d corner;
  Eigen::Vector3d across;
  Eigen::Vector3d up;

  /// Samples in squares of at most `spacing_m`, the borders included.
  void sample(double spacing_m, PointCloud& cloud) const {
    const int columns = static_cast<int>(std::ceil(across.norm() / spacing_m));
    const int rows = static_cast<int>(std::ceil(up.norm() / spacing_m));
    for (int c = 0; c <= columns; ++c) {
      for (int r = 0; r <= rows; ++r) {
        cloud.push_back((corner + across * c / columns + up * r / rows).cast<float>());
      }
    }
  }

  struct Crossing {
    double range_m;
    double margin_m;  ///< from the nearest border; negative outside
  };
  /// Where the ray meets the plane of the rectangle; nothing behind the origin.
  std::optional<Crossing> cross(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
    const Eigen::Vector3d normal = across.cross(up).normalized();
    const double range_m = normal.dot(corner - origin) / normal.dot(direction);
    if (!(range_m > 0.0) || !std::isfinite(range_m)) return std::nullopt;
    const Eigen::Vector3d offset = origin + range_m * direction - corner;
    const double a = offset.dot(across.normalized());
    const double b = offset.dot(up.normalized());
    return Crossing{range_m, std::min({a, across.norm() - a, b, up.norm() - b})};
  }
};

inline Rectangle wall(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double base_m, double top_m) {
  return {{from.x(), from.y(), base_m}, {to.x() - from.x(), to.y() - from.y(), 0.0}, {0.0, 0.0, top_m - base_m}};
}

/// The four walls of a building with a rectangular footprint, turned about its middle.
inline std::vector<Rectangle> building(const Eigen::Vector2d& middle, const Eigen::Vector2d& size, double yaw_rad,
                                       double height_m) {
  const Eigen::Rotation2Dd turn(yaw_rad);
  const Eigen::Vector2d half = 0.5 * size;
  const Eigen::Vector2d corners[] = {
      {-half.x(), -half.y()}, {half.x(), -half.y()}, {half.x(), half.y()}, {-half.x(), half.y()}};
  std::vector<Rectangle> walls;
  for (int i = 0; i < 4; ++i) {
    walls.push_back(wall(middle + turn * corners[i], middle + turn * corners[(i + 1) % 4], 0.0, height_m));
  }
  return walls;
}

inline PointCloud sampled(const std::vector<Rectangle>& walls, double spacing_m) {
  PointCloud cloud;
  for (const Rectangle& each : walls) each.sample(spacing_m, cloud);
  return cloud;
}

/// Buildings of several heights, none along the axes, on both sides of a street about the x axis.
inline std::vector<Rectangle> street() {
  std::vector<Rectangle> walls;
  for (int i = 0; i < 5; ++i) {
    const double x = -60.0 + 30.0 * i;
    for (const Rectangle& each : building({x, 22.0}, {20.0, 14.0}, 0.15, 15.0 + 6.0 * i)) walls.push_back(each);
    for (const Rectangle& each : building({x + 9.0, -24.0}, {22.0, 16.0}, -0.25, 40.0 - 7.0 * i)) walls.push_back(each);
  }
  return walls;
}

/// The range of the first wall, nothing where all are missed. `grown_m` widens (or, negative, narrows) every wall.
inline std::optional<double> exact_range(const std::vector<Rectangle>& walls, const Eigen::Vector3d& origin,
                                         const Eigen::Vector3d& direction, double grown_m = 0.0) {
  std::optional<double> nearest;
  for (const Rectangle& each : walls) {
    const auto crossing = each.cross(origin, direction);
    if (crossing && crossing->margin_m >= -grown_m && (!nearest || crossing->range_m < *nearest)) {
      nearest = crossing->range_m;
    }
  }
  return nearest;
}

/// Uniform on the upper half of the sphere, `min_elevation_rad` and up.
inline Eigen::Vector3d draw_sky_direction(RandomEngine& engine, double min_elevation_rad) {
  const double low = std::sin(min_elevation_rad);
  const double z = low + (1.0 - low) * draw_uniform(engine);
  const double azimuth = 2.0 * M_PI * draw_uniform(engine);
  const double horizontal = std::sqrt(1.0 - z * z);
  return {horizontal * std::cos(azimuth), horizontal * std::sin(azimuth), z};
}

}  // namespace urban_gnss
