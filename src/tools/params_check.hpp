#pragma once

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "other_nodes.hpp"
#include "urban_gnss_localization/localizers/registry.hpp"
#include "urban_gnss_localization/parameters/assignment.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"
#include "urban_gnss_localization/parameters/params_file.hpp"
#include "urban_gnss_localization/ros/registered_localizer_node.hpp"
#include "urban_gnss_localization/ros/state_keeper.hpp"

/// A file of `params:=` as the nodes would read it, without a node.
namespace urban_gnss {

/// What became of such a file.
struct ParamsCheck {
  std::vector<std::string> sections;  ///< that are read, by their places in the file
  std::vector<std::string> faults;    ///< each with file and line, as far as they are known
  std::string hint;                   ///< where nothing of the file is read
};

/// "imm_ekf" of "robot1/imm_ekf".
inline std::string last_part(const std::string& path) { return path.substr(path.rfind('/') + 1); }

/// The sections of a node: in the file itself, under a name with slashes, or, as maps, in a namespace. What looks like
/// a namespace may be another program's section, with names of its own: that of a node is taken for one only if no
/// other program would have it, a localizer's.
inline std::vector<std::pair<std::string, YAML::Node>> find_sections(const YAML::Node& map, const std::string& node,
                                                                     bool is_own_name, const std::string& path = "") {
  std::vector<std::pair<std::string, YAML::Node>> found;
  if (!map.IsMap()) return found;
  for (const auto& entry : map) {
    const std::string name = entry.first.as<std::string>("");
    if (last_part(name) == node && (path.empty() || entry.second.IsMap())) {
      found.emplace_back(path + name, entry.second);
    } else if (is_own_name && name != "expert") {
      const auto below = find_sections(entry.second, node, is_own_name, path + name + "/");
      found.insert(found.end(), below.begin(), below.end());
    }
  }
  return found;
}

/// Reads each section of a node into what `make` gives: its struct with the defaults.
template <class Make>
void check_sections(const std::string& file, const YAML::Node& content, const std::string& node, bool is_own_name,
                    const Make& make, ParamsCheck& check) {
  for (const auto& [path, section] : find_sections(content, node, is_own_name)) {
    check.sections.push_back(path);
    auto parameters = make();
    ParameterReader reader(section, file, path + ".", Layout::kTiered);
    for (const char* other : {"diagnostic_period", "params_file", kStateFile}) reader.ignore(other);
    const std::vector<std::string> faults = reader.read(parameters).finish();
    check.faults.insert(check.faults.end(), faults.begin(), faults.end());
  }
}

/// Throws std::runtime_error where the file cannot be read or is no map.
inline ParamsCheck check_params(const std::string& file, const LocalizerRegistry& localizers) {
  ParamsCheck check;
  const YAML::Node content = load_map(file);
  for (const LocalizerEntry& entry : localizers.entries()) {
    check_sections(
        file, content, entry.name, true, [&entry = entry] { return LocalizerNodeSettings(entry); }, check);
  }
  // A name outside of a section is meant for a localizer: the first that the file has, or the default.
  std::vector<std::string> nodes = {check.sections.empty() ? kDefaultLocalizer : last_part(check.sections.front()),
                                    "gps_bias", "occlusion"};
  for_each_other_node([&](const std::string& name, const std::string&, const auto& parameters) {
    check_sections(
        file, content, name, false, [&defaults = parameters] { return defaults; }, check);
  });
  for (const std::string& path : check.sections) nodes.push_back(last_part(path));
  const ParamsFile found = read_params_file(file, nodes);
  check.faults.insert(check.faults.begin(), found.faults.begin(), found.faults.end());
  if (check.sections.empty()) check.hint = found.hint;
  return check;
}

}  // namespace urban_gnss
