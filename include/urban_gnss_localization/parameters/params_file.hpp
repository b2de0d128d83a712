#pragma once

#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

namespace urban_gnss {

/// What in a file of parameters, with a section for each node, cannot be what its writer meant.
struct ParamsFileFindings {
  std::vector<std::string> faults;  ///< what nobody would read
  std::string hint;                 ///< where it has no section for the node; empty where it has
};

/// Looks through the file of `params:=` as the node called `node` sees it. rosparam loads such a file whatever it
/// holds: names outside of a section, and a section called as the node's program is (`imm_ekf_node`), would be ignored
/// silently.
ParamsFileFindings look_through_params(const YAML::Node& file, const std::string& node);

}  // namespace urban_gnss
