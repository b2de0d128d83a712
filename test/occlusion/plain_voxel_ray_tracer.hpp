#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "urban_gnss_localization/occlusion/voxel_map.hpp"
#include "urban_gnss_localization/occlusion/voxel_ray_tracer.hpp"

namespace urban_gnss {

/// Amanatides and Woo's walk, plainly: calls visit(cube, from_m, to_m) until that returns false.
template <class Visit>
void walk_plainly(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double begin_m, double end_m,
                  double edge_m, Visit&& visit) {
  const Eigen::Vector3d start = (origin + begin_m * direction) / edge_m;
  VoxelCoordinates cube = start.array().floor().cast<int>();
  double next_m[3];
  double stride_m[3];
  for (int axis = 0; axis < 3; ++axis) {
    const double slope = direction[axis];
    const double to_face = slope > 0.0 ? cube[axis] + 1 - start[axis] : start[axis] - cube[axis];
    stride_m[axis] = slope == 0.0 ? std::numeric_limits<double>::infinity() : edge_m / std::abs(slope);
    next_m[axis] = slope == 0.0 ? stride_m[axis] : begin_m + to_face * stride_m[axis];
  }
  for (double from_m = begin_m; from_m < end_m;) {
    const int axis = next_m[0] < next_m[1] ? (next_m[0] < next_m[2] ? 0 : 2) : (next_m[1] < next_m[2] ? 1 : 2);
    if (!visit(cube, from_m, std::min(next_m[axis], end_m))) return;
    from_m = next_m[axis];
    cube[axis] += direction[axis] > 0.0 ? 1 : -1;
    next_m[axis] += stride_m[axis];
  }
}

/// VoxelRayTracer as its description says it, without a mask: the reference whose outcome is the same to the last bit.
class PlainVoxelRayTracer : public RayTracer {
 public:
  PlainVoxelRayTracer(const VoxelMap& map, const VoxelRayTracerParameters& parameters)
      : map_(map), parameters_(parameters), link_m_(parameters.link_length * map.parameters().voxel_size) {}

  RayOutcome trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const override {
    RayOutcome outcome;
    if (map_.size() == 0) return outcome;
    double begin_m = parameters_.min_range;
    double end_m = parameters_.max_range;
    for (int axis = 0; axis < 3; ++axis) {
      const double low_m = map_.bounds().min()[axis] - 0.01 - origin[axis];
      const double high_m = map_.bounds().max()[axis] + 0.01 - origin[axis];
      if (direction[axis] == 0.0 && (low_m > 0.0 || high_m < 0.0)) return outcome;
      if (direction[axis] == 0.0) continue;
      begin_m = std::max(begin_m, std::min(low_m / direction[axis], high_m / direction[axis]));
      end_m = std::min(end_m, std::max(low_m / direction[axis], high_m / direction[axis]));
    }
    if (begin_m > end_m) return outcome;
    walk_plainly(
        origin, direction, begin_m, end_m, map_.brick_edge_m(), [&](const auto& brick, double from, double to) {
          walk_plainly(
              origin, direction, from, to, map_.cell_edge_m(), [&](const auto& cell, double from_m, double to_m) {
                return VoxelMap::brick_of(cell) != brick || pass(origin, direction, cell, from_m, to_m, outcome);
              });
          return !outcome.blocked;
        });
    return outcome;
  }

 private:
  struct Point {
    Eigen::Vector3f place;
    Eigen::Vector2f across;
    float along_m;
  };

  static float cross(const Eigen::Vector2f& a, const Eigen::Vector2f& b) { return a.x() * b.y() - a.y() * b.x(); }

  /// Whether the ray goes on behind this cell.
  bool pass(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, const VoxelCoordinates& cell,
            double from_m, double to_m, RayOutcome& outcome) const {
    std::vector<Point> solid;
    std::vector<Point> permeable;
    gather(origin, direction, cell, from_m, to_m, solid, permeable);
    if (pierced(solid, outcome.range_m)) {
      outcome.blocked = true;
      return false;
    }
    double unused_m = 0.0;
    if (pierced(permeable, unused_m)) outcome.vegetation_m += to_m - from_m;
    return true;
  }

