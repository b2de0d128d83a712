#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace urban_gnss {

/// The names, without .yaml, of the YAML files in a folder, in order: what could be chosen. None where there is no such
/// folder.
std::vector<std::string> yaml_files(const std::filesystem::path& folder);

}  // namespace urban_gnss
