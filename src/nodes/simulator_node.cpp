// Simulates the field of Nishida et al., section 4.1: cmd_vel in; odom, gps/fix, ground truth, tf odom -> base_link,
// markers and (optionally) the clock out. Parameters: PaperFieldParameters, MotionParameters, DatumParameters' datum,
// Frames and the ones below; config/paper_field/simulator.yaml documents each.

#include <geometry_msgs/Twist.h>
#include <geometry_msgs/Vector3Stamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <sensor_msgs/NavSatFix.h>
#include <std_msgs/Bool.h>
#include <tf2_ros/transform_broadcaster.h>
#include <visualization_msgs/MarkerArray.h>

#include <cmath>

#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/markers.hpp"
#include "urban_gnss_localization/ros/node_parameters.hpp"
#include "urban_gnss_localization/ros/topics.hpp"
#include "urban_gnss_localization/simulation/paper_field.hpp"

using namespace urban_gnss;

namespace {

/// Simulated time of the first step; not 0, which ROS takes for "no time yet".
constexpr double kStartTime_s = 1.0;
constexpr double kMarkerInterval_s = 0.1;

enum class Field { kPaperField };
EnumNames<Field> enum_names(Field) { return {{"paper_field", Field::kPaperField}}; }

struct NodeParameters {
  Field field{Field::kPaperField};
  std::vector<double> datum{33.8903, 130.8394, 0.0};  ///< deg, deg, m: where the map frame's origin is in the world
  bool publish_clock{true};      ///< simulated time on /clock; the other nodes then need use_sim_time
  double real_time_factor{1.0};  ///< seconds of the simulation in a second, at the most
  bool wait_for_command{true};   ///< after each step, wait for the command that answers it
  double command_wait{0.05};     ///< s of wall time, the longest such wait
  double command_timeout{0.5};   ///< s of simulated time without a command after which the robot stands

  template <class V>
  void visit(V& v) {
    v("field", field);
    v("datum", datum);
    v("publish_clock", publish_clock);
    v("real_time_factor", real_time_factor, positive());
    v("wait_for_command", wait_for_command);
    v("command_wait", command_wait, positive());
    v("command_timeout", command_timeout, positive());
  }
  void check(std::vector<std::string>& faults) const {
    if (datum.size() != 3) {
      faults.push_back("datum: must be latitude (deg), longitude (deg) and altitude (m)");
      return;
    }
    for (const auto& fault : position_faults({datum[0], datum[1], datum[2]})) faults.push_back("datum: " + fault);
  }
};

class SimulatorNode {
 public:
  SimulatorNode(ros::NodeHandle& node, ros::NodeHandle& private_node)
      : field_(make(private_node)), frame_({parameters_.datum[0], parameters_.datum[1], parameters_.datum[2]}) {
    odometry_publisher_ = node.advertise<nav_msgs::Odometry>(topics::kOdometry, 100);
    fix_publisher_ = node.advertise<sensor_msgs::NavSatFix>(topics::kFix, 100);
    truth_publisher_ = node.advertise<nav_msgs::Odometry>(topics::kTruth, 100);
    error_publisher_ = node.advertise<geometry_msgs::Vector3Stamped>(topics::kTrueFixError, 100);
    shadow_publisher_ = node.advertise<std_msgs::Bool>(topics::kTrueShadow, 100);
    marker_publisher_ = node.advertise<visualization_msgs::MarkerArray>(topics::kWorld, 2);
    if (parameters_.publish_clock) clock_publisher_ = node.advertise<rosgraph_msgs::Clock>("/clock", 100);
    command_subscriber_ =
        node.subscribe(topics::kCommand, 10, &SimulatorNode::on_command, this, ros::TransportHints().tcpNoDelay());
    const double period_s = field_.parameters().interval / parameters_.real_time_factor;
    timer_ = node.createWallTimer(ros::WallDuration(period_s), [this](const ros::WallTimerEvent&) { step(); });
  }

 private:
  PaperField make(const ros::NodeHandle& private_node) {
    PaperFieldParameters field;
    read_private_parameters(private_node, field, motion_, frames_, parameters_);
    return PaperField(field, motion_);
  }

  void on_command(const geometry_msgs::Twist& message) {
    if (!std::isfinite(message.linear.x) || !std::isfinite(message.angular.z)) {
      ROS_WARN_STREAM_THROTTLE(5.0, "cmd_vel left out: not finite");
      return;
    }
    command_ = {message.linear.x, message.angular.z};
    command_age_s_ = 0.0;
    ++commands_;
  }

