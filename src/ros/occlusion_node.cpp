#include "urban_gnss_localization/ros/occlusion_node.hpp"

#include <boost/make_shared.hpp>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/node_parameters.hpp"
#include "urban_gnss_localization/ros/receiver_messages.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace urban_gnss {
namespace {

/// As a shared pointer, which reaches subscribers in the same process without a copy.
template <class Message>
void publish_shared(const ros::Publisher& publisher, Message message) {
  publisher.publish(boost::make_shared<const Message>(std::move(message)));
}

}  // namespace

OcclusionNode::OcclusionNode(ros::NodeHandle& node, ros::NodeHandle& private_node)
    : tf_listener_(tf_buffer_, node),
      transforms_(tf_buffer_),
      diagnostics_(node, private_node, private_node.getNamespace()) {
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
  const auto no_delay = ros::TransportHints().tcpNoDelay();
  fix_subscriber_ = node.subscribe(topics::kFix, 100, &OcclusionNode::on_fix, this, no_delay);
  fix_watch_.set_subscriber(fix_subscriber_);
  satellites_subscriber_ = node.subscribe(topics::kSatellites, 100, &OcclusionNode::on_satellites, this, no_delay);
  // A longer queue than cloud_queue: what is dropped is dropped in on_cloud(), which counts it.
  cloud_subscriber_ = node.subscribe(topics::kPoints, 100, &OcclusionNode::on_cloud, this, no_delay);
  estimate_subscriber_ = node.subscribe(topics::kEstimate, 100, &OcclusionNode::on_estimate, this, no_delay);
  if (settings.pipeline.imu_orientation.imu_heading != ImuHeadingUse::kNone) {
    imu_subscriber_ = node.subscribe(topics::kImu, 1000, &OcclusionNode::on_imu, this, no_delay);
  }
  clear_service_ = private_node.advertiseService("clear_map", &OcclusionNode::clear_map, this);
  save_service_ = private_node.advertiseService("save_map", &OcclusionNode::save_map, this);

  diagnostics_.setHardwareID("none");
  diagnostics_.add("occlusion", this, &OcclusionNode::diagnose);
  work_timer_ = node.createWallTimer(ros::WallDuration(0.02), [this](const ros::WallTimerEvent&) { work(); });
  second_timer_ = node.createWallTimer(ros::WallDuration(1.0), [this](const ros::WallTimerEvent&) {
    fix_watch_.check_publishers();
    diagnostics_.update();
  });
  map_timer_ = node.createWallTimer(ros::WallDuration(parameters_.map_publish_period),
                                    [this](const ros::WallTimerEvent&) { publish_map(); });
}

OcclusionNode::~OcclusionNode() { fix_subscriber_.shutdown(); }  // fix_watch_ holds it too

/// Only queues the cloud, for the timer or the next fix: who works here leaves the next clouds to ROS's own queue,
/// which drops them without a word.
void OcclusionNode::on_cloud(const sensor_msgs::PointCloud2ConstPtr& message) {
  queue_->add_cloud(to_queued_cloud(message));
  log();
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
  work();
}

/// One cloud, then what has come meanwhile.
void OcclusionNode::work() {
  queue_->work();
  log();
}

void OcclusionNode::log() {
  for (const PipelineEvent& event : queue_->take_events()) {
    if (event.level == PipelineEvent::Level::kInfo) {
      ROS_INFO_STREAM(event.text);
    } else {
      ROS_WARN_STREAM(event.text);
    }
  }
}

/// `assessment`: null where there is nothing to weigh; who listens shall see what the receiver says.
void OcclusionNode::publish(const sensor_msgs::NavSatFixConstPtr& message, const FixAssessment* assessment) {
  if (assessment == nullptr) {
    fix_publisher_.publish(message);
    return;
  }
  const ros::Time stamp = message->header.stamp;
  const OcclusionPipeline& pipeline = queue_->pipeline();
  publish_shared(fix_publisher_, weighted_fix(*message, assessment->covariance));
  const auto visibility = boost::make_shared<const urban_gnss_localization::Visibility>(
      to_message(*assessment, claimed_covariance(*message), pipeline.parameters().covariance, stamp, frames_.odom));
  visibility_publisher_.publish(visibility);
  if (marker_publisher_.getNumSubscribers() > 0) {
    publish_shared(marker_publisher_, ray_markers(*assessment, *visibility, stamp, frames_.odom));
  }
  if (sky_publisher_.getNumSubscribers() > 0) {
    const auto skyline = assessment->has_map ? pipeline.skyline_at(assessment->antenna) : std::vector<double>();
    publish_shared(sky_publisher_, sky_plot(*visibility, skyline, parameters_.sky_plot_size));
  }
}

void OcclusionNode::publish_map() {
  const VoxelMap& map = queue_->pipeline().local_map().map();
  if (map_publisher_.getNumSubscribers() == 0 || map.size() == 0) return;
  // Stamped with the newest fix: the present time of the system may be another one than the messages'.
  publish_shared(map_publisher_, to_message(map.points(), to_ros(queue_->newest_fix()), frames_.odom));
}

bool OcclusionNode::clear_map(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  queue_->clear_map();
  response.success = 1;
  response.message = !has_prior_map_ ? "the map is empty" : "the map is empty but for the prior map";
  return true;
}

bool OcclusionNode::save_map(urban_gnss_localization::SaveMap::Request& request,
                             urban_gnss_localization::SaveMap::Response& response) {
  const PointCloud points = queue_->pipeline().local_map().map().points();
  response.points = points.size();
  try {
    if (points.empty()) throw std::runtime_error("the map is empty");
    write_pcd(request.file, points);
    response.success = 1;
  } catch (const std::exception& error) {
    response.success = 0;
    response.message = error.what();
  }
  return true;
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
  status.add("tf", fault.empty() ? "no fault" : fault);
  status.add("voxels", map.size());
  status.add("map memory (MB)", 1e-6 * static_cast<double>(map.memory_bytes()));
}

}  // namespace urban_gnss
