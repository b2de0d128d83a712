#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "urban_gnss_localization/occlusion/point_cloud.hpp"

namespace urban_gnss {

/// A point on a flat piece of the map.
struct SurfacePoint {
  Eigen::Vector3d place{Eigen::Vector3d::Zero()};   ///< m
  Eigen::Vector3d normal{Eigen::Vector3d::Zero()};  ///< unit, of either sign
};

struct PclIcpResult {
  Eigen::Isometry3d pose{Eigen::Isometry3d::Identity()};  ///< of the scan's frame in the map
  int iterations{0};
};

/// pcl::IterativeClosestPointWithNormals: point-to-plane by linear least squares, all six degrees of freedom, every
/// pair closer than `max_distance_m` with the same weight. Nothing where it finds no pairs or does not converge.
std::optional<PclIcpResult> pcl_icp(const std::vector<SurfacePoint>& map, const PointCloud& scan,
                                    const Eigen::Isometry3d& guess, double max_distance_m, int max_iterations);

}  // namespace urban_gnss
