// The node of complementary_ekf, whose mode can be changed by dynamic_reconfigure while it runs.

#include <dynamic_reconfigure/server.h>
#include <urban_gnss_localization/ComplementaryEkfConfig.h>

#include "urban_gnss_localization/localizers/kim/complementary_ekf.hpp"
#include "urban_gnss_localization/localizers/registry.hpp"
#include "urban_gnss_localization/ros/node_parameters.hpp"
#include "urban_gnss_localization/ros/registered_localizer_node.hpp"

using namespace urban_gnss;

namespace {

class ComplementaryEkfNode {
 public:
  ComplementaryEkfNode(ros::NodeHandle& node, ros::NodeHandle& private_node)
      : node_(node, private_node, standard_localizers().find("complementary_ekf")) {
    private_node.setParam("mode", filter().mode());  // the server starts from what is there
    server_ = std::make_unique<Server>(private_node);
    server_->setCallback(
        [this](Config& config, std::uint32_t) { node_.shell().run("dynamic_reconfigure", [&] { set_mode(config); }); });
    gate_timer_ = node_.shell().every(node, 60.0, "the gate's timer", [this] { watch_gate(); });
  }

 private:
  using Config = urban_gnss_localization::ComplementaryEkfConfig;
  using Server = dynamic_reconfigure::Server<Config>;

  ComplementaryEkf& filter() { return dynamic_cast<ComplementaryEkf&>(node_.pipeline().localizer()); }

  void set_mode(Config& config) {
    for (const auto& [name, mode] : enum_names(ComplementaryMode())) {
      if (config.mode != name) continue;
      if (config.mode != filter().mode()) ROS_INFO_STREAM("mode: " << config.mode);
      filter().set_mode(mode);
      return;
    }
    node_.shell().refuse("mode", "there is no '" + config.mode.substr(0, 50) + "'; it stays " + filter().mode());
    config.mode = filter().mode();
  }

  void watch_gate() {
    if (!node_.pipeline().report().is_gate_inert) return;
    ROS_WARN_STREAM("gate inert: a bias below " << filter().smallest_detectable_jump_m() << " m is not found at once");
  }

  RegisteredLocalizerNode node_;
  std::unique_ptr<Server> server_;
  ros::WallTimer gate_timer_;
};

}  // namespace

int main(int argc, char** argv) {
  return run_node(argc, argv, "complementary_ekf", [](ros::NodeHandle& node, ros::NodeHandle& private_node) {
    return std::make_shared<ComplementaryEkfNode>(node, private_node);
  });
}
