#include "pcl_pcd.hpp"

#include <pcl/io/pcd_io.h>

#include "pcl_cloud.hpp"

extern "C" bool urban_gnss_read_pcd(const std::string& path, urban_gnss::PointCloud& cloud) {
  pcl::PointCloud<pcl::PointXYZ> points;
  if (pcl::io::loadPCDFile(path, points) < 0) return false;
  cloud.reserve(points.size());
  for (const pcl::PointXYZ& point : points) cloud.emplace_back(point.x, point.y, point.z);
  return true;
}

extern "C" bool urban_gnss_write_pcd(const std::string& path, const urban_gnss::PointCloud& cloud) {
  try {
    return pcl::io::savePCDFileBinary(path, *urban_gnss::to_pcl(cloud)) == 0;
  } catch (const pcl::IOException&) {
    return false;
  }
}

namespace {
// The names are those that are looked for.
[[maybe_unused]] urban_gnss::pcl_pcd::Read* const kReads = &urban_gnss_read_pcd;
[[maybe_unused]] urban_gnss::pcl_pcd::Write* const kWrites = &urban_gnss_write_pcd;
}  // namespace
