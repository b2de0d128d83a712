// The complementary filter of Kim et al. as a node. Parameters: LocalizerNodeParameters and ComplementaryEkfParameters;
// config/complementary_ekf.yaml documents the latter. Beside what every localizer publishes: gps/bias and
// gps/bias_markers. The mode can be changed by dynamic_reconfigure.

#include <dynamic_reconfigure/server.h>
#include <urban_gnss_localization/ComplementaryEkfConfig.h>
#include <visualization_msgs/MarkerArray.h>

#include "urban_gnss_localization/localizers/kim/complementary_ekf.hpp"
#include "urban_gnss_localization/ros/localizer_node.hpp"
#include "urban_gnss_localization/ros/markers.hpp"
#include "urban_gnss_localization/ros/node_parameters.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

using namespace urban_gnss;

namespace {

class ComplementaryEkfNode {
 public:
  ComplementaryEkfNode(ros::NodeHandle& node, ros::NodeHandle& private_node) {
    ComplementaryEkfParameters filter;
    read_private_parameters(private_node, shell_parameters_, filter);
    bias_publisher_ = node.advertise<urban_gnss_localization::GpsBias>(topics::kBias, 100);
    marker_publisher_ = node.advertise<visualization_msgs::MarkerArray>(topics::kBiasMarkers, 2);
    shell_ = std::make_unique<LocalizerNode>(node, private_node, shell_parameters_,
                                             std::make_unique<ComplementaryEkf>(filter),
                                             [this](const LocalizationOutput&) { publish_biases(); });
    private_node.setParam("mode", enum_name(filter.mode));  // the server starts from what is there
    reconfigure_server_ = std::make_unique<ReconfigureServer>(private_node);
    reconfigure_server_->setCallback(
        [this](urban_gnss_localization::ComplementaryEkfConfig& config, std::uint32_t) { reconfigure(config); });
  }

 private:
  using ReconfigureServer = dynamic_reconfigure::Server<urban_gnss_localization::ComplementaryEkfConfig>;

  ComplementaryEkf& filter() { return dynamic_cast<ComplementaryEkf&>(shell_->pipeline().localizer()); }

  void reconfigure(urban_gnss_localization::ComplementaryEkfConfig& config) {
    for (const auto& [name, mode] : enum_names(ComplementaryMode())) {
      if (config.mode != name) continue;
      if (config.mode != filter().mode()) ROS_INFO_STREAM("mode: " << config.mode);
      filter().set_mode(mode);
      return;
    }
    ROS_ERROR_STREAM("mode: there is no '" << config.mode << "'; it stays " << filter().mode());
    config.mode = filter().mode();
  }

  void publish_biases() {
    for (const BiasEstimate& bias : shell_->pipeline().take_bias_estimates()) {
      bias_publisher_.publish(to_message(bias, shell_parameters_.frames.map));
      if (marker_publisher_.getNumSubscribers() > 0) {
        marker_publisher_.publish(bias_markers(bias, shell_parameters_.frames.map));
      }
    }
    if (filter().is_gate_inert()) {
      ROS_WARN_STREAM_THROTTLE(60.0, "gate inert: the fixes scatter far less than their covariance says; a bias below "
                                         << filter().smallest_detectable_jump_m() << " m is not found at once");
    }
  }

  LocalizerNodeParameters shell_parameters_;
  ros::Publisher bias_publisher_;
  ros::Publisher marker_publisher_;
  std::unique_ptr<LocalizerNode> shell_;
  std::unique_ptr<ReconfigureServer> reconfigure_server_;
};

}  // namespace

int main(int argc, char** argv) {
  return run_node(argc, argv, "complementary_ekf", [](ros::NodeHandle& node, ros::NodeHandle& private_node) {
    return std::make_shared<ComplementaryEkfNode>(node, private_node);
  });
}
