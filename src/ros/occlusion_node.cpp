#include "urban_gnss_localization/ros/occlusion_node.hpp"

#include <algorithm>
#include <boost/make_shared.hpp>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "urban_gnss_localization/occlusion/map_file.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/node_parameters.hpp"
#include "urban_gnss_localization/ros/receiver_messages.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace urban_gnss {
namespace {

/// As a shared pointer, which reaches subscribers in the same process without a copy.
template <class Message>
void publish_shared(NodeShell& io, const ros::Publisher& publisher, Message message) {
  io.publish_shared<Message>(publisher, boost::make_shared<const Message>(std::move(message)));
}

}  // namespace

OcclusionNode::OcclusionNode(ros::NodeHandle& node, ros::NodeHandle& private_node)
    : tf_(node, io_), transforms_(tf_.buffer()), diagnostics_(node, private_node, private_node.getNamespace()) {
  OcclusionNodeSettings settings;
  read_private_parameters(private_node, settings);
  frames_ = settings.frames;
  parameters_ = settings.node;
  queue_ =
      std::make_unique<OcclusionQueue>(settings.pipeline, parameters_.queue, to_occlusion_frames(frames_), transforms_);
  has_prior_map_ = !parameters_.prior_map.empty();
  if (has_prior_map_) queue_->set_prior_map(read_pcd(parameters_.prior_map));

  fix_publisher_ = node.advertise<sensor_msgs::NavSatFix>(topics::kWeightedFix, 100);
  visibility_publisher_ = node.advertise<urban_gnss_localization::Visibility>(topics::kVisibility, 100);
  marker_publisher_ = node.advertise<visualization_msgs::MarkerArray>(topics::kVisibilityMarkers, 2);
  sky_publisher_ = node.advertise<sensor_msgs::Image>(topics::kSkyPlot, 2);
  map_publisher_ = node.advertise<sensor_msgs::PointCloud2>(topics::kOcclusionMap, 1, true);
  // Before the subscribers, whose callbacks start it: a nodelet's may come while this goes on.
  work_timer_ = io_.every(node, 0.005, "the node's work", [this] { work(); });
  subscribe(node, settings.pipeline.imu_orientation.is_used());
  clear_service_ = io_.serve<std_srvs::Trigger::Request, std_srvs::Trigger::Response>(
      private_node, "clear_map", [this](auto&, auto& response) { clear_map(response); });
  using urban_gnss_localization::SaveMap;
  save_service_ = io_.serve<SaveMap::Request, SaveMap::Response>(
      private_node, "save_map", [this](auto& request, auto& response) { save_map(request, response); });

  diagnostics_.setHardwareID("none");
  diagnostics_.add("occlusion", this, &OcclusionNode::diagnose);
  second_timer_ = io_.every(node, 1.0, "the node's timer", [this] { every_second(); });
  five_second_timer_ = io_.every(node, 5.0, "the node's timer", [this] { every_five_seconds(); });
  map_timer_ = io_.every(node, parameters_.map_publish_period, "the map's timer", [this] { publish_map(); });
}

void OcclusionNode::subscribe(ros::NodeHandle& node, bool takes_imu) {
  const auto no_delay = ros::TransportHints().tcpNoDelay();
  fix_subscriber_ = io_.subscribe<sensor_msgs::NavSatFix>(
      node, topics::kFix, 100, [this](const auto& m) { on_fix(m); }, no_delay);
  fix_watch_.set_subscriber(fix_subscriber_);
  satellites_subscriber_ = io_.subscribe<urban_gnss_localization::SatelliteArray>(
      node, topics::kSatellites, 100, [this](const auto& m) { on_satellites(*m); }, no_delay);
  // A longer queue than cloud_queue: what is dropped is dropped in on_cloud(), which counts it.
  cloud_subscriber_ = io_.subscribe<sensor_msgs::PointCloud2>(
      node, topics::kPoints, 100, [this](const auto& m) { on_cloud(m); }, no_delay);
  estimate_subscriber_ = io_.subscribe_any<nav_msgs::Odometry>(
      node, topics::kEstimate, 100, [this](const auto& m) { on_estimate(*m); }, no_delay);
  if (!takes_imu) return;
  imu_subscriber_ = io_.subscribe<sensor_msgs::Imu>(
      node, topics::kImu, 1000, [this](const auto& m) { on_imu(*m); }, no_delay);
}

OcclusionNode::~OcclusionNode() { fix_subscriber_.shutdown(); }  // fix_watch_ holds it too

/// Only queues the cloud, for the timer: who works here leaves the next clouds to ROS's own queue,
/// which drops them without a word.
void OcclusionNode::on_cloud(const sensor_msgs::PointCloud2ConstPtr& message) {
  queue_->add_cloud(to_queued_cloud(message));
  io_.report(queue_->take_events());
  work_timer_.start();
}

void OcclusionNode::on_satellites(const urban_gnss_localization::SatelliteArray& message) {
  queue_->add_satellites(to_satellite_epoch(message));
}

void OcclusionNode::on_estimate(const nav_msgs::Odometry& message) {
  queue_->set_yaw_variance(message.pose.covariance[35]);
}

void OcclusionNode::on_imu(const sensor_msgs::Imu& message) {
  if (const auto sample = to_imu_sample(message)) {
    queue_->add_imu(*sample, without_leading_slash(message.header.frame_id));
  }
}

void OcclusionNode::on_fix(const sensor_msgs::NavSatFixConstPtr& message) {
  fix_watch_.observe_frame(message->header.frame_id);
  queue_->add_fix(
      to_queued_fix(message, [this, message](const FixAssessment* assessment) { publish(message, assessment); }));
  settle_fixes();
  work_timer_.start();
}

