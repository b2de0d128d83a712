#pragma once

#include <string>

namespace urban_gnss {

/// Where the package's sources are.
std::string package_directory();

}  // namespace urban_gnss
