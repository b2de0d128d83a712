// Point clouds: the check of the header, and PCL behind it.

#include "memory_file.hpp"
#include "urban_gnss_localization/occlusion/point_cloud.hpp"

namespace urban_gnss::fuzz {

void read_pcd(const std::string& bytes) {
  read_as_file(bytes, [&](const std::string& path) {
    const PointCloud cloud = urban_gnss::read_pcd(path);
    require(cloud.size() <= 100 * bytes.size(), "more points than the file can hold");
    for (const Eigen::Vector3f& point : voxel_filtered(cloud, 0.5)) require(point.allFinite(), "a point that is none");
  });
}

}  // namespace urban_gnss::fuzz
