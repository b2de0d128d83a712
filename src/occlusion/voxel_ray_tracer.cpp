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

  /// `place` (m): x and y in the plane normal to the ray, the ray at the origin, z along it. Where there is no room the
  /// point farthest from the ray gives way.
  void add(const Eigen::Vector4f& place, const Eigen::Vector3f& point) {
    const Eigen::Vector2f across = place.head<2>();
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
    along_m_[slot] = place.z();
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
    // Without jumps, which would be foretold wrongly half the time.
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t j = i + 1; j < count_; ++j) {
        const std::uint64_t is_linked = (point_[i] - point_[j]).squaredNorm() > limit ? 0U : 1U;
        const std::uint64_t is_left = cross(across_[i], across_[j]) > 0.0F ? 1U : 0U;
        linked[i] |= is_linked << j;
        linked[j] |= is_linked << i;
        left_of[i] |= (is_linked & is_left) << j;
        left_of[j] |= (is_linked & ~is_left) << i;
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

/// Places as a ray sees them: x and y (m) across it, z (m) along it, the fourth number unused. Written by columns,
/// which are added as whole vectors.
class RayFrame {
 public:
  RayFrame(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) : origin_(origin.cast<float>()) {
    const Eigen::Vector3f along = direction.cast<float>();
    const Eigen::Vector3f u = along.unitOrthogonal();
    axes_ << u.transpose(), along.cross(u).transpose(), along.transpose(), Eigen::RowVector3f::Zero();
  }

  Eigen::Vector4f turned(const Eigen::Vector3f& offset) const {
    return axes_.col(0) * offset.x() + axes_.col(1) * offset.y() + axes_.col(2) * offset.z();
  }
  /// Shifted so that the ray is kept off the lines between points of a regular grid.
  Eigen::Vector4f place(const Eigen::Vector3f& point) const {
    return turned(point - origin_) + Eigen::Vector4f(6e-5F, 8e-5F, 0.0F, 0.0F);
  }

 private:
  Eigen::Matrix<float, 4, 3> axes_;
  Eigen::Vector3f origin_;
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

/// The part of a ray within the tracer's range that may meet something of the map.
Stretch stretch_through(const VoxelMap& map, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                        const VoxelRayTracerParameters& parameters) {
  Eigen::AlignedBox3d bounds = map.bounds();
  bounds.extend((bounds.min().array() - kMargin_m).matrix());  // a flat map has a thickness
  bounds.extend((bounds.max().array() + kMargin_m).matrix());
  return clip(origin, direction, bounds, {parameters.min_range, parameters.max_range});
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
  require_usable("voxel ray tracer", parameters);
}

RayOutcome VoxelRayTracer::trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  RayOutcome outcome;
  if (map_->size() == 0 || !origin.allFinite() || !direction.allFinite()) return outcome;
  const Stretch inside = stretch_through(*map_, origin, direction, parameters_);
  if (inside.begin_m > inside.end_m) return outcome;

  const RayFrame frame(origin, direction);
  const auto link_m = static_cast<float>(link_m_);
  const double reach_m = kReach * link_m_;
  const auto squared_reach = static_cast<float>(reach_m * reach_m);
  const double inverse_voxel = 1.0 / map_->parameters().voxel_size;
  RayNeighbourhood solid;
  RayNeighbourhood permeable;
  VoxelMap::NearbyVoxels nearby;
  std::array<Eigen::Vector4f, cell_bits::kPlaces> places;
  std::array<VoxelMap::Index, cell_bits::kPlaces> voxels;

  const auto visit = [&](VoxelMap::Index center, const VoxelCoordinates& cell, double from_m, double to_m) {
    // The voxels that the box about the stretch, widened by the reach, touches: in the cell and its neighbours.
    const Eigen::Vector3d a = origin + from_m * direction;
    const Eigen::Vector3d b = origin + to_m * direction;
    const VoxelCoordinates low = voxel_of((a.cwiseMin(b).array() - reach_m).matrix(), inverse_voxel);
    const VoxelCoordinates high = voxel_of((a.cwiseMax(b).array() + reach_m).matrix(), inverse_voxel);
    const std::size_t cells = map_->find_nearby(center, cell, low, high, nearby);
    if (cells == 0) return true;
    solid.clear();
    permeable.clear();
    const auto nearest_m = static_cast<float>(std::max(from_m - reach_m, parameters_.min_range));
    const auto farthest_m = static_cast<float>(std::min(to_m + reach_m, parameters_.max_range));
    for (std::size_t i = 0; i < cells; ++i) {
      // All are written down, and the next one over those that are out of reach: that is quicker than to jump.
      std::size_t count = 0;
      VoxelMap::for_each_wanted(nearby[i], [&](VoxelMap::Index voxel) {
        const Eigen::Vector4f place = frame.place(map_->position(voxel));
        places[count] = place;
        voxels[count] = voxel;
        const bool is_near = place.head<2>().squaredNorm() <= squared_reach;
        const bool is_along = (place.z() >= nearest_m) & (place.z() <= farthest_m);
        count += static_cast<std::size_t>(is_near & is_along);
      });
      for (std::size_t k = 0; k < count; ++k) {
        const bool is_solid = map_->permeability(voxels[k]) <= parameters_.max_permeability;
        (is_solid ? solid : permeable).add(places[k], map_->position(voxels[k]));
      }
    }
    if (solid.is_surrounded() && solid.pierced(link_m, outcome.range_m)) {
      outcome.blocked = true;
      return false;
    }
    double unused_m = 0.0;
    if (permeable.is_surrounded() && permeable.pierced(link_m, unused_m)) outcome.vegetation_m += to_m - from_m;
    return true;
  };

  const GridRay by_cell(origin, direction, map_->cell_edge_m());
  const auto visit_brick = [&](const VoxelCoordinates& coordinates, double brick_from_m, double brick_to_m) {
    const VoxelMap::Index brick = map_->find_brick(coordinates);
    if (brick == VoxelMap::kNone) return true;
    by_cell.walk(brick_from_m, brick_to_m, [&](const VoxelCoordinates& cell, double from_m, double to_m) {
      // On the border rounding may lead into the next brick, for less than a hair's breadth.
      if (VoxelMap::brick_of(cell) != coordinates) return true;
      const VoxelMap::Index found = map_->find_cell(brick, cell);
      return found == VoxelMap::kNone || visit(found, cell, from_m, to_m);
    });
    return !outcome.blocked;
  };
  GridRay(origin, direction, map_->brick_edge_m()).walk(inside.begin_m, inside.end_m, visit_brick);
  return outcome;
}

}  // namespace urban_gnss
