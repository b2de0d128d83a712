#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/occlusion/cell_bits.hpp"
#include "urban_gnss_localization/occlusion/key_index.hpp"
#include "urban_gnss_localization/occlusion/observed_space.hpp"
#include "urban_gnss_localization/occlusion/point_cloud.hpp"
#include "urban_gnss_localization/occlusion/voxel_walk.hpp"

namespace urban_gnss {

struct VoxelMapParameters {
  double voxel_size{0.5};
  double window{150.0};
  int max_voxels{1500000};
  int ray_stride{20};
  double observed_cell{4.0};

  void visit(ParameterVisitor& v) {
    v("voxel_size", voxel_size, at_least(0.01), "m", "edge length of a voxel");
    v("window", window, positive(), "m", "distance from the sensor beyond which voxels are dropped");
    v("max_voxels", max_voxels, between(1000, 100000000), "",
      "greatest number of voxels in memory; beyond it the farthest are dropped");
    v("ray_stride", ray_stride, at_least(1), "",
      "number of returns for each ray that is followed, for vegetation and observed space");
    v("observed_cell", observed_cell, at_least(0.1), "m", "edge length of the cubes of observed space");
  }
};

/// What became of an inserted cloud.
struct InsertReport {
  std::size_t points{0};    ///< in the cloud
  std::size_t unusable{0};  ///< not finite, or too far from the map's origin for the grid
  std::size_t new_voxels{0};
  std::size_t dropped_by_window{0};
  std::size_t dropped_by_limit{0};  ///< more than 0: max_voxels is too small for the window
};

struct PointBatch;

/// A map of surfaces that grows scan by scan: for each voxel the mean of its points, the number of its returns, and how
/// many of the followed rays ended there or passed it by. What was seen earlier stays until it is farther than the
/// window.
///
/// A tree of two levels: a hash table finds bricks of kBrickCells cells a side, and a cell has kCellVoxels voxels a
/// side. A brick has a mask of the cells that hold a voxel or have a neighbour that does, one bit each, so that a ray
/// crosses empty space by bricks that are not there, and by bits that are not set. A cell has a mask of its voxels, and
/// keeps them side by side in the order of the bits, so that they are read together.
class VoxelMap {
 public:
  using Index = KeyIndex::Index;
  static constexpr Index kNone = KeyIndex::kNone;
  static constexpr int kCellVoxels = cell_bits::kSide;
  static constexpr int kBrickCells = cell_bits::kSide;

  /// Throws ParameterError.
  explicit VoxelMap(const VoxelMapParameters& parameters);

  /// Adds points (m, map frame) that were seen from `sensor` (m, map frame), then drops what the window and max_voxels
  /// do not allow. Nothing is added, and all points are unusable, where `sensor` is not finite.
  InsertReport add_scan(const PointCloud& points, const Eigen::Vector3d& sensor);

  /// Adds points of a prior map: no rays, no window. Beyond max_voxels the farthest from the cloud's middle go.
  InsertReport add_points(const PointCloud& points);

  void clear();

  std::size_t size() const { return size_; }
  std::size_t memory_bytes() const;
  const VoxelMapParameters& parameters() const { return parameters_; }
  const ObservedSpace& observed_space() const { return observed_; }
  /// Around all that was in the map since it was last dropped from.
  const Eigen::AlignedBox3d& bounds() const { return bounds_; }

  /// The voxels' means within `radius_m` of `center`.
  PointCloud points_within(const Eigen::Vector3d& center, double radius_m) const;
  PointCloud points() const;

  /// The voxel that holds the point, or kNone. An index is valid until something is added or dropped.
  Index find(const Eigen::Vector3d& point) const;
  const Eigen::Vector3f& position(Index voxel) const { return surface_[voxel].mean; }
  /// Its mean's x, y and z and its permeability, to be read together.
  const float* surface(Index voxel) const { return surface_[voxel].mean.data(); }
  std::uint32_t returns(Index voxel) const { return counts_[voxel].returns; }

  /// Of the followed rays that met the voxel's mean, the share that went past it; 0 until kMinEvidence of them did.
  double permeability(Index voxel) const { return surface_[voxel].permeability; }

