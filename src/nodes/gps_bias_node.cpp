// The bias Kalman filter of Nishida et al. as a node: gps/fix, odom, odometry/filtered and gps/datum in, gps/bias out.
// Parameters: GpsBiasNodeParameters (docs/parameters.md).

#include <diagnostic_updater/diagnostic_updater.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/NavSatFix.h>
#include <visualization_msgs/MarkerArray.h>

#include <cmath>

#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/event_log.hpp"
#include "urban_gnss_localization/ros/gps_bias_node_parameters.hpp"
#include "urban_gnss_localization/ros/markers.hpp"
#include "urban_gnss_localization/ros/node_parameters.hpp"
#include "urban_gnss_localization/ros/node_shell.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

using namespace urban_gnss;

namespace {

class GpsBiasNode {
 public:
  GpsBiasNode(ros::NodeHandle& node, ros::NodeHandle& private_node)
      : pipeline_(read(private_node)), diagnostics_(ros::NodeHandle(), private_node) {
    bias_publisher_ = node.advertise<urban_gnss_localization::GpsBias>(topics::kBias, 100);
    marker_publisher_ = node.advertise<visualization_msgs::MarkerArray>(topics::kBiasMarkers, 2);
    const ros::TransportHints no_delay = ros::TransportHints().tcpNoDelay();
    using nav_msgs::Odometry;
    using sensor_msgs::NavSatFix;
    const auto refuse_fix = [this](const NavSatFix& m, const std::string& why) {
      pipeline_.refuse_fix(to_stamp(m.header.stamp), why);
      publish();
    };
    subscribers_ = {
        io_.subscribe_any<NavSatFix>(node, topics::kDatum, 10, [this](const auto& m) { on_datum(*m); }),
        io_.subscribe<Odometry>(
            node, topics::kOdometry, 1000, [this](const auto& m) { on_odometry(*m); }, no_delay),
        io_.subscribe<Odometry>(
            node, topics::kEstimate, 1000, [this](const auto& m) { on_estimate(*m); }, no_delay),
        io_.subscribe<NavSatFix>(
            node, topics::kFix, 100, [this](const auto& m) { on_fix(*m); }, no_delay, refuse_fix),
    };
    diagnostics_.setHardwareID("none");
    diagnostics_.add("gps bias", this, &GpsBiasNode::diagnose);
    second_timer_ = io_.every(node, 1.0, "the node's timer", [this] { diagnostics_.force_update(); });
    five_second_timer_ = io_.every(node, 5.0, "the node's timer", [this] {
      const std::string missing = pipeline_.waiting_for();
      if (!missing.empty()) log_.warn("waiting for " + missing);
    });
  }

 private:
  BiasPipelineParameters read(const ros::NodeHandle& private_node) {
    GpsBiasNodeParameters parameters;
    if (private_node.getParam("localizer", parameters.localizer) && !parameters.localizer.empty()) {
      read_known_parameters(ros::NodeHandle(parameters.localizer), parameters.frames, parameters.bias);
    }
    read_private_parameters(private_node, parameters);
    frames_ = parameters.frames;
    return parameters.bias;
  }

  void on_datum(const sensor_msgs::NavSatFix& message) {
    try {
      pipeline_.set_datum(to_geodetic(message));
    } catch (const std::invalid_argument& error) {
      io_.refuse(topics::kDatum, error.what());
    }
    publish();
  }
  void on_odometry(const nav_msgs::Odometry& message) {
    pipeline_.add_odometry(to_odometry_sample(message));
    publish();
  }
  void on_estimate(const nav_msgs::Odometry& message) {
    const std::string fault = message_fault(message.pose);
    if (!fault.empty()) {
      io_.refuse(topics::kEstimate, fault);
      return;
    }
    pipeline_.add_estimate(to_stamp(message.header.stamp), to_pose2(message.pose.pose));
    publish();
  }
  void on_fix(const sensor_msgs::NavSatFix& message) {
    pipeline_.add_fix(to_raw_fix(message));
    publish();
  }

  void publish() {
    io_.report(pipeline_.take_events());
    for (const BiasEstimate& bias : pipeline_.take_estimates()) {
      io_.publish(bias_publisher_, to_message(bias, frames_.map));
      if (marker_publisher_.getNumSubscribers() > 0) io_.publish(marker_publisher_, bias_markers(bias, frames_.map));
      last_ = bias;
    }
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
    const std::string missing = pipeline_.waiting_for();
    using diagnostic_msgs::DiagnosticStatus;
    if (!missing.empty()) {
      status.summary(DiagnosticStatus::WARN, "waiting for " + missing);
    } else {
      status.summary(DiagnosticStatus::OK, last_.in_shadow ? "in shadow" : "direct reception");
    }
    status.add("bias radius (m)", last_.radius_m);
    status.add("shadow statistic", last_.shadow_statistic);
    status.add("last fix", to_string(last_.outcome.decision));
    status.add("last NIS", last_.outcome.nis);
    io_.diagnose(status);
  }

  Frames frames_;
  BiasPipeline pipeline_;
  EventLog log_;
  NodeShell io_{log_};
  BiasEstimate last_;
  ros::Publisher bias_publisher_;
  ros::Publisher marker_publisher_;
  std::vector<ros::Subscriber> subscribers_;
  diagnostic_updater::Updater diagnostics_;
  ros::WallTimer second_timer_;
  ros::WallTimer five_second_timer_;
};

}  // namespace

int main(int argc, char** argv) {
  return run_node(argc, argv, "gps_bias", [](ros::NodeHandle& node, ros::NodeHandle& private_node) {
    return std::make_shared<GpsBiasNode>(node, private_node);
  });
}
