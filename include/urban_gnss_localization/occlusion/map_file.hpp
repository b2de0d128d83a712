#pragma once

#include <string>

#include "urban_gnss_localization/occlusion/point_cloud.hpp"

namespace urban_gnss {

/// Why no map may be written there: the path is not absolute, does not end in .pcd, has control characters, its folder
/// is not there, or the file is and `overwrite` is not set, or is no ordinary file. Empty where one may.
std::string map_file_fault(const std::string& path, bool overwrite);

/// Writes the map as write_pcd() does, whole or not at all. Throws std::runtime_error with map_file_fault(), or where
/// it cannot be written.
void save_map_file(const std::string& path, const PointCloud& map, bool overwrite);

}  // namespace urban_gnss
