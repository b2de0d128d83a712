#include "urban_gnss_localization/occlusion/voxel_ray_tracer.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "float4.hpp"
#include "ray_neighbourhood.hpp"
#include "urban_gnss_localization/common/vector_math.hpp"

namespace urban_gnss {
namespace {

constexpr double kMargin_m = 0.01;

/// In link lengths: how far from the ray the corners of a pierced triangle are looked for. This is the radius of the
/// circle about the largest equilateral triangle, the largest hole that three linked points can close.
const double kReach = 1.0 / std::sqrt(3.0);

/// The greatest single number that is not above this one.
float at_most(double value) {
  const auto single = static_cast<float>(value);
  return static_cast<double>(single) <= value ? single : std::nextafter(single, -1.0F);
}

/// How a ray sees points: their distances across it, x and y, and along it (m).
class RayFrame {
 public:
  struct Places {
    Float4 across_x;
    Float4 across_y;
    Float4 along_m;
  };

  RayFrame(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) : origin_(origin.cast<float>()) {
    along_ = direction.cast<float>();
    right_ = along_.unitOrthogonal();
    up_ = along_.cross(right_);
  }

  /// Shifted so that the ray is kept off the lines between points of a regular grid.
  Places places(Float4 x, Float4 y, Float4 z) const {
    x -= origin_.x();
    y -= origin_.y();
    z -= origin_.z();
    return {of(right_, x, y, z) + 6e-5F, of(up_, x, y, z) + 8e-5F, of(along_, x, y, z)};
  }

 private:
  static Float4 of(const Eigen::Vector3f& axis, Float4 x, Float4 y, Float4 z) {
    return axis.x() * x + axis.y() * y + axis.z() * z;
  }

  Eigen::Vector3f origin_;
  Eigen::Vector3f right_;
  Eigen::Vector3f up_;
  Eigen::Vector3f along_;
};

/// Which points count about a stretch of a ray, and which of them are solid.
struct Limits {
  float squared_reach;  ///< m^2, across the ray
  float nearest_m;      ///< along it
  float farthest_m;
  float max_permeability;
};

/// Voxels about a stretch of a ray, and how the ray sees them: four at a time, and in memory of which only the first
/// part is touched.
class Candidates {
 public:
  /// Puts the voxels that are asked for in these cells, if they are within the limits, into `solid` and `permeable`.
  URBAN_GNSS_INLINE void sort(const VoxelMap& map, const VoxelMap::NearbyVoxels& nearby, std::size_t cells,
                              const RayFrame frame, const Limits limits, RayNeighbourhood& solid,
                              RayNeighbourhood& permeable) {
    const std::size_t count = gather(map, nearby, cells);
    std::size_t solids = 0;
    std::size_t permeables = 0;
    for (std::size_t first = 0; first < count; first += 4) {
      Float4 x = load4(surfaces_[first].data());
      Float4 y = load4(surfaces_[first + 1].data());
      Float4 z = load4(surfaces_[first + 2].data());
      Float4 permeability = load4(surfaces_[first + 3].data());
      transpose4(x, y, z, permeability);
      const auto [across_x, across_y, along_m] = frame.places(x, y, z);
      store4(&across_x_[first], across_x);
      store4(&across_y_[first], across_y);
      store4(&along_m_[first], along_m);
      const Mask4 is_in_reach = (across_x * across_x + across_y * across_y <= limits.squared_reach) &
                                (along_m >= limits.nearest_m) & (along_m <= limits.farthest_m);
      const Mask4 is_solid = permeability <= limits.max_permeability;
      const std::uint32_t solid_bits = bits_of(is_in_reach & is_solid);
      const std::uint32_t permeable_bits = bits_of(is_in_reach & ~is_solid);
      // All are written down, and the next one over those that are left out: that is quicker than to jump.
      for (std::uint32_t lane = 0; lane < 4; ++lane) {
        solid_[solids] = static_cast<std::uint16_t>(first + lane);
        solids += solid_bits >> lane & 1U;
      }
      if (permeable_bits == 0) continue;
      for (std::uint32_t lane = 0; lane < 4; ++lane) {
        permeable_[permeables] = static_cast<std::uint16_t>(first + lane);
        permeables += permeable_bits >> lane & 1U;
      }
    }
    add(solid_, solids, solid);
    add(permeable_, permeables, permeable);
  }