  double cell_edge_m() const { return cell_edge_m_; }
  double brick_edge_m() const { return kBrickCells * cell_edge_m_; }
  /// The brick of these coordinates, kNone where there is nothing in or beside it.
  Index find_brick(const VoxelCoordinates& brick) const { return brick_index_.find(voxel_key(brick)); }
  /// The cell of these coordinates in the brick that holds it, kNone where neither it nor one of its 26 neighbours
  /// holds a voxel.
  Index find_cell(Index brick, const VoxelCoordinates& cell) const {
    const Index place = cell_bits::place_of(cell);
    return (near_[brick] >> place & 1U) != 0 ? kPlaces * brick + place : kNone;
  }
  Index find_cell(const VoxelCoordinates& cell) const {
    const Index brick = find_brick(brick_of(cell));
    return brick == kNone ? kNone : find_cell(brick, cell);
  }
  static VoxelCoordinates cell_of(const VoxelCoordinates& voxel) { return cell_bits::parent_of(voxel); }
  static VoxelCoordinates brick_of(const VoxelCoordinates& cell) { return cell_bits::parent_of(cell); }
  /// Whether the cell is in the brick whose lowest cell is `first`.
  static bool is_in_brick(const VoxelCoordinates& cell, const VoxelCoordinates& first) {
    const VoxelCoordinates inside = cell - first;
    return ((inside.x() | inside.y() | inside.z()) & ~(kBrickCells - 1)) == 0;
  }
  /// Voxels of one cell, and those of them that are asked for.
  struct CellVoxels {
    Index begin;
    std::uint64_t mask;
    std::uint64_t wanted;
  };
  using NearbyVoxels = std::array<CellVoxels, 27>;
  /// The cells, of this one and its 26 neighbours, that hold a voxel with coordinates from `low` to `high` (both
  /// included): so many of `found`. Cells are picked by a mask of those that hold something, voxels by masks of the
  /// slabs of the box. The voxels' memory is asked for, and not waited for.
  std::size_t find_nearby(Index index, const VoxelCoordinates& cell, const VoxelCoordinates& low,
                          const VoxelCoordinates& high, NearbyVoxels& found) const;
  /// Calls visit(voxel) for each of the voxels that are asked for.
  template <class Visit>
  static void for_each_wanted(const CellVoxels& cell, Visit&& visit) {
    for (std::uint64_t rest = cell.wanted; rest != 0; rest &= rest - 1) {
      visit(cell.begin + cell_bits::rank(cell.mask, rest & (~rest + 1)));
    }
  }

 private:
  static constexpr Index kPlaces = cell_bits::kPlaces;  ///< of cells in a brick
  static constexpr std::uint32_t kMinEvidence = 5;
  static constexpr std::size_t kSizeClasses = 5;  ///< room for 4, 8, 16, 32 or all 64 voxels of a cell

  /// Which voxels of a cell hold points, and where they are.
  struct Cell {
    std::uint64_t mask{0};
    Index begin{0};
    std::uint8_t count{0};
    std::uint8_t size_class{0};  ///< only where count > 0
  };

  struct Surface {
    Eigen::Vector3f mean{Eigen::Vector3f::Zero()};
    float permeability{0.0F};
  };
  struct Counts {
    std::uint32_t returns{0};
    std::uint32_t passes{0};  ///< of followed rays past the mean
    std::uint32_t hits{0};    ///< of followed rays that ended at the mean
  };

  static Index room(std::size_t size_class) { return Index{4} << size_class; }

  /// The brick that was asked for last, which the next question mostly is about, too.
  struct BrickCursor {
    VoxelCoordinates at{VoxelCoordinates::Constant(std::numeric_limits<int>::max())};
    Index brick{kNone};
  };

  bool is_usable(const Eigen::Vector3f& point) const {
    return std::abs(point.x()) < farthest_m_ && std::abs(point.y()) < farthest_m_ && std::abs(point.z()) < farthest_m_;
  }
  Index find_brick(const VoxelCoordinates& brick, BrickCursor& cursor) const {
    if (brick != cursor.at) cursor = {brick, find_brick(brick)};
    return cursor.brick;
  }
  void add_points_of(const PointCloud& points, InsertReport& report);
  void add_batch(PointBatch& batch, BrickCursor& cursor, InsertReport& report);
  void add_to(Index voxel, const Eigen::Vector3f& point);
  void add_to_new_voxel(const Eigen::Vector3f& point, const VoxelCoordinates& voxel, InsertReport& report);
  void add_voxel(const Eigen::Vector3f& point, const VoxelCoordinates& voxel);
  void follow_ray(const Eigen::Vector3d& sensor, const Eigen::Vector3d& end);
  void count_meeting(Index voxel, std::uint32_t Counts::*kind);
  Index find_voxel(const VoxelCoordinates& voxel) const;
  Index find_voxel(Index cell, std::uint64_t bit) const {
    const auto& [mask, begin, count, size_class] = cells_[cell];
    return (mask & bit) == 0 ? kNone : begin + cell_bits::rank(mask, bit);
  }
  Index find_or_add_brick(const VoxelCoordinates& brick);
  Index occupy(const VoxelCoordinates& cell);
  void release(const VoxelCoordinates& cell);
  Index take_block(std::size_t size_class);
  void copy_voxel(Index from, Index to);
  std::size_t drop_beyond(const Eigen::Vector3d& center, double distance_m);
  std::size_t limit_size(const Eigen::Vector3d& center);
  template <class Visit>
  void for_each_voxel(Visit&& visit) const;

  VoxelMapParameters parameters_;
  double inverse_voxel_;
  double cell_edge_m_;
  float farthest_m_;
  std::size_t size_{0};
  KeyIndex brick_index_;
  std::vector<std::uint64_t> near_;  ///< each brick's mask of its cells with something in or beside them
  // The cells, kPlaces to a brick, by what is read together; those of an unused brick are all empty.
  std::vector<std::uint32_t> nearby_;  ///< which of the 27 cells about each hold voxels
  std::vector<Cell> cells_;
  std::vector<Index> unused_bricks_;
  std::vector<Surface> surface_;  ///< what a tracer reads
  std::vector<Counts> counts_;    ///< beside it
  std::array<std::vector<Index>, kSizeClasses> unused_blocks_;
  ObservedSpace observed_;
  Eigen::AlignedBox3d bounds_;
  Eigen::Vector3d last_drop_{Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity())};
  std::size_t ray_phase_{0};
};

}  // namespace urban_gnss
