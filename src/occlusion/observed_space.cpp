#include "urban_gnss_localization/occlusion/observed_space.hpp"

#include <limits>
#include <utility>

#include "urban_gnss_localization/occlusion/cell_bits.hpp"
#include "urban_gnss_localization/occlusion/voxel_walk.hpp"

namespace urban_gnss {
namespace {

/// Calls visit(cube, from_m, to_m, is_new_brick, brick) along a ray: a brick has to be looked up where it is new only.
template <class Visit>
void walk_bricks(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double range_m, double edge_m,
                 Visit&& visit) {
  VoxelCoordinates brick = VoxelCoordinates::Constant(std::numeric_limits<int>::max());
  walk_voxels(origin, direction, 0.0, range_m, edge_m, [&](const VoxelCoordinates& cube, double from_m, double to_m) {
    const VoxelCoordinates at = cell_bits::parent_of(cube);
    const bool is_new_brick = at != brick;
    brick = at;
    return visit(cube, from_m, to_m, is_new_brick, brick);
  });
}

}  // namespace

void ObservedSpace::mark(const Eigen::Vector3d& origin, const Eigen::Vector3d& end) {
  KeyIndex::Index found = KeyIndex::kNone;
  const auto find = [&](const VoxelCoordinates& brick) {
    found = bricks_.find_or_insert(voxel_key(brick), static_cast<KeyIndex::Index>(masks_.size()));
    if (found == masks_.size()) masks_.push_back(0);
  };
  const VoxelCoordinates last = voxel_of(end, 1.0 / edge_m_);
  find(cell_bits::parent_of(last));
  masks_[found] |= cell_bits::bit_of(last);
  const double length_m = (end - origin).norm();
  if (length_m == 0.0) return;
  walk_bricks(origin, (end - origin) / length_m, length_m, edge_m_,
              [&](const VoxelCoordinates& cube, double, double, bool is_new_brick, const VoxelCoordinates& brick) {
                if (is_new_brick) find(brick);
                masks_[found] |= cell_bits::bit_of(cube);
                return true;
              });
}

double ObservedSpace::known_fraction(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                     double range_m) const {
  if (!origin.allFinite() || !direction.allFinite() || !(range_m > 0.0)) return 0.0;
  double known_m = 0.0;
  std::uint64_t mask = 0;
  walk_bricks(
      origin, direction, range_m, edge_m_,
      [&](const VoxelCoordinates& cube, double from_m, double to_m, bool is_new_brick, const VoxelCoordinates& brick) {
        if (is_new_brick) {
          if (cube.cwiseAbs().maxCoeff() > kMaxVoxelCoordinate) return false;
          const KeyIndex::Index found = bricks_.find(voxel_key(brick));
          mask = found == KeyIndex::kNone ? 0 : masks_[found];
        }
        if ((mask & cell_bits::bit_of(cube)) != 0) known_m += to_m - from_m;
        return true;
      });
  return known_m / range_m;
}

void ObservedSpace::drop_beyond(const Eigen::Vector3d& center, double distance_m) {
  ObservedSpace kept(edge_m_);
  bricks_.for_each([&](KeyIndex::Key key, KeyIndex::Index brick) {
    std::uint64_t mask = 0;
    for (std::uint64_t rest = masks_[brick]; rest != 0; rest &= rest - 1) {
      const auto place = static_cast<std::uint32_t>(__builtin_ctzll(rest));
      const VoxelCoordinates cube = cell_bits::kSide * voxel_of_key(key) + cell_bits::at_place(place);
      const Eigen::Vector3d middle = edge_m_ * (cube.cast<double>().array() + 0.5).matrix();
      if ((middle - center).norm() <= distance_m) mask |= std::uint64_t{1} << place;
    }
    if (mask == 0) return;
    kept.bricks_.find_or_insert(key, static_cast<KeyIndex::Index>(kept.masks_.size()));
    kept.masks_.push_back(mask);
  });
  *this = std::move(kept);
}

void ObservedSpace::clear() { *this = ObservedSpace(edge_m_); }

std::size_t ObservedSpace::size() const {
  std::size_t cubes = 0;
  for (const std::uint64_t mask : masks_) cubes += static_cast<std::size_t>(__builtin_popcountll(mask));
  return cubes;
}

std::size_t ObservedSpace::memory_bytes() const {
  return bricks_.memory_bytes() + masks_.capacity() * sizeof(std::uint64_t);
}

}  // namespace urban_gnss
