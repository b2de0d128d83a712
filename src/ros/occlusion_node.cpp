#include "urban_gnss_localization/ros/occlusion_node.hpp"

#include <boost/make_shared.hpp>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "urban_gnss_localization/ros/node_parameters.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace urban_gnss {
namespace {

Eigen::Isometry3d to_isometry(const geometry_msgs::Transform& transform) {
  const auto& r = transform.rotation;
  Eigen::Isometry3d isometry = Eigen::Isometry3d::Identity();
  isometry.translate(Eigen::Vector3d(transform.translation.x, transform.translation.y, transform.translation.z));
  isometry.rotate(Eigen::Quaterniond(r.w, r.x, r.y, r.z));
  return isometry;
}

/// As a shared pointer, which reaches subscribers in the same process without a copy.
template <class Message>
void publish_shared(const ros::Publisher& publisher, Message message) {
  publisher.publish(boost::make_shared<const Message>(std::move(message)));
}

}  // namespace

OcclusionNode::OcclusionNode(ros::NodeHandle& node, ros::NodeHandle& private_node)
    : tf_listener_(tf_buffer_, node), fix_stamps_(1.0), diagnostics_(node, private_node, private_node.getNamespace()) {
  OcclusionNodeSettings settings;
  read_private_parameters(private_node, settings);
  frames_ = settings.frames;
  parameters_ = settings.node;
  if (!parameters_.prior_map.empty()) prior_ = read_pcd(parameters_.prior_map);
  pipeline_ = std::make_unique<OcclusionPipeline>(settings.pipeline);
  fix_stamps_ = StampMonitor(parameters_.time_jump);
  antenna_known_ = settings.pipeline.occlusion.antenna_offset != std::vector<double>{0.0, 0.0, 0.0};

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

/// Nothing where tf does not know it (yet). Never waits.
std::optional<geometry_msgs::TransformStamped> OcclusionNode::look_up(const std::string& to, const std::string& from,
                                                                      const ros::Time& time) {
  try {
    return tf_buffer_.lookupTransform(to, from, time);
  } catch (const tf2::TransformException& error) {
    tf_fault_ = error.what();
    return std::nullopt;
  }
}

std::optional<Eigen::Isometry3d> OcclusionNode::transform(const std::string& to, const std::string& from,
                                                          const ros::Time& time) {
  const auto found = look_up(to, from, time);
  return found ? std::optional<Eigen::Isometry3d>(to_isometry(found->transform)) : std::nullopt;
}

/// Only queues the cloud, for the timer or the next fix: who works here leaves the next clouds to ROS's own queue,
/// which drops them without a word.
void OcclusionNode::on_cloud(const sensor_msgs::PointCloud2ConstPtr& message) {
  clouds_.push_back(message);
  ++clouds_received_;
  while (clouds_.size() > static_cast<std::size_t>(parameters_.cloud_queue)) {
    clouds_.pop_front();
    ++clouds_dropped_;
    ROS_WARN_STREAM_THROTTLE(5.0, clouds_dropped_ << " of " << clouds_received_
                                                  << " clouds dropped: they come faster than they go into the map, "
                                                     "or tf does not follow: "
                                                  << (tf_fault_.empty() ? "no fault of tf" : tf_fault_));
  }
}

void OcclusionNode::on_satellites(const urban_gnss_localization::SatelliteArray& message) {
  pipeline_->set_satellites(to_stamp(message.header.stamp), to_observations(message), message.angle_resolution);
}

/// How well the localizer knows the heading; the heading itself comes from tf, which has it at every stamp.
void OcclusionNode::on_estimate(const nav_msgs::Odometry& message) {
  const double variance = message.pose.covariance[35];
  yaw_sigma_ = std::sqrt(variance);  // of a negative one not a number
}

void OcclusionNode::on_fix(const sensor_msgs::NavSatFixConstPtr& message) {
  fix_watch_.observe_frame(message->header.frame_id);
  const bool is_newer = fix_stamps_.accept(to_stamp(message->header.stamp), [this](Stamp back) {
    ROS_WARN_STREAM("the clock was set back by " << to_seconds(back) << " s: started anew");
    start_anew();
    return true;
  });
  if (!is_newer) {
    ROS_WARN_STREAM_THROTTLE(5.0, "a fix is not newer than the one before it; left out");
    return;
  }
  fixes_.push_back(message);
  newest_ = std::max(newest_, message->header.stamp);
  forget_former_clock();
  work();
}

void OcclusionNode::start_anew() {
  former_newest_ = newest_;
  pipeline_->reset();
  prior_is_in_ = false;
  clouds_.clear();
  fixes_.clear();
  tf_buffer_.clear();
  newest_ = ros::Time();
  yaw_sigma_ = 0.0;
}

/// A transform from before the clock was set back may come after tf_buffer_ was cleared, by another connection or tf's
/// own thread. tf ignores all that is older than it: then the buffer is cleared again.
void OcclusionNode::forget_former_clock() {
  if (former_newest_ <= newest_) return;  // none, or caught up with
  const ros::Time midway = newest_ + (former_newest_ - newest_) * 0.5;
  for (const auto& [to, from] : {std::pair(frames_.odom, frames_.base_link), std::pair(frames_.map, frames_.odom)}) {
    const auto latest = look_up(to, from, ros::Time(0));
    if (latest && latest->header.stamp > midway) tf_buffer_.clear();
  }
}

/// Whether what has this stamp need not wait for its transform any longer. By stamps, so that a bag that is played
/// fast or slowly gives the same.
bool OcclusionNode::is_overdue(const ros::Time& stamp) const {
  return newest_ > stamp + ros::Duration(parameters_.tf_timeout);
}

void OcclusionNode::work() {
  update_alignment();
  if (!clouds_.empty() && insert(*clouds_.front())) clouds_.pop_front();  // one, then what has come meanwhile
  while (!fixes_.empty() && assess(fixes_.front())) fixes_.pop_front();
}

void OcclusionNode::update_alignment() {
  const auto found = look_up(frames_.map, frames_.odom, ros::Time(0));
  if (!found) return;
  const Eigen::Isometry3d odom_in_map = to_isometry(found->transform);
  WorldAlignment alignment;
  const Eigen::Vector3d x = odom_in_map.linear().col(0);
  alignment.odom_in_world = {odom_in_map.translation().x(), odom_in_map.translation().y(), std::atan2(x.y(), x.x())};
  alignment.yaw_sigma_rad = yaw_sigma_;
  // A static transform has no stamp: it always holds.
  alignment.stamp = to_stamp(found->header.stamp.isZero() ? newest_ : found->header.stamp);
  pipeline_->set_alignment(alignment);
  if (!prior_.empty() && !prior_is_in_) {
    prior_is_in_ = true;
    pipeline_->add_prior(prior_, alignment.odom_in_world);
  }
}

/// Whether the cloud is settled: in the map, or to be forgotten.
bool OcclusionNode::insert(const sensor_msgs::PointCloud2& message) {
  const auto base = transform(frames_.odom, frames_.base_link, message.header.stamp);
  const auto sensor = transform(frames_.base_link, message.header.frame_id, message.header.stamp);
  if (!base || !sensor) {
    if (!is_overdue(message.header.stamp)) return false;
    ++clouds_dropped_;
    ROS_WARN_STREAM_THROTTLE(5.0, "cloud left out, no transform at its stamp: " << tf_fault_);
    return true;
  }
  try {
    const CloudOutcome outcome =
        pipeline_->add_cloud(to_stamp(message.header.stamp), to_point_cloud(message), *sensor, *base);
    report(outcome);
  } catch (const std::invalid_argument& error) {
    ++clouds_dropped_;
    ROS_WARN_STREAM_THROTTLE(5.0, topics::kPoints << " left out: " << error.what());
  }
  return true;
}

void OcclusionNode::report(const CloudOutcome& outcome) {
  if (outcome.decision != CloudDecision::kInserted) {
    ++clouds_dropped_;
    ROS_WARN_STREAM_THROTTLE(5.0, "cloud left out: " << to_string(outcome.decision));
    return;
  }
  ++clouds_inserted_;
  if (outcome.scan.insertion.dropped_by_limit > 0) {
    ROS_WARN_STREAM_THROTTLE(10.0, "max_voxels is too small for the window: " << outcome.scan.insertion.dropped_by_limit
                                                                              << " voxels dropped");
  }
  const Alignment& alignment = outcome.scan.alignment;
  if (!outcome.scan.is_keyframe || alignment.decision == AlignmentDecision::kNotTried) return;
  ++alignments_tried_;
  last_alignment_ = enum_name(alignment.decision);
  if (alignment.is_accepted()) {
    ++alignments_accepted_;
  } else {
    ROS_INFO_STREAM_THROTTLE(10.0, "scan not aligned, odometry used: " << alignment.reason);
  }
}

/// Whether the fix is settled and published.
bool OcclusionNode::assess(const sensor_msgs::NavSatFixConstPtr& pointer) {
  const sensor_msgs::NavSatFix& message = *pointer;
  const ros::Time stamp = message.header.stamp;
  const bool has_position = message.status.status >= sensor_msgs::NavSatStatus::STATUS_FIX &&
                            std::isfinite(message.latitude) && std::isfinite(message.longitude);
  if (!has_position) {  // nothing to weigh; who listens shall see what the receiver says
    fix_publisher_.publish(pointer);
    return true;
  }
  const auto base = transform(frames_.odom, frames_.base_link, stamp);
  if (!base && !is_overdue(stamp) && tf_is_there()) return false;
  // A fix waits for its satellites, which may come after it; until the next fix at the most.
  if (newest_ <= stamp && pipeline_->awaits_satellites(to_stamp(stamp))) return false;
  if (!antenna_known_) place_antenna(message);
  const FixAssessment assessment = pipeline_->assess(to_stamp(stamp), claimed_covariance(message), base);
  missing_ = assessment.missing;
  doubt_ = assessment.doubt;
  source_ = assessment.covariance.source;
  ++fixes_assessed_;
  if (!assessment.missing.empty()) {
    ROS_WARN_STREAM_THROTTLE(
        10.0, "without " << assessment.missing << ": weighed by " << to_string(assessment.covariance.source));
  }
  if (!doubt_.empty()) ROS_WARN_STREAM_THROTTLE(10.0, doubt_);
  publish(message, assessment);
  return true;
}

void OcclusionNode::publish(const sensor_msgs::NavSatFix& message, const FixAssessment& assessment) {
  const ros::Time stamp = message.header.stamp;
  publish_shared(fix_publisher_, weighted_fix(message, assessment.covariance));
  const auto visibility = boost::make_shared<const urban_gnss_localization::Visibility>(
      to_message(assessment, claimed_covariance(message), pipeline_->parameters().covariance, stamp, frames_.odom));
  visibility_publisher_.publish(visibility);
  if (marker_publisher_.getNumSubscribers() > 0) {
    publish_shared(marker_publisher_, ray_markers(assessment, *visibility, stamp, frames_.odom));
  }
  if (sky_publisher_.getNumSubscribers() > 0) {
    const auto skyline = assessment.has_map ? pipeline_->skyline_at(assessment.antenna) : std::vector<double>();
    publish_shared(sky_publisher_, sky_plot(*visibility, skyline, parameters_.sky_plot_size));
  }
}

bool OcclusionNode::tf_is_there() const {
  return tf_buffer_.canTransform(frames_.odom, frames_.base_link, ros::Time(0));
}

/// From tf, once it is there; until then the antenna stays in base_link's place.
void OcclusionNode::place_antenna(const sensor_msgs::NavSatFix& message) {
  const std::string& frame = message.header.frame_id;
  if (const auto antenna = transform(frames_.base_link, frame, message.header.stamp)) {
    const Eigen::Vector3d place = antenna->translation();
    pipeline_->set_antenna(place);
    antenna_known_ = true;
    ROS_INFO_STREAM("antenna at " << place.transpose() << " m in " << frames_.base_link);
    return;
  }
  ROS_WARN_STREAM_THROTTLE(10.0, "no transform from '" << frame << "': the antenna is taken to be in the place of "
                                                       << frames_.base_link << "; antenna_offset tells otherwise");
}

void OcclusionNode::publish_map() {
  if (map_publisher_.getNumSubscribers() == 0 || pipeline_->local_map().map().size() == 0) return;
  // Stamped with the newest fix: the present time of the system may be another one than the messages'.
  publish_shared(map_publisher_, to_message(pipeline_->local_map().map().points(), newest_, frames_.odom));
}

bool OcclusionNode::clear_map(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  pipeline_->clear_map();
  prior_is_in_ = false;
  response.success = 1;
  response.message = prior_.empty() ? "the map is empty" : "the map is empty but for the prior map";
  return true;
}

bool OcclusionNode::save_map(urban_gnss_localization::SaveMap::Request& request,
                             urban_gnss_localization::SaveMap::Response& response) {
  const PointCloud points = pipeline_->local_map().map().points();
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
  const VoxelMap& map = pipeline_->local_map().map();
  std::string summary = "waiting for fixes";
  if (fixes_assessed_ > 0) {
    summary = doubt_.empty() ? "" : doubt_ + "; ";
    if (!missing_.empty()) summary += "without " + missing_ + ", ";
    summary += std::string("weighing by ") + to_string(source_);
  }
  const bool is_well = fixes_assessed_ > 0 && missing_.empty() && doubt_.empty();
  status.summary(is_well ? DiagnosticStatus::OK : DiagnosticStatus::WARN, summary);
  status.add("model", enum_name(pipeline_->parameters().covariance.model));
  status.add("fixes", fixes_assessed_);
  status.add("clouds received", clouds_received_);
  status.add("clouds in the map", clouds_inserted_);
  status.add("clouds dropped", clouds_dropped_);
  status.add("alignments accepted", alignments_accepted_);
  status.add("alignments tried", alignments_tried_);
  status.add("last alignment", last_alignment_);
  status.add("tf", tf_fault_.empty() ? "no fault" : tf_fault_);
  status.add("voxels", map.size());
  status.add("map memory (MB)", 1e-6 * static_cast<double>(map.memory_bytes()));
}

}  // namespace urban_gnss
