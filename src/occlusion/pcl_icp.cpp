#include "pcl_icp.hpp"

#include <pcl/registration/icp.h>

namespace urban_gnss {
namespace {

using Cloud = pcl::PointCloud<pcl::PointNormal>;

/// Square of a step (m) that ends the iteration.
constexpr double kConverged_m2 = 1e-6;

struct Icp : pcl::IterativeClosestPointWithNormals<pcl::PointNormal, pcl::PointNormal> {
  int iterations() const { return nr_iterations_; }
};

}  // namespace

std::optional<PclIcpResult> pcl_icp(const std::vector<SurfacePoint>& map, const PointCloud& scan,
                                    const Eigen::Isometry3d& guess, double max_distance_m, int max_iterations) {
  if (map.empty() || scan.empty()) return std::nullopt;
  // About the guess's place, since PCL computes in floats.
  const Eigen::Vector3d origin = guess.translation();
  Cloud::Ptr target(new Cloud);
  for (const SurfacePoint& each : map) {
    pcl::PointNormal point;
    point.getVector3fMap() = (each.place - origin).cast<float>();
    point.getNormalVector3fMap() = each.normal.cast<float>();
    target->push_back(point);
  }
  Cloud::Ptr source(new Cloud);
  for (const Eigen::Vector3f& each : scan) {
    pcl::PointNormal point;
    point.getVector3fMap() = guess.linear().cast<float>() * each;
    source->push_back(point);
  }
  Icp icp;
  icp.setInputTarget(target);
  icp.setInputSource(source);
  icp.setMaxCorrespondenceDistance(max_distance_m);
  icp.setMaximumIterations(max_iterations);
  icp.setTransformationEpsilon(kConverged_m2);
  Cloud aligned;
  icp.align(aligned);
  const Eigen::Matrix4d change = icp.getFinalTransformation().cast<double>();
  if (!icp.hasConverged() || !change.allFinite()) return std::nullopt;
  PclIcpResult result;
  result.iterations = icp.iterations();
  // A rotation of floats is not quite one.
  const Eigen::Matrix3d turned =
      Eigen::Quaterniond(Eigen::Matrix3d(change.topLeftCorner<3, 3>())).normalized() * guess.linear();
  result.pose.linear() = turned;
  result.pose.translation() = origin + change.topRightCorner<3, 1>();
  return result;
}

}  // namespace urban_gnss
