#pragma once

#include <string>

#include "urban_gnss_localization/occlusion/point_cloud.hpp"

/// PCL's reader and writer of .pcd files. They bring VTK with them, which takes as long to load as a short bag to
/// replay: so they lie in a library of their own, which is loaded when the first file is read or written.
namespace urban_gnss::pcl_pcd {

/// False where PCL refuses the file.
using Read = bool(const std::string& path, PointCloud& cloud);
/// False where it cannot be written. Requires points.
using Write = bool(const std::string& path, const PointCloud& cloud);

inline constexpr char kLibrary[] = "liburban_gnss_localization_pcd.so";
inline constexpr char kRead[] = "urban_gnss_read_pcd";
inline constexpr char kWrite[] = "urban_gnss_write_pcd";

}  // namespace urban_gnss::pcl_pcd
