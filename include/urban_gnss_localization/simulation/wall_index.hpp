#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "urban_gnss_localization/simulation/polygon.hpp"
#include "urban_gnss_localization/simulation/world.hpp"

namespace urban_gnss {

/// One side of a building: a vertical rectangle.
struct Wall {
  Eigen::Vector2d from{Eigen::Vector2d::Zero()};  ///< m; the building is to the left of from -> to
  Eigen::Vector2d to{Eigen::Vector2d::Zero()};
  Eigen::Vector2d normal{Eigen::Vector2d::Zero()};  ///< unit, out of the building
  double base_m{0.0};
  double roof_m{0.0};
  double reflection_loss_db{0.0};
  int building{0};  ///< index into World::buildings
};

/// The exact casting of rays at the buildings of a world, in double precision. A ray is walked over a uniform grid of
/// the walls' footprints (J. Amanatides, A. Woo: A Fast Voxel Traversal Algorithm for Ray Tracing, Eurographics 1987)
/// and each wall that it meets is intersected analytically; the buildings' horizontal faces (roofs seen from above,
/// undersides of what has a base above the ground seen from below) are intersected, too. Walls are met from either
/// side. Copies the world; to be shared between threads as it is const.
class WallIndex {
 public:
  static constexpr int kHorizontalFace = -1;

  struct Hit {
    double range_m{0.0};        ///< along the ray
    int wall{kHorizontalFace};  ///< index into walls(), or kHorizontalFace
    int building{0};
  };
  struct Crossing {
    double distance_m{0.0};  ///< horizontal, along the ray
    int wall{0};
  };

  /// Footprints of either orientation; requires what polygon_fault() accepts, and roofs above their bases.
  explicit WallIndex(const World& world);

  /// The sides of each building in turn, counter-clockwise around it.
  const std::vector<Wall>& walls() const { return walls_; }

  /// The nearest face that the ray from `origin` (m, map frame) along the unit vector `direction` meets within
  /// `max_range_m` (may be infinite). A face within 1e-9 m of the origin along the ray is not met. Nothing where an
  /// argument is not finite. Allocation-free.
  std::optional<Hit> cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                          double max_range_m = std::numeric_limits<double>::infinity()) const;

  /// Every wall whose footprint the horizontal ray from `origin` along the unit vector `direction` crosses, whatever
  /// its height, nearest first, up to `max_distance_m`. Clears `crossings` first. A ray through a corner crosses both
  /// walls.
  void crossings(const Eigen::Vector2d& origin, const Eigen::Vector2d& direction, double max_distance_m,
                 std::vector<Crossing>& crossings) const;

  /// Whether the point (m, map frame) is inside a building, its top and bottom included.
  bool is_inside(const Eigen::Vector3d& point) const { return building_at(point).has_value(); }

  /// The first building (index into World::buildings) that the point is inside of.
  std::optional<int> building_at(const Eigen::Vector3d& point) const;

 private:
  /// What the intersection needs of a wall, together in the cache.
  struct Segment {
    Eigen::Vector2d from;
    Eigen::Vector2d edge;
    double end_tolerance;  ///< as a share of the edge
    double base_m;
    double roof_m;
  };
  struct Block {
    Polygon footprint;
    Eigen::Vector2d low;
    Eigen::Vector2d high;
    double base_m;
    double roof_m;

    bool covers(const Eigen::Vector2d& point) const;
  };
  struct Face {
    double height_m;
    int building;
  };

  void add(const Building& building, int index);
  void build_grid();
  static double range_to(const Segment& segment, const Eigen::Vector2d& origin, const Eigen::Vector2d& direction);
  template <class Visit>
  void walk(const Eigen::Vector2d& origin, const Eigen::Vector2d& direction, const double& limit,
            const Visit& visit) const;
  void cast_at_faces(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, Hit& nearest) const;
  void cast_at_walls(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, Hit& nearest) const;

  std::vector<Wall> walls_;
  std::vector<Segment> segments_;  ///< of walls_
  std::vector<Block> blocks_;      ///< of World::buildings
  std::vector<Face> roofs_;        ///< lowest first
  std::vector<Face> undersides_;   ///< lowest first
  double lowest_base_m_{std::numeric_limits<double>::infinity()};
  double highest_roof_m_{-std::numeric_limits<double>::infinity()};

  Eigen::Vector2d grid_low_{Eigen::Vector2d::Zero()};
  double cell_size_m_{8.0};
  Eigen::Array2i cell_count_{Eigen::Array2i::Zero()};
  std::vector<std::uint32_t> cell_start_;  ///< of each cell, row by row, in cell_walls_; one more at the end
  std::vector<int> cell_walls_;
};

}  // namespace urban_gnss