 private:
  static constexpr std::size_t kMost = 27 * cell_bits::kPlaces;  ///< in a cell and its neighbours
  static constexpr float kNowhere = 1e9F;                        ///< m, beyond every limit
  using Chosen = std::array<std::uint16_t, kMost + 1>;

  /// The number of voxels, and nowhere's up to the next multiple of four.
  URBAN_GNSS_INLINE std::size_t gather(const VoxelMap& map, const VoxelMap::NearbyVoxels& nearby, std::size_t cells) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < cells; ++i) {
      VoxelMap::for_each_wanted(
          nearby[i], [&](VoxelMap::Index voxel) { store4(surfaces_[count++].data(), load4(map.surface(voxel))); });
    }
    for (std::size_t i = count; i % 4 != 0; ++i) store4(surfaces_[i].data(), all4(kNowhere));
    return count;
  }

  URBAN_GNSS_INLINE void add(const Chosen& chosen, std::size_t count, RayNeighbourhood& to) const {
    to.clear();
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t i = chosen[k];
      to.add(surfaces_[i].data(), across_x_[i], across_y_[i], along_m_[i]);
    }
  }

  std::array<std::array<float, 4>, kMost> surfaces_;  ///< as VoxelMap::surface() gives them
  std::array<float, kMost> across_x_;
  std::array<float, kMost> across_y_;
  std::array<float, kMost> along_m_;
  Chosen solid_;
  Chosen permeable_;
};

/// Candidates::sort() with the widest instructions that the processor has.
URBAN_GNSS_VECTORISED void sort_nearby(Candidates& candidates, const VoxelMap& map,
                                       const VoxelMap::NearbyVoxels& nearby, std::size_t cells, const RayFrame& frame,
                                       const Limits& limits, RayNeighbourhood& solid, RayNeighbourhood& permeable) {
  candidates.sort(map, nearby, cells, frame, limits, solid, permeable);
}

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
  const float max_permeability = at_most(parameters_.max_permeability);
  const double inverse_voxel = 1.0 / map_->parameters().voxel_size;
  RayNeighbourhood solid;
  RayNeighbourhood permeable;
  VoxelMap::NearbyVoxels nearby;
  Candidates candidates;

  const auto visit = [&](VoxelMap::Index center, const VoxelCoordinates& cell, double from_m, double to_m) {
    // The voxels that the box about the stretch, widened by the reach, touches: in the cell and its neighbours.
    const Eigen::Vector3d a = origin + from_m * direction;
    const Eigen::Vector3d b = origin + to_m * direction;
    const VoxelCoordinates low = voxel_of((a.cwiseMin(b).array() - reach_m).matrix(), inverse_voxel);
    const VoxelCoordinates high = voxel_of((a.cwiseMax(b).array() + reach_m).matrix(), inverse_voxel);
    const std::size_t cells = map_->find_nearby(center, cell, low, high, nearby);
    if (cells == 0) return true;
    const Limits limits{squared_reach, static_cast<float>(std::max(from_m - reach_m, parameters_.min_range)),
                        static_cast<float>(std::min(to_m + reach_m, parameters_.max_range)), max_permeability};
    sort_nearby(candidates, *map_, nearby, cells, frame, limits, solid, permeable);
    if (solid.pierced(link_m, outcome.range_m)) {
      outcome.blocked = true;
      return false;
    }
    double unused_m = 0.0;
    if (permeable.pierced(link_m, unused_m)) outcome.vegetation_m += to_m - from_m;
    return true;
  };

  const GridRay by_cell(origin, direction, map_->cell_edge_m());
  const auto visit_brick = [&](const VoxelCoordinates& coordinates, double brick_from_m, double brick_to_m) {
    const VoxelMap::Index brick = map_->find_brick(coordinates);
    if (brick == VoxelMap::kNone) return true;
    const VoxelCoordinates first = VoxelMap::kBrickCells * coordinates;
    by_cell.walk(brick_from_m, brick_to_m, [&](const VoxelCoordinates& cell, double from_m, double to_m) {
      // On the border rounding may lead into the next brick, for less than a hair's breadth.
      if (!VoxelMap::is_in_brick(cell, first)) return true;
      const VoxelMap::Index found = map_->find_cell(brick, cell);
      return found == VoxelMap::kNone || visit(found, cell, from_m, to_m);
    });
    return !outcome.blocked;
  };
  GridRay(origin, direction, map_->brick_edge_m()).walk(inside.begin_m, inside.end_m, visit_brick);
  return outcome;
}

}  // namespace urban_gnss
