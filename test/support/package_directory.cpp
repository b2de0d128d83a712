#include "package_directory.hpp"

namespace urban_gnss {

std::string package_directory() { return PACKAGE_DIRECTORY; }

}  // namespace urban_gnss
