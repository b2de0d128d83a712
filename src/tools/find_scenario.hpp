#pragma once

#include <ros/package.h>
#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "urban_gnss_localization/parameters/assignment.hpp"
#include "urban_gnss_localization/parameters/yaml_files.hpp"

namespace urban_gnss {

/// Where the package's files are. Throws std::runtime_error where ROS does not know it.
inline std::filesystem::path package_path() {
  const std::string package = ros::package::getPath("urban_gnss_localization");
  if (package.empty()) throw std::runtime_error("package urban_gnss_localization: not found, source its setup.bash");
  return package;
}

/// The file of a scenario that is given by path or by the name that it has in this package. Throws std::runtime_error
/// that lists the names where it is neither.
inline std::filesystem::path find_scenario(const std::string& name) {
  namespace fs = std::filesystem;
  if (fs::is_regular_file(name)) return name;
  const fs::path package = package_path();
  for (const fs::path& candidate :
       {package / "scenarios" / (name + ".yaml"), package / "config" / name / "simulator.yaml"}) {
    if (fs::is_regular_file(candidate)) return candidate;
  }
  std::string known;
  for (const std::string& other : yaml_files(package / "scenarios")) known += ", " + other;
  throw std::runtime_error(name + ": neither a file nor one of the scenarios paper_field" + known);
}

/// The files that a scenario's file names, relative to its folder.
inline void find_files(const YAML::Node& node, const std::filesystem::path& folder,
                       std::vector<std::filesystem::path>& files) {
  if (node.IsScalar() && !node.Scalar().empty()) {
    std::error_code error;
    const std::filesystem::path file = folder / node.Scalar();
    if (std::filesystem::is_regular_file(file, error)) files.push_back(file);
  } else if (node.IsSequence() || node.IsMap()) {
    for (const auto& each : node) find_files(node.IsMap() ? each.second : each, folder, files);
  }
}

/// The scenario's file, and those that it names. Throws what find_scenario and load_map throw.
inline std::vector<std::filesystem::path> files_of_scenario(const std::string& name) {
  std::vector<std::filesystem::path> files{find_scenario(name)};
  find_files(load_map(files.front().string()), files.front().parent_path(), files);
  return files;
}

}  // namespace urban_gnss
