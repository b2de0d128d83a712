#pragma once

#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

namespace urban_gnss {

/// A file of parameters, with a section for each node, and what in it cannot be what its writer meant.
struct ParamsFile {
  YAML::Node sections;              ///< the file as it is
  std::vector<std::string> faults;  ///< what nobody would read
  std::string hint;                 ///< where it has no section for any of the nodes; empty where it has
};

/// Whether the file, a namespace in it or a name with slashes holds a section for the node.
bool holds_section(const YAML::Node& file, const std::string& node);

/// Looks through the file of `params:=` or `--params` as the nodes called `nodes` see it; a name outside of a section
/// is taken as meant for the first of them. rosparam loads such a file whatever it holds: names outside of a section,
/// and a section called as the node's program is (`imm_ekf_node`), would be ignored silently.
ParamsFile look_through_params(const YAML::Node& file, const std::vector<std::string>& nodes);

/// The same of a file's content; faults and hint begin with its name. Throws std::runtime_error that names the file
/// where it cannot be read or is no map.
ParamsFile read_params_file(const std::string& file, const std::vector<std::string>& nodes);

}  // namespace urban_gnss
