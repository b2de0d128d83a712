#pragma once

#include <cstdint>
#include <string>

namespace urban_gnss {

/// Reads the header of a .pcd file (pcl.readthedocs.io, "The PCD file format") and compares its sizes with the file's.
/// Throws std::runtime_error that names file and entry where it is no such file, lacks x, y or z in single precision,
/// or holds less than it says. PCL believes the header, and crashes. Returns the number of points.
std::uint64_t check_pcd(const std::string& path);

}  // namespace urban_gnss
