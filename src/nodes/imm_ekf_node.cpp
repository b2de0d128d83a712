// Interacting multiple models of the fixes' bias as a node. Parameters: LocalizerNodeParameters, ImmEkfParameters and
// MotionParameters; config/imm_ekf.yaml documents the latter two.

#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"
#include "urban_gnss_localization/ros/localizer_node.hpp"
#include "urban_gnss_localization/ros/node_parameters.hpp"

using namespace urban_gnss;

int main(int argc, char** argv) {
  return run_node(argc, argv, "imm_ekf", [](ros::NodeHandle& node, ros::NodeHandle& private_node) {
    LocalizerNodeParameters shell;
    ImmEkfParameters filter;
    MotionParameters motion;
    read_private_parameters(private_node, shell, filter, motion);
    return std::make_shared<LocalizerNode>(node, private_node, shell, std::make_unique<ImmEkf>(filter, motion),
                                           nullptr);
  });
}
