#pragma once

#include <string>

namespace urban_gnss {

/// Runs one of the package's Python plot scripts on a folder, with the system's Python where there is one (ROS's and
/// matplotlib's modules belong to it). Throws std::runtime_error where the script is not found or fails.
void run_plotter(const std::string& script, const std::string& directory);

}  // namespace urban_gnss