  void step() {
    const double interval = field_.parameters().interval;
    if (command_age_s_ > parameters_.command_timeout) command_ = {};
    command_age_s_ += interval;
    time_s_ += interval;
    // What the odometry reports is the input: the robot's own noise is what it cannot see.
    const BicycleInput input = bicycle_input(command_, motion_.wheelbase);
    field_.step(input);
    const Twist2 reported{input.speed_mps, yaw_rate(input, motion_.wheelbase)};
    odometry_pose_ = move(odometry_pose_, reported, interval);
    const std::uint64_t commands_before = commands_;
    publish(reported, field_.fix());
    if (parameters_.wait_for_command && command_publishers() > 0) await_command(commands_before);
  }

  std::uint32_t command_publishers() const { return command_subscriber_.getNumPublishers(); }

  /// The loop is closed at every step, as in the paper, however slow the machine is.
  void await_command(std::uint64_t commands_before) {
    const ros::WallTime until = ros::WallTime::now() + ros::WallDuration(parameters_.command_wait);
    while (ros::ok() && commands_ == commands_before && ros::WallTime::now() < until) {
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.001));
    }
  }

  void publish(const Twist2& twist, const SimulatedFix& fix) {
    const ros::Time time(time_s_);
    if (parameters_.publish_clock) {
      rosgraph_msgs::Clock clock;
      clock.clock = time;
      clock_publisher_.publish(clock);
    }
    broadcaster_.sendTransform(to_transform(odometry_pose_, time, frames_.odom, frames_.base_link));
    odometry_publisher_.publish(odometry(odometry_pose_, twist, time, frames_.odom));
    truth_publisher_.publish(odometry(field_.truth(), twist, time, frames_.map));

    const GeodeticPosition place = frame_.to_geodetic({fix.position.x(), fix.position.y(), 0.0});
    sensor_msgs::NavSatFix message = to_message(place, time, frames_.base_link);
    // A receiver does not know that it is in the shadow: it claims the accuracy of direct reception everywhere.
    const double claimed = std::pow(std::max(field_.parameters().fix_direct_sigma, 1e-3), 2);
    message.position_covariance = {claimed, 0.0, 0.0, 0.0, claimed, 0.0, 0.0, 0.0, 4.0 * claimed};
    message.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_DIAGONAL_KNOWN;
    fix_publisher_.publish(message);

    geometry_msgs::Vector3Stamped error;
    error.header.stamp = time;
    error.header.frame_id = frames_.map;
    error.vector.x = fix.position.x() - field_.truth().x;
    error.vector.y = fix.position.y() - field_.truth().y;
    error_publisher_.publish(error);
    std_msgs::Bool shadow;
    shadow.data = fix.in_shadow;
    shadow_publisher_.publish(shadow);

    if (marker_publisher_.getNumSubscribers() > 0 && time_s_ - last_markers_s_ >= kMarkerInterval_s) {
      last_markers_s_ = time_s_;
      marker_publisher_.publish(field_markers(field_.parameters().shadow_border,
                                              1.6 * field_.parameters().target_ring_radius, field_.truth(),
                                              motion_.wheelbase, time, frames_.map));
    }
  }

  nav_msgs::Odometry odometry(const Pose2& pose, const Twist2& twist, const ros::Time& time,
                              const std::string& frame) const {
    nav_msgs::Odometry message;
    message.header.stamp = time;
    message.header.frame_id = frame;
    message.child_frame_id = frames_.base_link;
    message.pose.pose = to_message(pose);
    message.twist.twist.linear.x = twist.speed_mps;
    message.twist.twist.angular.z = twist.yaw_rate_radps;
    const MotionStep step = make_motion_step(twist, field_.parameters().interval, motion_);
    message.twist.covariance[0] = step.speed_sigma * step.speed_sigma;
    message.twist.covariance[35] = step.yaw_rate_sigma * step.yaw_rate_sigma;
    return message;
  }

  NodeParameters parameters_;
  Frames frames_;
  MotionParameters motion_;
  PaperField field_;
  LocalFrame frame_;
  Twist2 command_;
  double command_age_s_{0.0};
  std::uint64_t commands_{0};
  double time_s_{kStartTime_s};
  double last_markers_s_{0.0};
  Pose2 odometry_pose_;
  ros::Publisher clock_publisher_;
  ros::Publisher odometry_publisher_;
  ros::Publisher fix_publisher_;
  ros::Publisher truth_publisher_;
  ros::Publisher error_publisher_;
  ros::Publisher shadow_publisher_;
  ros::Publisher marker_publisher_;
  ros::Subscriber command_subscriber_;
  tf2_ros::TransformBroadcaster broadcaster_;
  ros::WallTimer timer_;
};

}  // namespace

int main(int argc, char** argv) {
  return run_node(argc, argv, "simulator", [](ros::NodeHandle& node, ros::NodeHandle& private_node) {
    return std::make_shared<SimulatorNode>(node, private_node);
  });
}
