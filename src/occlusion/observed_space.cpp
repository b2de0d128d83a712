#include "urban_gnss_localization/occlusion/observed_space.hpp"

#include "urban_gnss_localization/occlusion/voxel_walk.hpp"

namespace urban_gnss {

void ObservedSpace::mark(const Eigen::Vector3d& origin, const Eigen::Vector3d& end) {
  const double length_m = (end - origin).norm();
  cubes_.find_or_insert(voxel_key(voxel_of(end, 1.0 / edge_m_)), 0);
  if (length_m == 0.0) return;
  walk_voxels(origin, (end - origin) / length_m, 0.0, length_m, edge_m_, [&](const auto& cube, double, double) {
    cubes_.find_or_insert(voxel_key(cube), 0);
    return true;
  });
}

double ObservedSpace::known_fraction(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                     double range_m) const {
  if (!origin.allFinite() || !direction.allFinite() || !(range_m > 0.0)) return 0.0;
  double known_m = 0.0;
  walk_voxels(origin, direction, 0.0, range_m, edge_m_, [&](const auto& cube, double from_m, double to_m) {
    if (cube.cwiseAbs().maxCoeff() > kMaxVoxelCoordinate) return false;
    if (cubes_.find(voxel_key(cube)) != KeyIndex::kNone) known_m += to_m - from_m;
    return true;
  });
  return known_m / range_m;
}

void ObservedSpace::drop_beyond(const Eigen::Vector3d& center, double distance_m) {
  KeyIndex kept;
  cubes_.for_each([&](KeyIndex::Key key, KeyIndex::Index) {
    const Eigen::Vector3d cube = edge_m_ * (voxel_of_key(key).cast<double>().array() + 0.5).matrix();
    if ((cube - center).norm() <= distance_m) kept.find_or_insert(key, 0);
  });
  cubes_ = std::move(kept);
}

}  // namespace urban_gnss
