// The steering law of Nishida et al. as a node: odometry/filtered in, cmd_vel out; also gps/datum in, where the targets
// are geographic. Parameters:
// WaypointControllerParameters and the two below; config/waypoint_controller.yaml documents each.

#include <geometry_msgs/Twist.h>
#include <nav_msgs/Odometry.h>
#include <nav_msgs/Path.h>
#include <ros/ros.h>
#include <sensor_msgs/NavSatFix.h>

#include <sstream>

#include "urban_gnss_localization/pipeline/stamp_monitor.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/markers.hpp"
#include "urban_gnss_localization/ros/node_parameters.hpp"
#include "urban_gnss_localization/ros/node_shell.hpp"
#include "urban_gnss_localization/ros/topics.hpp"
#include "urban_gnss_localization/ros/waypoint_controller_node_parameters.hpp"

using namespace urban_gnss;

namespace {

constexpr double kTimeJump_s = 1.0;

class WaypointControllerNode {
 public:
  WaypointControllerNode(ros::NodeHandle& node, ros::NodeHandle& private_node)
      : steering_(read(private_node)), controller_(fresh()), stamps_(kTimeJump_s) {
    command_publisher_ = node.advertise<geometry_msgs::Twist>(topics::kCommand, 10);
    target_publisher_ = node.advertise<visualization_msgs::MarkerArray>(topics::kTargets, 1, true);
    path_publisher_ = node.advertise<nav_msgs::Path>(topics::kTargetPath, 1, true);
    subscriber_ = io_.subscribe<nav_msgs::Odometry>(
        node, topics::kEstimate, 100, [this](const auto& m) { on_estimate(*m); }, ros::TransportHints().tcpNoDelay());
    watchdog_ = io_.every(node, parameters_.estimate_timeout, "the watchdog", [this] { stop_if_blind(); });
    five_second_timer_ = io_.every(node, 5.0, "the node's timer", [this] {
      const std::string awaited = what_is_awaited();
      if (!awaited.empty()) log_.warn(awaited);
    });
    if (is_geographic()) {
      datum_subscriber_ =
          io_.subscribe_any<sensor_msgs::NavSatFix>(node, topics::kDatum, 10, [this](const auto& m) { on_datum(*m); });
      log_.info(what_is_awaited());
    } else if (controller_.targets().empty()) {
      log_.warn("no targets: the robot will stand");
    }
  }

 private:
  WaypointControllerParameters read(const ros::NodeHandle& private_node) {
    read_private_parameters(private_node, parameters_);
    return parameters_.steering;
  }

  WaypointController fresh() const {
    return WaypointController(steering_, static_cast<std::size_t>(parameters_.first_target));
  }

  bool is_geographic() const { return !parameters_.steering.geographic.empty(); }

  /// One sentence for people; empty where nothing is awaited.
  std::string what_is_awaited() const {
    const auto publishers = [](const ros::Subscriber& subscriber) {
      return " (" + subscriber.getTopic() + ": " + std::to_string(subscriber.getNumPublishers()) +
             " publishers); the robot is not steered until then";
    };
    if (is_geographic() && !datum_) {
      return "geographic targets: waiting for the datum" + publishers(datum_subscriber_);
    }
    if (controller_.finished() || has_estimate_) return {};
    return "waiting for an estimate" + publishers(subscriber_);
  }

  /// Places the geographic targets; anew, from the current one, where the map frame moved.
  void on_datum(const sensor_msgs::NavSatFix& message) {
    const GeodeticPosition datum = to_geodetic(message);
    if (datum_ == datum) return;
    try {
      steering_ = parameters_.steering.in_map(LocalFrame(datum));
    } catch (const std::exception& error) {
      io_.refuse(datum_subscriber_.getTopic(), error.what());
      return;
    }
    controller_ = datum_ ? WaypointController(steering_, controller_.current_target()) : fresh();
    datum_ = datum;
    shown_.reset();
    ROS_INFO_STREAM("the datum is known: " << controller_.targets().size() << " geographic targets");
  }

  void on_estimate(const nav_msgs::Odometry& message) {
    if (is_geographic() && !datum_) return;
    const std::string fault = message_fault(message.pose);
    if (!fault.empty()) {
      io_.refuse(topics::kEstimate, fault);
      return;
    }
    if (!is_new(to_stamp(message.header.stamp))) return;
    has_estimate_ = true;
    const bool was_finished = controller_.finished();
    const BicycleInput input = controller_.steer(to_pose2(message.pose.pose));
    geometry_msgs::Twist command;
    command.linear.x = input.speed_mps;
    command.angular.z = yaw_rate(input, parameters_.steering.wheelbase);
    io_.publish(command_publisher_, command);
    is_driving_ = true;
    seen_since_check_ = true;
    if (!was_finished && controller_.finished()) ROS_INFO_STREAM("all laps are done");
    if (shown_ != controller_.current_target()) show_targets(message.header);
  }

  /// One estimate that is late, or of the future, changes nothing; a recording that starts over does.
  bool is_new(Stamp stamp) {
    const auto last = stamps_.last();
    switch (stamps_.judge(stamp)) {
      case StampVerdict::kNew:
      case StampVerdict::kWentAhead: return true;
      case StampVerdict::kNotNewer: return false;
      case StampVerdict::kOdd: io_.refuse(topics::kEstimate, describe_oddness(stamp, *last)); return false;
      case StampVerdict::kWentBack: break;
    }
    log_.warn("reset: the clock of the estimate jumped back");
    controller_ = fresh();
    shown_.reset();
    return true;
  }

  void show_targets(const std_msgs::Header& header) {
    shown_ = controller_.current_target();
    io_.publish(target_publisher_,
                target_markers(controller_.targets(), controller_.current_target(), header.stamp, header.frame_id));
    nav_msgs::Path path;
    path.header = header;
    for (std::size_t i = 0; i <= controller_.targets().size() && !controller_.targets().empty(); ++i) {
      const Eigen::Vector2d& target = controller_.targets()[i % controller_.targets().size()];
      geometry_msgs::PoseStamped pose;
      pose.header = header;
      pose.pose = to_message(Pose2{target.x(), target.y(), 0.0});
      path.poses.push_back(pose);
    }
    io_.publish(path_publisher_, path);
  }

  void stop_if_blind() {
    if (is_driving_ && !seen_since_check_) {
      std::ostringstream text;
      text << "no estimate for " << parameters_.estimate_timeout << " s: the robot is stopped";
      log_.warn(text.str());
      has_estimate_ = false;
      command_publisher_.publish(geometry_msgs::Twist());
      is_driving_ = false;
    }
    seen_since_check_ = false;
  }

  WaypointControllerNodeParameters parameters_;
  WaypointControllerParameters steering_;  ///< with the targets in the map frame
  WaypointController controller_;
  std::optional<GeodeticPosition> datum_;  ///< of the geographic targets
  StampMonitor stamps_;
  EventLog log_;
  NodeShell io_{log_};
  bool has_estimate_{false};  ///< lately
  std::optional<std::size_t> shown_;
  bool is_driving_{false};
  bool seen_since_check_{false};
  ros::Publisher command_publisher_;
  ros::Publisher target_publisher_;
  ros::Publisher path_publisher_;
  ros::Subscriber subscriber_;
  ros::Subscriber datum_subscriber_;
  ros::WallTimer watchdog_;
  ros::WallTimer five_second_timer_;
};

}  // namespace

int main(int argc, char** argv) {
  return run_node(argc, argv, "waypoint_controller", [](ros::NodeHandle& node, ros::NodeHandle& private_node) {
    return std::make_shared<WaypointControllerNode>(node, private_node);
  });
}
