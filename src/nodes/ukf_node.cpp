// The unscented Kalman filter of Maier and Kleiner as a node. Parameters: LocalizerNodeParameters, UkfParameters and
// MotionParameters; config/ukf.yaml documents the latter two.

#include "urban_gnss_localization/localizers/maier/ukf.hpp"
#include "urban_gnss_localization/ros/localizer_node.hpp"
#include "urban_gnss_localization/ros/node_parameters.hpp"

using namespace urban_gnss;

int main(int argc, char** argv) {
  return run_node(argc, argv, "ukf", [](ros::NodeHandle& node, ros::NodeHandle& private_node) {
    LocalizerNodeParameters shell;
    UkfParameters filter;
    MotionParameters motion;
    read_private_parameters(private_node, shell, filter, motion);
    return std::make_shared<LocalizerNode>(node, private_node, shell, std::make_unique<Ukf>(filter, motion), nullptr);
  });
}
