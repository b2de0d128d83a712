#pragma once

#include <memory>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/occlusion/point_cloud.hpp"
#include "urban_gnss_localization/occlusion/ray_tracer.hpp"

namespace urban_gnss {

/// Parameters of Algorithm 2. The search radius is bounded and linear in the range r:
/// min(search_radius + search_radius_slope r, search_radius_max). The paper starts at a range of 0, and has no other
/// number.
struct KdTreeRayTracerParameters {
  double min_range{0.0};
  double max_range{500.0};
  double range_step{0.5};
  double search_radius{0.3};
  double search_radius_slope{0.02};
  double search_radius_max{2.0};
  int min_neighbours{1};
  double epsilon{0.0};

  void visit(ParameterVisitor& v) {
    v("min_range", min_range, non_negative(), "m",
      "distance from the antenna below which an obstacle is the robot itself; as printed r starts at 0");
    v("max_range", max_range, positive(), "m", "distance up to which a ray is followed, r_max");
    v("range_step", range_step, positive(), "m", "step along a ray, r_inc");
    v("search_radius", search_radius, positive(), "m", "search radius at the antenna, r_search at r = 0");
    v("search_radius_slope", search_radius_slope, non_negative(), "",
      "growth of the search radius with range; 0: constant radius");
    v("search_radius_max", search_radius_max, positive(), "m", "greatest search radius");
    v("min_neighbours", min_neighbours, at_least(1), "",
      "number of points within the search radius that obstruct a ray");
    v("epsilon", epsilon, non_negative(), "",
      "tolerance of the search, which may be wrong by a factor of 1 + epsilon (Arya et al. 1998)");
  }
  void check(std::vector<std::string>& faults) const;
};

/// Algorithm 2 of Maier & Kleiner 2010 as printed, on PCL's kd-tree: the reference for VoxelRayTracer. Two things are
/// added: a step beyond the map's bounding box is not searched, and range_m is the range of the obstructed query point.
class KdTreeRayTracer : public RayTracer {
 public:
  /// Non-finite points of `cloud` are left out; an empty cloud obstructs nothing. Throws ParameterError.
  KdTreeRayTracer(const PointCloud& cloud, const KdTreeRayTracerParameters& parameters);
  ~KdTreeRayTracer() override;

  RayOutcome trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const override;

 private:
  struct Tree;  // keeps PCL's headers out of this one
  std::unique_ptr<Tree> tree_;
  KdTreeRayTracerParameters parameters_;
};

}  // namespace urban_gnss
