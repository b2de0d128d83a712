#include "urban_gnss_localization/ros/localizer_node.hpp"

#include <cmath>
#include <utility>

#include "urban_gnss_localization/pipeline/status_line.hpp"
#include "urban_gnss_localization/receivers/receiver_presets.hpp"
#include "urban_gnss_localization/ros/markers.hpp"
#include "urban_gnss_localization/ros/topics.hpp"
#include "urban_gnss_localization/ros/visibility_messages.hpp"

namespace urban_gnss {
namespace {

const ros::TransportHints kNoDelay = ros::TransportHints().tcpNoDelay();
/// As the estimate's arrow in the views of rviz/.
constexpr Colour kEstimateColour{0.16F, 0.51F, 1.0F, 1.0F};

}  // namespace

LocalizerNode::LocalizerNode(ros::NodeHandle& node, ros::NodeHandle& private_node,
                             const LocalizerNodeParameters& parameters, std::unique_ptr<Localizer> localizer,
                             OutputHook on_output)
    : parameters_(parameters),
      pipeline_(parameters.localization, std::move(localizer)),
      on_output_(std::move(on_output)),
      slew_(parameters.slew),
      sensor_frames_(parameters.frames, parameters.antenna_offset_from_tf, parameters.localization.input.antenna()),
      state_(private_node, parameters.frames, log_),
      diagnostics_(ros::NodeHandle(), private_node) {
  const std::string fused = why_not_a_receiver(node.resolveName(topics::kFix));
  if (!fused.empty()) throw std::runtime_error(std::string(topics::kFix) + ": " + fused);
  estimate_publisher_ = node.advertise<nav_msgs::Odometry>(topics::kEstimate, 100);
  fix_publisher_ = node.advertise<sensor_msgs::NavSatFix>(topics::kFilteredFix, 100);
  status_publisher_ = private_node.advertise<urban_gnss_localization::LocalizationStatus>(topics::kStatus, 100);
  ellipse_publisher_ = node.advertise<visualization_msgs::Marker>(topics::kEllipse, 1);
  status_text_publisher_ = node.advertise<visualization_msgs::Marker>(topics::kStatusText, 1, true);
  datum_publisher_ = node.advertise<sensor_msgs::NavSatFix>(topics::kDatum, 1, true);

  state_.restore(pipeline_, parameters.state);
  tf_.emplace(node, io_);
  subscribe(node);
  serve(node, private_node);
  diagnostics_.setHardwareID("none");
  diagnostics_.add("localization", this, &LocalizerNode::diagnose);
  second_timer_ = io_.every(node, kStatusPeriod_s, "the node's timer", [this] { every_second(); });
  five_second_timer_ = io_.every(node, 5.0, "the node's timer", [this] { every_five_seconds(); });
  publish_results();
}

void LocalizerNode::subscribe(ros::NodeHandle& node) {
  using sensor_msgs::Imu;
  using sensor_msgs::NavSatFix;
  using urban_gnss_localization::GpsBias;
  using urban_gnss_localization::SatelliteArray;
  const auto add = [this](const ros::Subscriber& subscriber) { subscribers_.push_back(subscriber); };
  // First, so that a datum that is latched comes before fixes of which another would be made.
  add(io_.subscribe_any<NavSatFix>(node, topics::kDatum, 10, [this](const auto& m) { on_datum(*m); }));
  add(io_.subscribe<nav_msgs::Odometry>(
      node, topics::kOdometry, 1000, [this](const auto& m) { on_odometry(*m); }, kNoDelay));
  odometry_watch_.set_subscriber(subscribers_.back());
  add(io_.subscribe<NavSatFix>(
      node, topics::kFix, 100, [this](const auto& m) { on_fix(*m); }, kNoDelay,
      [this](const NavSatFix& m, const std::string& why) {
        pipeline_.refuse_fix(to_stamp(m.header.stamp), why);
        publish_results();
      }));
  fix_watch_.set_subscriber(subscribers_.back());
  add(io_.subscribe_any<geometry_msgs::PoseWithCovarianceStamped>(node, topics::kInitialPose, 10,
                                                                  [this](const auto& m) { on_initial_pose(*m); }));
  if (pipeline_.localizer().wants_bias()) {
    add(io_.subscribe<GpsBias>(
        node, topics::kBias, 100, [this](const auto& m) { on_bias(*m); }, kNoDelay));
  }
  if (pipeline_.takes_velocity()) {
    add(io_.subscribe_any<topic_tools::ShapeShifter>(
        node, topics::kVelocity, 100, [this](const auto& m) { on_velocity(*m); }, kNoDelay));
  }
  add(io_.subscribe<SatelliteArray>(
      node, topics::kSatellites, 100, [this](const auto& m) { on_satellites(*m); }, kNoDelay));
  if (pipeline_.takes_imu()) {
    add(io_.subscribe<Imu>(
        node, topics::kImu, 1000, [this](const auto& m) { on_imu(*m); }, kNoDelay));
  }
}

void LocalizerNode::serve(ros::NodeHandle& node, ros::NodeHandle& private_node) {
  using namespace urban_gnss_localization;
  services_.push_back(
      io_.serve<SetPose::Request, SetPose::Response>(node, "set_pose", [this](auto& request, auto& response) {
        response.message = try_pose(request.pose);
        response.success = response.message.empty();
      }));
  services_.push_back(io_.serve<SetDatum::Request, SetDatum::Response>(
      node, "datum", [this](auto& request, auto& response) { set_datum(request, response); }));
  serve_conversion<ToLL>(node, "toLL");
  serve_conversion<FromLL>(node, "fromLL");
  serve_conversion<ToLLArray>(node, "toLLArray");
  serve_conversion<FromLLArray>(node, "fromLLArray");
  services_.push_back(
      io_.serve<std_srvs::Empty::Request, std_srvs::Empty::Response>(private_node, "reset", [this](auto&, auto&) {
        pipeline_.reset("requested");
        publish_results();
      }));
}

void LocalizerNode::on_odometry(const nav_msgs::Odometry& message) {
  odometry_watch_.observe_frame(message.header.frame_id);
  sensor_frames_.observe_odometry(message.header.frame_id, message.child_frame_id);
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
    io_.refuse(topics::kVelocity, "is " + message.getDataType() + ", must be " + kVelocityTypes);
    return;
  }
  if (!io_.stamp_fault(topics::kVelocity, to_ros(velocity->stamp)).empty()) return;
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
  if (const auto sample = to_imu_sample(message)) {
    pipeline_.add_imu(*sample);
  } else if (message.angular_velocity_covariance[0] != -1.0) {
    io_.refuse(topics::kImu, "angular_velocity is not finite");
  }
}