/// A fix waits for nothing but its transform and its satellites, and for the cloud that is just put into the map.
void OcclusionNode::settle_fixes() {
  queue_->settle_fixes();
  io_.report(queue_->take_events());
}

/// One cloud, then what has come meanwhile; again and again while something waits.
void OcclusionNode::work() {
  queue_->settle_fixes();
  queue_->work();
  io_.report(queue_->take_events());
  if (!queue_->has_waiting()) work_timer_.stop();
}

void OcclusionNode::every_second() {
  work();  // the prior map waits for a heading, not for a message
  fix_watch_.check_publishers();
  diagnostics_.update();
}

void OcclusionNode::every_five_seconds() {
  const std::string awaited = what_is_awaited();
  if (!awaited.empty()) log_.warn("waiting for " + awaited);
}

/// Nothing can be done without fixes; without the others a fix is weighed by what there is, and its line says so.
std::string OcclusionNode::what_is_awaited() const {
  const auto publishers = [](const ros::Subscriber& subscriber) {
    return " (" + subscriber.getTopic() + ": " + std::to_string(subscriber.getNumPublishers()) + " publishers)";
  };
  std::string awaited;
  const auto add = [&awaited](const std::string& what) { awaited += (awaited.empty() ? "" : ", ") + what; };
  if (queue_->newest_fix() == Stamp(0)) add("fixes" + publishers(fix_subscriber_));
  if (queue_->tally().clouds == 0) add("clouds" + publishers(cloud_subscriber_));
  if (!tf_.buffer().canTransform(frames_.odom, frames_.base_link, ros::Time(0))) {
    add("tf from " + frames_.odom + " to " + frames_.base_link);
  }
  return awaited;
}

/// A fix without a place: who listens shall see what the receiver says, but no numbers that are none.
/// `assessment`: null where there is nothing to weigh.
void OcclusionNode::publish(const sensor_msgs::NavSatFixConstPtr& message, const FixAssessment* assessment) {
  if (assessment == nullptr) {
    publish_shared(io_, fix_publisher_, fix_without_place(*message));
    return;
  }
  const ros::Time stamp = message->header.stamp;
  const OcclusionPipeline& pipeline = queue_->pipeline();
  publish_shared(io_, fix_publisher_, weighted_fix(*message, assessment->covariance));
  const auto visibility = boost::make_shared<const urban_gnss_localization::Visibility>(
      to_message(*assessment, claimed_covariance(*message), pipeline.parameters().covariance, stamp, frames_.odom));
  io_.publish_shared(visibility_publisher_, visibility);
  if (marker_publisher_.getNumSubscribers() > 0) {
    publish_shared(io_, marker_publisher_, ray_markers(*assessment, *visibility, stamp, frames_.odom));
  }
  if (sky_publisher_.getNumSubscribers() > 0) {
    const auto skyline = assessment->has_map ? pipeline.skyline_at(assessment->antenna) : std::vector<double>();
    publish_shared(io_, sky_publisher_, sky_plot(*visibility, skyline, parameters_.sky_plot_size));
  }
}

void OcclusionNode::publish_map() {
  const VoxelMap& map = queue_->pipeline().local_map().map();
  if (map_publisher_.getNumSubscribers() == 0 || map.size() == 0) return;
  // Stamped with the newest fix: the present time of the system may be another one than the messages'.
  publish_shared(io_, map_publisher_, to_message(map.points(), to_ros(queue_->newest_fix()), frames_.odom));
}

void OcclusionNode::clear_map(std_srvs::Trigger::Response& response) {
  queue_->clear_map();
  response.success = 1;
  response.message = !has_prior_map_ ? "the map is empty" : "the map is empty but for the prior map";
}

void OcclusionNode::save_map(const urban_gnss_localization::SaveMap::Request& request,
                             urban_gnss_localization::SaveMap::Response& response) {
  const PointCloud points = queue_->pipeline().local_map().map().points();
  response.points = points.size();
  try {
    if (points.empty()) throw std::runtime_error("the map is empty");
    save_map_file(request.file, points, request.overwrite);
    response.success = 1;
  } catch (const std::exception& error) {
    response.success = 0;
    response.message = log_line(error.what());
  }
}

void OcclusionNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using diagnostic_msgs::DiagnosticStatus;
  const VoxelMap& map = queue_->pipeline().local_map().map();
  const OcclusionTally& tally = queue_->tally();
  const std::string& fault = transforms_.fault();
  std::string summary = "waiting for fixes";
  if (tally.fixes_weighed > 0) {
    summary = queue_->doubt().empty() ? "" : queue_->doubt() + "; ";
    if (!queue_->missing().empty()) summary += "without " + queue_->missing() + ", ";
    summary += std::string("weighing by ") + to_string(queue_->source());
  }
  const bool is_well = tally.fixes_weighed > 0 && queue_->missing().empty() && queue_->doubt().empty();
  status.summary(is_well ? DiagnosticStatus::OK : DiagnosticStatus::WARN, summary);
  status.add("model", enum_name(queue_->pipeline().parameters().covariance.model));
  status.add("fixes", tally.fixes_weighed);
  status.add("clouds received", tally.clouds);
  status.add("clouds in the map", tally.clouds_in_map);
  status.add("clouds dropped", tally.all_clouds_left_out());
  status.add("alignments accepted", tally.alignments_accepted);
  status.add("alignments tried", tally.alignments_tried);
  status.add("last alignment", tally.last_alignment);
  status.add("tf", fault.empty() ? "no fault" : log_line(fault));
  status.add("voxels", map.size());
  status.add("map memory (MB)", 1e-6 * static_cast<double>(map.memory_bytes()));
  io_.diagnose(status);
}

}  // namespace urban_gnss
