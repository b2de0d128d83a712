#pragma once

#include <ros/node_handle.h>
#include <yaml-cpp/yaml.h>

#include <functional>

#include "urban_gnss_localization/parameters/parameter_reader.hpp"

namespace urban_gnss {

/// The node's private parameters as one YAML map, so that nodes and offline tools read the same structs in the same
/// way.
YAML::Node private_parameters(const ros::NodeHandle& private_node);

/// For a node that must read one struct to know which others to read. finish_reading() must come last.
ParameterReader private_parameter_reader(const ros::NodeHandle& private_node);
/// Throws ParameterError with every fault, those of the file `~params_file` too; warns where that has no section for
/// the node.
void finish_reading(const ros::NodeHandle& private_node, const ParameterReader& reader);

/// Reads structs out of the node's private parameters. Throws ParameterError with every fault of all of them.
template <class... P>
void read_private_parameters(const ros::NodeHandle& private_node, P&... parameters) {
  ParameterReader reader = private_parameter_reader(private_node);
  (reader.read(parameters), ...);
  finish_reading(private_node, reader);
}

/// The same of one struct, by value.
template <class P>
P read_private(const ros::NodeHandle& private_node) {
  P parameters;
  read_private_parameters(private_node, parameters);
  return parameters;
}

/// Reads structs out of another node's parameters. Names that the structs do not have are left out. Bad values are not
/// reported: the other node refuses them.
template <class... P>
void read_known_parameters(const ros::NodeHandle& other_node, P&... parameters) {
  ParameterReader reader(private_parameters(other_node), "", "", Layout::kTiered);
  (reader.read(parameters), ...);
}

/// The main function of a node: initialises ROS, makes the node, spins. A node whose parameters are bad, or that fails
/// otherwise while it is made, says why on the console and exits with 1.
int run_node(int argc, char** argv, const std::string& name,
             const std::function<std::shared_ptr<void>(ros::NodeHandle&, ros::NodeHandle&)>& make);

}  // namespace urban_gnss
