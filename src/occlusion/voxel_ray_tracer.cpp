#include "urban_gnss_localization/occlusion/voxel_ray_tracer.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace urban_gnss {
namespace {

constexpr double kMargin_m = 0.01;

/// In link lengths: how far from the ray the corners of a pierced triangle are looked for. This is the radius of the
/// circle about the largest equilateral triangle, the largest hole that three linked points can close.
const double kReach = 1.0 / std::sqrt(3.0);

/// Points about a stretch of a ray, seen along it.
class RayNeighbourhood {
 public:
  /// As many as a mask has bits.
  static constexpr std::size_t kCapacity = 64;

  void clear() { count_ = 0; }

  /// `across` (m) is the point's place in the plane normal to the ray, the ray at the origin. Where there is no room
  /// the point farthest from the ray gives way.
  void add(const Eigen::Vector2f& across, const Eigen::Vector3f& point, float along_m) {
    std::size_t slot = count_;
    if (count_ == kCapacity) {
      slot = 0;
      for (std::size_t i = 1; i < kCapacity; ++i) {
        if (across_[i].squaredNorm() > across_[slot].squaredNorm()) slot = i;
      }
      if (across_[slot].squaredNorm() <= across.squaredNorm()) return;
    } else {
      ++count_;
    }
    across_[slot] = across;
    point_[slot] = point;
    along_m_[slot] = along_m;
  }

  /// Whether the ray is between the points at all: no half-plane through it holds them all.
  bool is_surrounded() const {
    if (count_ < 3) return false;
    Eigen::Vector2f right = across_[0];  // the points' sector, counter-clockwise from right to left, under 180 degrees
    Eigen::Vector2f left = across_[0];
    for (std::size_t i = 1; i < count_; ++i) {
      const bool left_of_right = cross(right, across_[i]) >= 0.0F;
      const bool right_of_left = cross(across_[i], left) >= 0.0F;
      if (left_of_right && right_of_left) continue;
      if (!left_of_right && !right_of_left) return true;
      (left_of_right ? left : right) = across_[i];
    }
    return false;
  }

  /// Whether the ray pierces a triangle of points mutually within `link_m`; sets the range at which it does.
  bool pierced(float link_m, double& range_m) const {
    std::array<std::uint64_t, kCapacity> linked{};
    std::array<std::uint64_t, kCapacity> left_of{};  // points less than 180 degrees counter-clockwise
    const float limit = link_m * link_m;
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t j = i + 1; j < count_; ++j) {
        if ((point_[i] - point_[j]).squaredNorm() > limit) continue;
        linked[i] |= bit(j);
        linked[j] |= bit(i);
        const bool is_left = cross(across_[i], across_[j]) > 0.0F;
        left_of[is_left ? i : j] |= bit(is_left ? j : i);
      }
    }
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::uint64_t rest = left_of[i]; rest != 0; rest &= rest - 1) {
        const auto j = static_cast<std::size_t>(__builtin_ctzll(rest));
        // k is left of j, and i is left of k.
        const std::uint64_t third = linked[i] & left_of[j] & ~left_of[i];
        if (third == 0) continue;
        const auto k = static_cast<std::size_t>(__builtin_ctzll(third));
        range_m = crossing_m(i, j, k);
        return true;
      }
    }
    return false;
  }

 private:
  static std::uint64_t bit(std::size_t i) { return std::uint64_t{1} << i; }
  static float cross(const Eigen::Vector2f& a, const Eigen::Vector2f& b) { return a.x() * b.y() - a.y() * b.x(); }

  /// By the barycentric coordinates of the origin.
  double crossing_m(std::size_t i, std::size_t j, std::size_t k) const {
    const float wi = cross(across_[j], across_[k]);
    const float wj = cross(across_[k], across_[i]);
    const float wk = cross(across_[i], across_[j]);
    return (wi * along_m_[i] + wj * along_m_[j] + wk * along_m_[k]) / (wi + wj + wk);
  }

  std::size_t count_{0};
  std::array<Eigen::Vector2f, kCapacity> across_;
  std::array<Eigen::Vector3f, kCapacity> point_;
  std::array<float, kCapacity> along_m_;
};

/// The part of a ray inside a box; empty (begin > end) where it misses it.
struct Stretch {
  double begin_m;
  double end_m;
};

Stretch clip(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, const Eigen::AlignedBox3d& box,
             Stretch stretch) {
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0.0) {
      if (origin[axis] < box.min()[axis] || origin[axis] > box.max()[axis]) return {1.0, 0.0};
      continue;
    }
    const double a = (box.min()[axis] - origin[axis]) / direction[axis];
    const double b = (box.max()[axis] - origin[axis]) / direction[axis];
    stretch.begin_m = std::max(stretch.begin_m, std::min(a, b));
    stretch.end_m = std::min(stretch.end_m, std::max(a, b));
  }
  return stretch;
}

}  // namespace

void VoxelRayTracerParameters::check(std::vector<std::string>& faults) const {
  if (min_range >= max_range) faults.push_back("min_range: must be less than max_range");
}

VoxelMapParameters voxel_map_parameters_for(double spacing_m) {
  VoxelMapParameters parameters;
  parameters.voxel_size = spacing_m;
  parameters.max_voxels = 20000000;
  return parameters;
}

