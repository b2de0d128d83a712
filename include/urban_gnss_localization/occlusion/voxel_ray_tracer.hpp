#pragma once

#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/occlusion/ray_tracer.hpp"
#include "urban_gnss_localization/occlusion/voxel_map.hpp"

namespace urban_gnss {

struct VoxelRayTracerParameters {
  double min_range{1.0};
  double max_range{500.0};
  double link_length{3.2};
  double max_permeability{0.5};

  void visit(ParameterVisitor& v) {
    v("min_range", min_range, non_negative(), "m",
      "distance from the antenna below which an obstacle is the robot itself");
    v("max_range", max_range, positive(), "m", "distance up to which a ray is followed");
    v("link_length", link_length, between(1.0, VoxelMap::kCellVoxels), "voxels",
      "distance beyond which two points do not belong to one surface");
    v("max_permeability", max_permeability, between(0.0, 1.0), "",
      "share of the lidar's rays let through above which a voxel is vegetation");
  }
  void check(std::vector<std::string>& faults) const;
};

/// The parameters with which a prior cloud of this spacing (sample_spacing_m) is traced: one voxel to a sample.
/// `spacing_m` > 0.
VoxelMapParameters voxel_map_parameters_for(double spacing_m);

/// The default tracer. A ray is blocked where it pierces a triangle of three of the map's points that are mutually
/// within the link length L (a triangle of the points' Vietoris-Rips complex) and within L/sqrt(3) of the ray. So a
/// sampled surface has no hole unless its samples leave a circle of that radius empty, seen from any angle, and it ends
/// where its outermost points are, where a walk over filled voxels, or a search within a radius, adds a rim as wide as
/// these. Single points and poles one point wide do not block.
///
/// The ray walks the map's cells by their faces; only where a cell or one of its neighbours holds a point are the
/// points about that stretch of the ray, and L/sqrt(3) before and after it, gathered. Allocation-free.
class VoxelRayTracer : public RayTracer {
 public:
  /// Refers to `map`, which must outlive it. Throws ParameterError.
  VoxelRayTracer(const VoxelMap& map, const VoxelRayTracerParameters& parameters);

  RayOutcome trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const override;

 private:
  const VoxelMap* map_;
  VoxelRayTracerParameters parameters_;
  double link_m_;
};

}  // namespace urban_gnss
