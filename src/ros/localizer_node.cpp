#include "urban_gnss_localization/ros/localizer_node.hpp"

#include <cmath>
#include <utility>

#include "urban_gnss_localization/receivers/receiver_presets.hpp"
#include "urban_gnss_localization/ros/topics.hpp"
#include "urban_gnss_localization/ros/visibility_messages.hpp"

namespace urban_gnss {
namespace {

const ros::TransportHints kNoDelay = ros::TransportHints().tcpNoDelay();

}  // namespace

LocalizerNode::LocalizerNode(ros::NodeHandle& node, ros::NodeHandle& private_node,
                             const LocalizerNodeParameters& parameters, std::unique_ptr<Localizer> localizer,
                             OutputHook on_output)
    : parameters_(parameters),
      pipeline_(parameters.localization, std::move(localizer)),
      on_output_(std::move(on_output)),
      sensor_frames_(parameters.frames, parameters.wants_antenna_from_tf()),
      diagnostics_(ros::NodeHandle(), private_node) {
  const std::string fused = why_not_a_receiver(node.resolveName(topics::kFix));
  if (!fused.empty()) throw std::runtime_error(std::string(topics::kFix) + ": " + fused);
  estimate_publisher_ = node.advertise<nav_msgs::Odometry>(topics::kEstimate, 100);
  fix_publisher_ = node.advertise<sensor_msgs::NavSatFix>(topics::kFilteredFix, 100);
  status_publisher_ = private_node.advertise<urban_gnss_localization::LocalizationStatus>(topics::kStatus, 100);
  datum_publisher_ = node.advertise<sensor_msgs::NavSatFix>(topics::kDatum, 1, true);

  using Self = LocalizerNode;
  // First, so that a datum that is latched comes before fixes of which another would be made.
  subscribers_.push_back(node.subscribe(topics::kDatum, 10, &Self::on_datum, this));
  subscribers_.push_back(node.subscribe(topics::kOdometry, 1000, &Self::on_odometry, this, kNoDelay));
  odometry_watch_.set_subscriber(subscribers_.back());
  subscribers_.push_back(node.subscribe(topics::kFix, 100, &Self::on_fix, this, kNoDelay));
  fix_watch_.set_subscriber(subscribers_.back());
  subscribers_.push_back(node.subscribe(topics::kInitialPose, 10, &Self::on_initial_pose, this));
  if (pipeline_.localizer().wants_bias()) {
    subscribers_.push_back(node.subscribe(topics::kBias, 100, &Self::on_bias, this, kNoDelay));
  }
  if (pipeline_.takes_velocity()) {
    subscribers_.push_back(node.subscribe(topics::kVelocity, 100, &Self::on_velocity, this, kNoDelay));
  }
  subscribers_.push_back(node.subscribe(topics::kSatellites, 100, &Self::on_satellites, this, kNoDelay));
  if (parameters_.localization.imu.use_imu_yaw_rate ||
      (pipeline_.localizer().takes_heading() &&
       parameters_.localization.imu_orientation.imu_heading != ImuHeadingUse::kNone)) {
    subscribers_.push_back(node.subscribe(topics::kImu, 1000, &Self::on_imu, this, kNoDelay));
  }
  services_.push_back(node.advertiseService("set_pose", &Self::set_pose, this));
  services_.push_back(node.advertiseService("datum", &Self::set_datum, this));
  using namespace urban_gnss_localization;
  services_.push_back(node.advertiseService("toLL", &Self::convert<ToLL::Request, ToLL::Response>, this));
  services_.push_back(node.advertiseService("fromLL", &Self::convert<FromLL::Request, FromLL::Response>, this));
  services_.push_back(
      node.advertiseService("toLLArray", &Self::convert<ToLLArray::Request, ToLLArray::Response>, this));
  services_.push_back(
      node.advertiseService("fromLLArray", &Self::convert<FromLLArray::Request, FromLLArray::Response>, this));
  services_.push_back(private_node.advertiseService("reset", &Self::reset, this));

  diagnostics_.setHardwareID("none");
  diagnostics_.add("localization", this, &Self::diagnose);
  second_timer_ = node.createWallTimer(ros::WallDuration(1.0), [this](const ros::WallTimerEvent&) { every_second(); });
  five_second_timer_ =
      node.createWallTimer(ros::WallDuration(5.0), [this](const ros::WallTimerEvent&) { every_five_seconds(); });
  publish_results();
}

void LocalizerNode::on_odometry(const nav_msgs::Odometry& message) {
  odometry_watch_.observe_frame(message.header.frame_id);
  sensor_frames_.observe_odometry(message.header.frame_id, message.child_frame_id);
  newest_input_ = to_stamp(message.header.stamp);
  pipeline_.add_odometry(to_odometry_sample(message));
  publish_results();
}

void LocalizerNode::on_fix(const sensor_msgs::NavSatFix& message) {
  fix_watch_.observe_frame(message.header.frame_id);
  sensor_frames_.observe_fix(message.header.frame_id);
  look_up_sensors();
  pipeline_.add_fix(to_raw_fix(message));
  publish_results();
}

void LocalizerNode::on_velocity(const topic_tools::ShapeShifter& message) {
  const auto velocity = to_raw_velocity_of(message);
  if (!velocity) {
    ROS_ERROR_STREAM_THROTTLE(
        5.0, topics::kVelocity << " left out: is " << message.getDataType() << ", must be " << kVelocityTypes);
    return;
  }
  pipeline_.add_velocity(*velocity);
  publish_results();
}

void LocalizerNode::on_satellites(const urban_gnss_localization::SatelliteArray& message) {
  pipeline_.add_satellites(to_stamp(message.header.stamp), to_observations(message));
  publish_results();
}

void LocalizerNode::on_imu(const sensor_msgs::Imu& message) {
  sensor_frames_.observe_imu(message.header.frame_id);
  look_up_sensors();
  if (const auto sample = to_imu_sample(message)) pipeline_.add_imu(*sample);
}

void LocalizerNode::on_bias(const urban_gnss_localization::GpsBias& message) {
  if (!std::isfinite(message.radius) || message.radius < 0.0) {
    ROS_WARN_STREAM_THROTTLE(5.0, "gps/bias left out: radius is not a finite length");
    return;
  }
  pipeline_.add_bias(to_bias_estimate(message));
  publish_results();
}

std::string LocalizerNode::try_pose(const geometry_msgs::PoseWithCovarianceStamped& message) {
  const std::string frame = without_leading_slash(message.header.frame_id);
  if (!frame.empty() && frame != parameters_.frames.map) {
    return "pose is in frame '" + message.header.frame_id + "', must be in '" + parameters_.frames.map + "'";
  }
  try {
    pipeline_.set_pose(to_pose_estimate(message.pose));
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  publish_results();
  publish_status();  // what was healthy is not any more
  return {};
}

void LocalizerNode::on_initial_pose(const geometry_msgs::PoseWithCovarianceStamped& message) {
  const std::string fault = try_pose(message);
  if (!fault.empty()) ROS_ERROR_STREAM("initialpose refused: " << fault);
}

bool LocalizerNode::set_pose(urban_gnss_localization::SetPose::Request& request,
                             urban_gnss_localization::SetPose::Response& response) {
  response.message = try_pose(request.pose);
  response.success = response.message.empty();
  return true;
}

void LocalizerNode::on_datum(const sensor_msgs::NavSatFix& message) {
  const GeodeticPosition datum = to_geodetic(message);
  if (pipeline_.frame()) {
    const GeodeticPosition& known = pipeline_.frame()->datum();
    if (datum.latitude_deg != known.latitude_deg || datum.longitude_deg != known.longitude_deg) {
      ROS_WARN_STREAM_THROTTLE(5.0, topics::kDatum << ": left out, there is a datum already; use the service datum");
    }
    return;
  }
  try {
    pipeline_.set_datum(datum);
    published_datum_ = datum;  // it came from the topic: no echo
  } catch (const std::invalid_argument& error) {
    ROS_ERROR_STREAM(topics::kDatum << " refused: " << error.what());
  }
  publish_results();
}

bool LocalizerNode::set_datum(urban_gnss_localization::SetDatum::Request& request,
                              urban_gnss_localization::SetDatum::Response& response) {
  try {
    pipeline_.set_datum({request.latitude, request.longitude, request.altitude});
    response.success = true;
  } catch (const std::invalid_argument& error) {
    response.success = false;
    response.message = error.what();
  }
  publish_results();
  return true;
}

bool LocalizerNode::reset(std_srvs::Empty::Request&, std_srvs::Empty::Response&) {
  pipeline_.reset("requested");
  publish_results();
  return true;
}

void LocalizerNode::publish_results() {
  log_.log(pipeline_.take_events());
  publish_datum();
  for (const LocalizationOutput& output : pipeline_.take_outputs()) {
    ++outputs_;
    estimate_publisher_.publish(to_message(output, parameters_.frames));
    fix_publisher_.publish(to_fix_message(output, *pipeline_.frame(), parameters_.frames));
    if (parameters_.publish_tf) {
      broadcaster_.sendTransform(to_map_to_odom(output, parameters_.frames, parameters_.transform_time_offset));
    }
    if (on_output_) on_output_(output);
  }
  const std::vector<FixOutcome> outcomes = pipeline_.take_outcomes();
  for (const FixOutcome& outcome : outcomes) {
    if (is_rejected(outcome.decision)) {
      ROS_WARN_STREAM_THROTTLE(5.0, "fix " << to_string(outcome.decision) << ": " << outcome.reason);
    }
  }
  for (const auto& status : to_status_messages(pipeline_, outcomes, to_ros(newest_input_), parameters_.frames.map)) {
    status_publisher_.publish(status);
  }
}

void LocalizerNode::publish_datum() {
  if (!pipeline_.frame()) {
    published_datum_.reset();
    return;
  }
  const GeodeticPosition& datum = pipeline_.frame()->datum();
  if (published_datum_ == datum) return;
  datum_publisher_.publish(to_message(datum, to_ros(newest_input_), parameters_.frames.map));
  published_datum_ = datum;
}

void LocalizerNode::publish_status() {
  status_publisher_.publish(
      to_message(pipeline_.report(), pipeline_.localizer(), to_ros(newest_input_), parameters_.frames.map));
}

void LocalizerNode::look_up_sensors() {
  if (!sensor_frames_.is_complete()) sensor_frames_.look_up(tf_buffer_, pipeline_);
  log_.log(sensor_frames_.take_events());
}

void LocalizerNode::every_second() {
  look_up_sensors();
  sensor_frames_.complain();
  publish_status();
  diagnostics_.force_update();
}

void LocalizerNode::every_five_seconds() {
  odometry_watch_.check_publishers();
  fix_watch_.check_publishers();
  const std::string missing = pipeline_.waiting_for();
  if (missing.empty()) return;
  ROS_WARN_STREAM("waiting for " << missing << " (" << odometry_watch_.topic() << ": " << odometry_watch_.publishers()
                                 << " publishers, " << fix_watch_.topic() << ": " << fix_watch_.publishers() << ")");
}

void LocalizerNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const LocalizationReport report = pipeline_.report();
  using diagnostic_msgs::DiagnosticStatus;
  const auto level = report.healthy                             ? DiagnosticStatus::OK
                     : report.state == LocalizationState::kLost ? DiagnosticStatus::ERROR
                                                                : DiagnosticStatus::WARN;
  status.summary(level, report.healthy && report.reason.empty() ? "tracking" : report.reason);
  status.add("state", to_string(report.state));
  status.add("mode", pipeline_.localizer().mode());
  status.add("last fix", to_string(report.last_fix.decision));
  status.add("receiver", report.receiver_note.empty() ? "no known mistake" : report.receiver_note);
  status.add("fixes used", report.fixes_used);
  status.add("fixes rejected", report.fixes_rejected);
  status.add("fix age (s)", report.fix_age_s);
  status.add("fixes with ranges", report.fixes_with_ranges);
  status.add("velocities used", report.velocities_used);
  status.add("position sigma (m)", report.position_sigma_m);
  status.add("protection level (m)", report.protection_level_m);
  status.add("heading sigma (rad)", report.health.heading_sigma_rad);
  status.add("bias radius (m)", report.bias_radius_m);
  status.add("gate inert", report.health.is_gate_inert);
  status.add("effective sample size", report.health.effective_sample_size);
  status.add("cluster mass", report.health.cluster_mass);
  status.add("estimates published", outputs_);
}

}  // namespace urban_gnss
