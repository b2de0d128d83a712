#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/occlusion/key_index.hpp"
#include "urban_gnss_localization/occlusion/observed_space.hpp"
#include "urban_gnss_localization/occlusion/point_cloud.hpp"
#include "urban_gnss_localization/occlusion/voxel_walk.hpp"

namespace urban_gnss {

struct VoxelMapParameters {
  double voxel_size{0.5};     ///< m
  double window{150.0};       ///< m, voxels farther than this from the sensor are dropped
  int max_voxels{1500000};    ///< bound of the memory; the farthest are dropped beyond it
  int ray_stride{20};         ///< every so many returns' ray is followed for permeability and observed space
  double observed_cell{4.0};  ///< m, edge of the cubes of observed space

  template <class V>
  void visit(V& v) {
    v("voxel_size", voxel_size, at_least(0.01));
    v("window", window, positive());
    v("max_voxels", max_voxels, between(1000, 100000000));
    v("ray_stride", ray_stride, at_least(1));
    v("observed_cell", observed_cell, at_least(0.1));
  }
  void check(std::vector<std::string>&) const {}
};

/// What became of an inserted cloud.
struct InsertReport {
  std::size_t points{0};    ///< in the cloud
  std::size_t unusable{0};  ///< not finite, or too far from the map's origin for the grid
  std::size_t new_voxels{0};
  std::size_t dropped_by_window{0};
  std::size_t dropped_by_limit{0};  ///< more than 0: max_voxels is too small for the window
};

/// A map of surfaces that grows scan by scan: for each voxel the mean of its points, the number of its returns, and how
/// many of the followed rays ended there or passed it by. What was seen earlier stays until it is farther than the
/// window.
///
/// A hash table finds cells of kCellVoxels a side, which is what a ray walks along. A cell has a mask of its voxels,
/// one bit each, and keeps them side by side in the order of the bits, so that they are read together. Each byte of the
/// mask is one octant of the cell, two voxels a side.
class VoxelMap {
 public:
  using Index = KeyIndex::Index;
  static constexpr Index kNone = KeyIndex::kNone;
  static constexpr int kCellVoxels = 4;

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
  std::uint32_t returns(Index voxel) const { return counts_[voxel].returns; }

  /// Of the followed rays that met the voxel's mean, the share that went past it; 0 until kMinEvidence of them did.
  double permeability(Index voxel) const { return surface_[voxel].permeability; }

  double cell_edge_m() const { return cell_edge_m_; }
  /// The cell of these coordinates, kNone where neither it nor one of its 26 neighbours holds a voxel.
  Index find_cell(const VoxelCoordinates& cell) const { return cell_index_.find(voxel_key(cell)); }
  /// Whether the neighbour at these offsets, each -1, 0 or 1 (0, 0, 0 is the cell itself), holds a voxel.
  bool is_occupied_nearby(Index cell, int dx, int dy, int dz) const {
    return (cells_[cell].nearby & nearby_bit(dx, dy, dz)) != 0;
  }
  /// Calls visit(octant, begin, end) for each octant of a cell that holds voxels: those from begin up to end. Bit 0 of
  /// `octant` is set in the upper half of x, bit 1 of y, bit 2 of z.
  template <class Visit>
  void for_each_octant(Index cell, Visit&& visit) const {
    Index begin = cells_[cell].begin;
    std::uint64_t mask = cells_[cell].mask;
    for (int octant = 0; mask != 0; ++octant, mask >>= 8U) {
      const auto count = static_cast<Index>(__builtin_popcountll(mask & 0xFFU));
      if (count > 0) visit(octant, begin, begin + count);
      begin += count;
    }
  }

 private:
  static constexpr std::uint32_t kMinEvidence = 5;
  static constexpr std::size_t kSizeClasses = 5;  ///< room for 4, 8, 16, 32 or all 64 voxels of a cell

  struct Cell {
    std::uint64_t mask{0};    ///< of its voxels
    std::uint32_t nearby{0};  ///< which of the 27 cells about it hold voxels
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

  static std::uint32_t nearby_bit(int dx, int dy, int dz) {
    return 1U << static_cast<unsigned>(9 * (dx + 1) + 3 * (dy + 1) + dz + 1);
  }
  static Index room(std::size_t size_class) { return Index{4} << size_class; }

  void add_point(const Eigen::Vector3f& point, InsertReport& report);
  void follow_ray(const Eigen::Vector3d& sensor, const Eigen::Vector3d& end);
  void count_meeting(Index voxel, std::uint32_t Counts::*kind);
  Index find_voxel(const VoxelCoordinates& voxel) const;
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
  KeyIndex cell_index_;
  std::vector<Cell> cells_;
  std::vector<Index> unused_cells_;
  std::vector<Surface> surface_;  ///< what a tracer reads
  std::vector<Counts> counts_;    ///< beside it
  std::array<std::vector<Index>, kSizeClasses> unused_blocks_;
  ObservedSpace observed_;
  Eigen::AlignedBox3d bounds_;
  Eigen::Vector3d last_drop_{Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity())};
  std::size_t ray_phase_{0};
};

}  // namespace urban_gnss
