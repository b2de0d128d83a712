#pragma once

#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include "urban_gnss_localization/occlusion/point_cloud.hpp"

namespace urban_gnss {

inline pcl::PointCloud<pcl::PointXYZ>::Ptr to_pcl(const PointCloud& cloud) {
  pcl::PointCloud<pcl::PointXYZ>::Ptr result(new pcl::PointCloud<pcl::PointXYZ>);
  result->reserve(cloud.size());
  for (const Eigen::Vector3f& point : cloud) result->push_back(pcl::PointXYZ(point.x(), point.y(), point.z()));
  return result;
}

}  // namespace urban_gnss
