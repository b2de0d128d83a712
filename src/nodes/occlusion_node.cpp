// Weighs fixes by what stands between the antenna and the satellites; a node around OcclusionNode.

#include "urban_gnss_localization/ros/occlusion_node.hpp"

#include "urban_gnss_localization/ros/node_parameters.hpp"

int main(int argc, char** argv) {
  return urban_gnss::run_node(argc, argv, "occlusion", [](ros::NodeHandle& node, ros::NodeHandle& private_node) {
    return std::make_shared<urban_gnss::OcclusionNode>(node, private_node);
  });
}