  void gather(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, const VoxelCoordinates& cell,
              double from_m, double to_m, std::vector<Point>& solid, std::vector<Point>& permeable) const {
    const double voxel_m = map_.parameters().voxel_size;
    const double reach_m = 1.0 / std::sqrt(3.0) * link_m_;
    const Eigen::Vector3d a = origin + from_m * direction;
    const Eigen::Vector3d b = origin + to_m * direction;
    const VoxelCoordinates low = voxel_of((a.cwiseMin(b).array() - reach_m).matrix(), 1.0 / voxel_m);
    const VoxelCoordinates high = voxel_of((a.cwiseMax(b).array() + reach_m).matrix(), 1.0 / voxel_m);
    const auto nearest_m = static_cast<float>(std::max(from_m - reach_m, parameters_.min_range));
    const auto farthest_m = static_cast<float>(std::min(to_m + reach_m, parameters_.max_range));
    const Eigen::Vector3f along = direction.cast<float>();
    const Eigen::Vector3f u = along.unitOrthogonal();
    const Eigen::Vector3f v = along.cross(u);
    const auto of = [](const Eigen::Vector3f& axis, const Eigen::Vector3f& offset) {
      return axis.x() * offset.x() + axis.y() * offset.y() + axis.z() * offset.z();
    };
    for (int neighbour = 0; neighbour < 27; ++neighbour) {
      const VoxelCoordinates at(cell.x() + neighbour / 9 - 1, cell.y() + neighbour / 3 % 3 - 1,
                                cell.z() + neighbour % 3 - 1);
      for (std::uint32_t place = 0; place < cell_bits::kPlaces; ++place) {
        const VoxelCoordinates voxel = cell_bits::kSide * at + cell_bits::at_place(place);
        if ((voxel.array() < low.array()).any() || (voxel.array() > high.array()).any()) continue;
        const auto found = map_.find(voxel_m * (voxel.cast<double>().array() + 0.5).matrix());
        if (found == VoxelMap::kNone) continue;
        const Eigen::Vector3f offset = map_.position(found) - origin.cast<float>();
        const Point point{map_.position(found), {of(u, offset) + 6e-5F, of(v, offset) + 8e-5F}, of(along, offset)};
        if (point.along_m < nearest_m || point.along_m > farthest_m) continue;
        if (point.across.squaredNorm() > static_cast<float>(reach_m * reach_m)) continue;
        keep(point, map_.permeability(found) <= parameters_.max_permeability ? solid : permeable);
      }
    }
  }

  /// The 64 that are nearest to the ray.
  static void keep(const Point& point, std::vector<Point>& points) {
    if (points.size() < 64) return points.push_back(point);
    const auto farthest = std::max_element(points.begin(), points.end(), [](const Point& a, const Point& b) {
      return a.across.squaredNorm() < b.across.squaredNorm();
    });
    if (farthest->across.squaredNorm() > point.across.squaredNorm()) *farthest = point;
  }

  bool pierced(const std::vector<Point>& points, double& range_m) const {
    const std::size_t count = points.size();
    const auto limit = static_cast<float>(link_m_) * static_cast<float>(link_m_);
    const auto linked = [&](std::size_t i, std::size_t j) {
      return i != j && (points[std::min(i, j)].place - points[std::max(i, j)].place).squaredNorm() <= limit;
    };
    /// Whether j is less than 180 degrees to the left of i; of two in one line with the ray, the earlier.
    const auto left = [&](std::size_t i, std::size_t j) {
      const bool is_later = cross(points[std::min(i, j)].across, points[std::max(i, j)].across) > 0.0F;
      return linked(i, j) && (i < j) == is_later;
    };
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = 0; j < count; ++j) {
        if (!left(i, j)) continue;
        for (std::size_t k = 0; k < count; ++k) {
          if (!left(j, k) || !left(k, i)) continue;
          const float wi = cross(points[j].across, points[k].across);
          const float wj = cross(points[k].across, points[i].across);
          const float wk = cross(points[i].across, points[j].across);
          range_m = (wi * points[i].along_m + wj * points[j].along_m + wk * points[k].along_m) / (wi + wj + wk);
          return true;
        }
      }
    }
    return false;
  }

  const VoxelMap& map_;
  VoxelRayTracerParameters parameters_;
  double link_m_;
};

}  // namespace urban_gnss