VoxelRayTracer::VoxelRayTracer(const VoxelMap& map, const VoxelRayTracerParameters& parameters)
    : map_(&map), parameters_(parameters), link_m_(parameters.link_length * map.parameters().voxel_size) {
  std::vector<std::string> faults;
  parameters.check(faults);
  if (!(parameters.link_length >= 1.0 && parameters.link_length <= VoxelMap::kCellVoxels)) {
    faults.push_back("link_length: must be between 1 and 4 voxels");
  }
  if (!faults.empty()) throw ParameterError("voxel ray tracer", faults);
}

RayVerdict VoxelRayTracer::trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  RayVerdict verdict;
  if (map_->size() == 0 || !origin.allFinite() || !direction.allFinite()) return verdict;
  Eigen::AlignedBox3d bounds = map_->bounds();
  bounds.extend((bounds.min().array() - kMargin_m).matrix());  // a flat map has a thickness
  bounds.extend((bounds.max().array() + kMargin_m).matrix());
  const Stretch inside = clip(origin, direction, bounds, {parameters_.min_range, parameters_.max_range});
  if (inside.begin_m > inside.end_m) return verdict;

  // Two axes across the ray, and a shift that keeps it off the lines between points of a regular grid.
  const Eigen::Vector3f axis = direction.cast<float>();
  const Eigen::Vector3f u = axis.unitOrthogonal();
  const Eigen::Vector3f v = axis.cross(u);
  const Eigen::Vector2f shift(6e-5F, 8e-5F);
  const Eigen::Vector3f start = origin.cast<float>();
  const auto link_m = static_cast<float>(link_m_);
  const double reach_m = kReach * link_m_;
  const auto squared_reach = static_cast<float>(reach_m * reach_m);
  const double edge_m = map_->cell_edge_m();
  const double octant_reach_m = reach_m + 0.25 * std::sqrt(3.0) * edge_m;  // to the middle of an octant
  const auto squared_octant_reach = static_cast<float>(octant_reach_m * octant_reach_m);
  RayNeighbourhood solid;
  RayNeighbourhood permeable;

  const auto visit = [&](const VoxelCoordinates& cell, double from_m, double to_m) {
    const VoxelMap::Index center = map_->find_cell(cell);
    if (center == VoxelMap::kNone) return true;
    solid.clear();
    permeable.clear();
    const auto nearest_m = static_cast<float>(std::max(from_m - reach_m, parameters_.min_range));
    const auto farthest_m = static_cast<float>(std::min(to_m + reach_m, parameters_.max_range));
    const auto gather = [&](VoxelMap::Index voxel) {
      const Eigen::Vector3f offset = map_->position(voxel) - start;
      const float along_m = offset.dot(axis);
      if (along_m < nearest_m || along_m > farthest_m) return;
      const Eigen::Vector2f across(offset.dot(u) + shift.x(), offset.dot(v) + shift.y());
      if (across.squaredNorm() > squared_reach) return;
      const bool is_solid = map_->permeability(voxel) <= parameters_.max_permeability;
      (is_solid ? solid : permeable).add(across, map_->position(voxel), along_m);
    };
    const auto gather_cell = [&](const VoxelCoordinates& coordinates) {
      const Eigen::Vector3f corner = (edge_m * coordinates.cast<double>() - origin).cast<float>();
      map_->for_each_octant(map_->find_cell(coordinates), [&](int octant, VoxelMap::Index begin, VoxelMap::Index end) {
        const Eigen::Vector3f half(octant & 1 ? 0.75F : 0.25F, octant & 2 ? 0.75F : 0.25F, octant & 4 ? 0.75F : 0.25F);
        const Eigen::Vector3f middle = corner + static_cast<float>(edge_m) * half;
        if ((middle - middle.dot(axis) * axis).squaredNorm() > squared_octant_reach) return;
        for (VoxelMap::Index voxel = begin; voxel != end; ++voxel) gather(voxel);
      });
    };
    // The cells that the ray's stretch, widened by the reach, touches: never more than the neighbours.
    const Eigen::Vector3d a = origin + from_m * direction;
    const Eigen::Vector3d b = origin + to_m * direction;
    const VoxelCoordinates low = voxel_of((a.cwiseMin(b).array() - reach_m).matrix(), 1.0 / edge_m) - cell;
    const VoxelCoordinates high = voxel_of((a.cwiseMax(b).array() + reach_m).matrix(), 1.0 / edge_m) - cell;
    for (int x = std::max(low.x(), -1); x <= std::min(high.x(), 1); ++x) {
      for (int y = std::max(low.y(), -1); y <= std::min(high.y(), 1); ++y) {
        for (int z = std::max(low.z(), -1); z <= std::min(high.z(), 1); ++z) {
          if (!map_->is_occupied_nearby(center, x, y, z)) continue;
          gather_cell(cell + VoxelCoordinates(x, y, z));
        }
      }
    }
    if (solid.is_surrounded() && solid.pierced(link_m, verdict.range_m)) {
      verdict.blocked = true;
      return false;
    }
    double unused_m = 0.0;
    if (permeable.is_surrounded() && permeable.pierced(link_m, unused_m)) verdict.vegetation_m += to_m - from_m;
    return true;
  };
  walk_voxels(origin, direction, inside.begin_m, inside.end_m, edge_m, visit);
  return verdict;
}

}  // namespace urban_gnss
