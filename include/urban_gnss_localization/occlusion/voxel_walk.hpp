#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <limits>

namespace urban_gnss {

/// Whole-number coordinates of a cube in a grid.
using VoxelCoordinates = Eigen::Vector3i;

/// Coordinates are packed into 21 bits each.
constexpr int kMaxVoxelCoordinate = (1 << 20) - 2;

inline VoxelCoordinates voxel_of(const Eigen::Vector3d& point, double inverse_edge) {
  return (point * inverse_edge).array().floor().cast<int>();
}

inline std::uint64_t voxel_key(int x, int y, int z) {
  constexpr std::int64_t offset = kMaxVoxelCoordinate + 1;
  return static_cast<std::uint64_t>(x + offset) | static_cast<std::uint64_t>(y + offset) << 21U |
         static_cast<std::uint64_t>(z + offset) << 42U;
}
inline std::uint64_t voxel_key(const VoxelCoordinates& voxel) { return voxel_key(voxel.x(), voxel.y(), voxel.z()); }

inline VoxelCoordinates voxel_of_key(std::uint64_t key) {
  constexpr int offset = kMaxVoxelCoordinate + 1;
  const auto part = [key](unsigned shift) { return static_cast<int>(key >> shift & 0x1FFFFFU) - offset; };
  return {part(0), part(21), part(42)};
}

/// Walks through every cube of a grid that a ray passes, from one to the next through their common face (Amanatides &
/// Woo 1987): none that it passes through is left out, as it would be by steps along the ray. Calls
/// visit(voxel, from_m, to_m) with the ray's stretch inside each, from `begin_m` to `end_m`; stops where that returns
/// false. Requires finite arguments, a unit vector, and that the walk stays within kMaxVoxelCoordinate.
template <class Visit>
void walk_voxels(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double begin_m, double end_m,
                 double edge_m, Visit&& visit) {
  const Eigen::Vector3d start = (origin + begin_m * direction) / edge_m;
  VoxelCoordinates voxel = start.array().floor().cast<int>();
  double next_m[3];
  double stride_m[3];
  int step[3];
  for (int axis = 0; axis < 3; ++axis) {
    const double slope = direction[axis];
    if (slope == 0.0) {
      step[axis] = 0;
      next_m[axis] = stride_m[axis] = std::numeric_limits<double>::infinity();
      continue;
    }
    step[axis] = slope > 0.0 ? 1 : -1;
    stride_m[axis] = edge_m / std::abs(slope);
    const double to_face = slope > 0.0 ? voxel[axis] + 1 - start[axis] : start[axis] - voxel[axis];
    next_m[axis] = begin_m + to_face * stride_m[axis];
  }
  for (double from_m = begin_m; from_m < end_m;) {
    const int axis = next_m[0] < next_m[1] ? (next_m[0] < next_m[2] ? 0 : 2) : (next_m[1] < next_m[2] ? 1 : 2);
    const double to_m = next_m[axis] < end_m ? next_m[axis] : end_m;
    if (!visit(voxel, from_m, to_m)) return;
    from_m = next_m[axis];
    voxel[axis] += step[axis];
    next_m[axis] += stride_m[axis];
  }
}

}  // namespace urban_gnss