void LocalizerNode::on_bias(const urban_gnss_localization::GpsBias& message) {
  const std::string fault = message_fault(message);
  if (!fault.empty()) {
    io_.refuse(topics::kBias, fault);
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
  const std::string fault = message_fault(message.pose);
  if (!fault.empty()) return fault;
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
  if (!fault.empty()) io_.refuse(topics::kInitialPose, fault);
}

void LocalizerNode::on_datum(const sensor_msgs::NavSatFix& message) {
  const GeodeticPosition datum = to_geodetic(message);
  if (pipeline_.frame()) {
    const GeodeticPosition& known = pipeline_.frame()->datum();
    if (datum.latitude_deg != known.latitude_deg || datum.longitude_deg != known.longitude_deg) {
      io_.refuse(topics::kDatum, "there is a datum already; use the service datum");
    }
    return;
  }
  try {
    pipeline_.set_datum(datum);
    published_datum_ = datum;  // it came from the topic: no echo
  } catch (const std::invalid_argument& error) {
    io_.refuse(topics::kDatum, error.what());
  }
  publish_results();
}

void LocalizerNode::set_datum(const urban_gnss_localization::SetDatum::Request& request,
                              urban_gnss_localization::SetDatum::Response& response) {
  try {
    const GeodeticPosition datum{request.latitude, request.longitude, request.altitude};
    response.message = pipeline_.doubt_of_datum(datum);
    response.success = response.message.empty();
    if (response.success) pipeline_.set_datum(datum);
  } catch (const std::invalid_argument& error) {
    response.success = false;
    response.message = error.what();
  }
  publish_results();
}

void LocalizerNode::publish_results() {
  io_.report(pipeline_.take_events());
  publish_datum();
  for (const LocalizationOutput& output : pipeline_.take_outputs()) publish_output(output);
  const std::vector<FixOutcome> outcomes = pipeline_.take_outcomes();
  for (const FixOutcome& outcome : outcomes) {
    if (is_rejected(outcome.decision)) {
      log_.warn(std::string("fix ") + to_string(outcome.decision) + ": " + outcome.reason);
    }
  }
  for (const auto& status : to_status_messages(pipeline_, outcomes, now(), parameters_.frames.map)) {
    status_publisher_.publish(status);
  }
}

void LocalizerNode::publish_output(const LocalizationOutput& output) {
  const auto& frames = parameters_.frames;
  if (!io_.publish(estimate_publisher_, to_message(output, frames))) return;
  ++outputs_;
  if (ellipse_publisher_.getNumSubscribers() > 0) {
    io_.publish(ellipse_publisher_,
                ellipse_marker(output.estimate, kEstimateColour, 0, to_ros(output.stamp), frames.map));
  }
  io_.publish(fix_publisher_, to_fix_message(output, *pipeline_.frame(), frames));
  const auto map_to_odom =
      to_map_to_odom(slew_.follow(output), output.stamp, frames, parameters_.transform_time_offset);
  if (parameters_.publish_tf && io_.lets_out("/tf", map_to_odom)) broadcaster_.sendTransform(map_to_odom);
  if (on_output_) on_output_(output);
}

void LocalizerNode::publish_datum() {
  if (!pipeline_.frame()) {
    published_datum_.reset();
    return;
  }
  const GeodeticPosition& datum = pipeline_.frame()->datum();
  if (published_datum_ == datum) return;
  datum_publisher_.publish(to_message(datum, now(), parameters_.frames.map));
  published_datum_ = datum;
}

void LocalizerNode::publish_status() {
  const LocalizationReport report = pipeline_.report();
  status_publisher_.publish(to_message(report, pipeline_.localizer(), now(), parameters_.frames.map));
  status_text_publisher_.publish(status_marker(report, parameters_.frames.base_link));
}

void LocalizerNode::look_up_sensors() {
  if (!sensor_frames_.is_complete()) sensor_frames_.look_up(tf_->buffer(), pipeline_);
  log_.log(sensor_frames_.take_events());
}

void LocalizerNode::every_second() {
  look_up_sensors();
  sensor_frames_.complain();
  publish_status();
  state_.save(pipeline_);
  diagnostics_.force_update();
}

void LocalizerNode::every_five_seconds() {
  odometry_watch_.check_publishers();
  fix_watch_.check_publishers();
  const std::string missing = pipeline_.waiting_for();
  if (missing.empty()) return;
  log_.warn("waiting for " + missing + " (" + odometry_watch_.topic() + ": " +
            std::to_string(odometry_watch_.publishers()) + " publishers, " + fix_watch_.topic() + ": " +
            std::to_string(fix_watch_.publishers()) + ")");
}

void LocalizerNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const LocalizationReport report = pipeline_.report();
  using diagnostic_msgs::DiagnosticStatus;
  status.summary(static_cast<DiagnosticStatus::_level_type>(level_of(report)), status_line(report));
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
  status.add("gate inert", report.is_gate_inert);
  status.add("effective sample size", report.health.effective_sample_size);
  status.add("cluster mass", report.health.cluster_mass);
  status.add("estimates published", outputs_);
  status.add("tf behind the estimate (m)", slew_.behind_m());
  status.add("odd stamps left out", pipeline_.odd_stamps());
  status.add("broken states", pipeline_.broken_states());
  status.add("saved state", state_.news());
  io_.diagnose(status);
}

}  // namespace urban_gnss
