#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "urban_gnss_localization/occlusion/key_index.hpp"

namespace urban_gnss {

/// The coarse cubes of space that a lidar's rays have passed. They tell free sky from sky that the lidar never saw. A
/// hash table finds bricks of 4 x 4 x 4 cubes, each a mask of one bit a cube.
class ObservedSpace {
 public:
  /// `edge_m` > 0 is the edge of a cube.
  explicit ObservedSpace(double edge_m) : edge_m_(edge_m) {}

  /// Marks the cubes from `origin` to the return at `end` (m), both included. Finite arguments.
  void mark(const Eigen::Vector3d& origin, const Eigen::Vector3d& end);

  /// The share of the ray's length up to `range_m` > 0 that lies in marked cubes. Allocation-free.
  double known_fraction(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double range_m) const;

  /// Forgets the cubes whose centre is farther than `distance_m` from `center`.
  void drop_beyond(const Eigen::Vector3d& center, double distance_m);

  void clear();
  std::size_t size() const;
  std::size_t memory_bytes() const;

 private:
  double edge_m_;
  KeyIndex bricks_;
  std::vector<std::uint64_t> masks_;  ///< of each brick's cubes
};

}  // namespace urban_gnss
