#include "urban_gnss_localization/parameters/params_file.hpp"

#include <algorithm>

#include "urban_gnss_localization/parameters/assignment.hpp"
#include "urban_gnss_localization/common/edit_distance.hpp"

namespace urban_gnss {
namespace {

/// Letters by which a name that is meant is misspelt.
constexpr std::size_t kMostSlips = 2;

/// The section of a node's parameters that few need.
constexpr const char* kExpert = "expert";

/// "/robot1/imm_ekf/direct_sigma" has the part "imm_ekf".
bool has_part(const std::string& path, const std::string& part) {
  return ("/" + path + "/").find("/" + part + "/") != std::string::npos;
}

/// What is wrong with an entry at the top of the file; empty where nothing is.
std::string fault_of(const std::string& name, const YAML::Node& value, const YAML::Node& file,
                     const std::vector<std::string>& nodes) {
  // rosparam ends with "cannot marshal None".
  if (value.IsNull()) return name + " is empty: write " + name + ": {}, or take it out";
  for (const std::string& node : nodes) {
    if (name == node + "_node") return "section " + name + " is not read: the node is called " + node;
    if (name == node) return value.IsMap() ? "" : name + " must be a map of names to values";
  }
  if (name.find('/') == std::string::npos && (!value.IsMap() || name == kExpert)) {
    return name + " stands outside of a section and is not read: write " + nodes.front() + ": {" + name + ": ...}";
  }
  for (const std::string& node : nodes) {
    if (edit_distance(name, node) <= kMostSlips && !holds_section(file, node)) {
      return "section " + name + " is not read; did you mean " + node + "?";
    }
  }
  return "";
}

}  // namespace

bool holds_section(const YAML::Node& map, const std::string& node) {
  if (!map.IsMap()) return false;
  for (const auto& entry : map) {
    const std::string name = entry.first.as<std::string>("");
    if (name == kExpert) continue;  // its groups are called as some nodes are
    if (has_part(name, node) || holds_section(entry.second, node)) return true;
  }
  return false;
}

ParamsFile look_through_params(const YAML::Node& file, const std::vector<std::string>& nodes) {
  ParamsFile found{file, {}, {}};
  if (!file.IsMap()) {
    found.faults.push_back("must be a map with a section for each node, such as " + nodes.front() +
                           ": {antenna_offset: [0, 0]}");
    return found;
  }
  std::string sections;
  for (const auto& entry : file) {
    const std::string name = entry.first.as<std::string>("?");
    const std::string fault = fault_of(name, entry.second, file, nodes);
    if (!fault.empty()) found.faults.push_back(fault);
    sections += (sections.empty() ? "" : ", ") + name;
  }
  const bool has_section =
      std::any_of(nodes.begin(), nodes.end(), [&](const auto& node) { return holds_section(file, node); });
  if (found.faults.empty() && !has_section) {
    found.hint = "has no section " + nodes.front() + (sections.empty() ? "" : ", but " + sections) +
                 ": nothing is taken from it";
  }
  return found;
}

ParamsFile read_params_file(const std::string& file, const std::vector<std::string>& nodes) {
  ParamsFile found = look_through_params(load_map(file), nodes);
  for (std::string& fault : found.faults) fault.insert(0, file + ": ");
  if (!found.hint.empty()) found.hint.insert(0, file + ": ");
  return found;
}

}  // namespace urban_gnss
