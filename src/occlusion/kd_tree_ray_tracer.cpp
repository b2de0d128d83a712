#include "urban_gnss_localization/occlusion/kd_tree_ray_tracer.hpp"

#include <pcl/kdtree/kdtree_flann.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include <algorithm>

#include "pcd/pcl_cloud.hpp"

namespace urban_gnss {

void KdTreeRayTracerParameters::check(std::vector<std::string>& faults) const {
  if (min_range >= max_range) faults.push_back("min_range: must be less than max_range");
  if (search_radius > search_radius_max) faults.push_back("search_radius: must not exceed search_radius_max");
}

struct KdTreeRayTracer::Tree {
  pcl::KdTreeFLANN<pcl::PointXYZ> search;
  Eigen::AlignedBox3d bounds;
};

KdTreeRayTracer::KdTreeRayTracer(const PointCloud& cloud, const KdTreeRayTracerParameters& parameters)
    : tree_(std::make_unique<Tree>()), parameters_(parameters) {
  require_usable("kd-tree ray tracer", parameters);
  const PointCloud finite = finite_points(cloud);
  for (const Eigen::Vector3f& point : finite) tree_->bounds.extend(point.cast<double>());
  if (finite.empty()) return;
  tree_->search.setEpsilon(static_cast<float>(parameters.epsilon));
  tree_->search.setInputCloud(to_pcl(finite));
}

KdTreeRayTracer::~KdTreeRayTracer() = default;

RayOutcome KdTreeRayTracer::trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  RayOutcome outcome;
  if (tree_->bounds.isEmpty() || !origin.allFinite() || !direction.allFinite()) return outcome;
  const auto& p = parameters_;
  const auto min_neighbours = static_cast<unsigned>(p.min_neighbours);
  std::vector<int> neighbours;
  std::vector<float> squared_distances;
  for (double r = p.min_range; r < p.max_range; r += p.range_step) {
    const Eigen::Vector3d q = origin + r * direction;
    const double radius_m = std::min(p.search_radius + p.search_radius_slope * r, p.search_radius_max);
    if (tree_->bounds.squaredExteriorDistance(q) > radius_m * radius_m) continue;
    const pcl::PointXYZ query(static_cast<float>(q.x()), static_cast<float>(q.y()), static_cast<float>(q.z()));
    const int found = tree_->search.radiusSearch(query, radius_m, neighbours, squared_distances, min_neighbours);
    if (found >= p.min_neighbours) {
      outcome.blocked = true;
      outcome.range_m = r;
      return outcome;
    }
  }
  return outcome;
}

}  // namespace urban_gnss
