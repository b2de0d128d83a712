#include "urban_gnss_localization/parameters/params_file.hpp"

#include "urban_gnss_localization/parameters/edit_distance.hpp"

namespace urban_gnss {
namespace {

/// Letters by which a name that is meant is misspelt.
constexpr std::size_t kMostSlips = 2;

/// "/robot1/imm_ekf/direct_sigma" has the part "imm_ekf".
bool has_part(const std::string& path, const std::string& part) {
  return ("/" + path + "/").find("/" + part + "/") != std::string::npos;
}

/// Whether a section of a namespace holds the node's section.
bool holds_section(const YAML::Node& map, const std::string& node) {
  if (!map.IsMap()) return false;
  for (const auto& entry : map) {
    if (has_part(entry.first.as<std::string>(""), node) || holds_section(entry.second, node)) return true;
  }
  return false;
}

}  // namespace

ParamsFileFindings look_through_params(const YAML::Node& file, const std::string& node) {
  ParamsFileFindings found;
  if (!file.IsMap()) {
    found.faults.push_back("must be a map with a section for each node, such as " + node +
                           ": {antenna_offset: [0, 0]}");
    return found;
  }
  for (const auto& entry : file) {
    const std::string name = entry.first.as<std::string>("");
    if (name == node + "_node") {
      found.faults.push_back("section " + name + " is not read: the node is called " + node);
    } else if (name.find('/') == std::string::npos && (!entry.second.IsMap() || name == "expert")) {
      found.faults.push_back(name + " stands outside of a section and is not read: write " + node + ": {" + name +
                             ": ...}");
    }
  }
  if (found.faults.empty() && !holds_section(file, node)) {
    std::string sections;
    for (const auto& entry : file) {
      const std::string name = entry.first.as<std::string>("");
      if (edit_distance(name, node) <= kMostSlips) {
        found.faults.push_back("section " + name + " is not read; did you mean " + node + "?");
      }
    }
    if (!found.faults.empty()) return found;
    for (const auto& entry : file) sections += (sections.empty() ? "" : ", ") + entry.first.as<std::string>("?");
    found.hint = "has no section " + node + ", but " + sections + ": this node takes nothing from it";
  }
  return found;
}

}  // namespace urban_gnss
