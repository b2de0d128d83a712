#include "occlusion_stage.hpp"

#include <boost/make_shared.hpp>

#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/visibility_messages.hpp"

namespace urban_gnss {
namespace {

/// A covariance that is larger by rounding alone is not widened.
constexpr double kWidened = 1.001;

const char* name_of(std::uint8_t visibility) {
  using urban_gnss_localization::SatelliteVisibility;
  switch (visibility) {
    case SatelliteVisibility::FREE: return "free";
    case SatelliteVisibility::BLOCKED: return "blocked";
    case SatelliteVisibility::UNKNOWN: return "unknown";
    default: return "not_used";
  }
}

}  // namespace

OcclusionStage::OcclusionStage(const OcclusionNodeSettings& settings, bool odometry_is_tf)
    : frames_(settings.frames),
      odometry_is_tf_(odometry_is_tf),
      transforms_(tf_),
      queue_(settings.pipeline, settings.node.queue, to_occlusion_frames(frames_), transforms_) {
  if (!settings.node.prior_map.empty()) queue_.set_prior_map(read_pcd(settings.node.prior_map));
}

/// But for map -> odom: in a recording that is of another localizer.
void OcclusionStage::add_tf(const tf2_msgs::TFMessage& message, bool is_static) {
  for (geometry_msgs::TransformStamped transform : message.transforms) {
    transform.header.frame_id = without_leading_slash(transform.header.frame_id);
    transform.child_frame_id = without_leading_slash(transform.child_frame_id);
    if (transform.child_frame_id != frames_.odom) tf_.setTransform(transform, "bag", is_static);
  }
  work();
}

void OcclusionStage::add_odometry(const nav_msgs::Odometry& message) {
  if (!odometry_is_tf_) return;
  geometry_msgs::TransformStamped transform;
  transform.header.stamp = message.header.stamp;
  transform.header.frame_id = frames_.odom;
  transform.child_frame_id = frames_.base_link;
  const auto& pose = message.pose.pose;
  transform.transform.translation.x = pose.position.x;
  transform.transform.translation.y = pose.position.y;
  transform.transform.translation.z = pose.position.z;
  transform.transform.rotation = pose.orientation;
  tf_.setTransform(transform, "odometry");
  work();
}

void OcclusionStage::add_cloud(const sensor_msgs::PointCloud2ConstPtr& message) {
  queue_.add_cloud(to_queued_cloud(message));
  work();
}

void OcclusionStage::add_satellites(const SatelliteEpoch& epoch) {
  queue_.add_satellites(epoch);
  work();
}

void OcclusionStage::add_fix(const sensor_msgs::NavSatFix& message) {
  const auto shared = boost::make_shared<const sensor_msgs::NavSatFix>(message);
  queue_.add_fix(
      to_queued_fix(shared, [this, shared](const FixAssessment* assessment) { settle(*shared, assessment); }));
  work();
}

void OcclusionStage::add_estimate(const LocalizationOutput& output,
                                  const geometry_msgs::TransformStamped& map_to_odom) {
  queue_.set_yaw_variance(output.estimate.covariance(2, 2));
  tf_.setTransform(map_to_odom, "replay");
}

void OcclusionStage::finish() { queue_.finish(); }

void OcclusionStage::work() {
  while (queue_.work()) {
  }
}

void OcclusionStage::settle(const sensor_msgs::NavSatFix& message, const FixAssessment* assessment) {
  if (assessment == nullptr) {
    settled_.push_back({fix_without_place(message), std::nullopt});
    return;
  }
  const auto claimed = claimed_covariance(message);
  const GnssCovariance& covariance = assessment->covariance;
  if (assessment->has_map) ++fixes_with_map_;
  if (claimed && covariance.weighted.trace() > kWidened * claimed->trace()) ++fixes_widened_;
  if (!covariance.is_good) ++fixes_bad_;
  if (!assessment->doubt.empty()) ++fixes_doubted_;
  const auto visibility =
      to_message(*assessment, claimed, queue_.pipeline().parameters().covariance, message.header.stamp, frames_.odom);
  for (const auto& satellite : visibility.satellites) {
    if (satellite.visibility != satellite.NOT_USED) ++satellites_[name_of(satellite.visibility)];
  }
  settled_.push_back({weighted_fix(message, covariance), visibility});
}

std::vector<PipelineEvent> OcclusionStage::take_events() { return queue_.take_events(); }

nlohmann::json OcclusionStage::report() const {
  const OcclusionTally& tally = queue_.tally();
  std::size_t judged = 0;
  for (const auto& [name, count] : satellites_) judged += count;
  nlohmann::json satellites = {{"judged", judged}};
  for (const char* name : {"free", "blocked", "unknown"}) {
    const auto found = satellites_.find(name);
    satellites[name] = found == satellites_.end() ? 0 : found->second;
  }
  return {{"model", enum_name(queue_.pipeline().parameters().covariance.model)},
          {"clouds",
           {{"received", tally.clouds},
            {"in_map", tally.clouds_in_map},
            {"left_out", nlohmann::json(tally.clouds_left_out)}}},
          {"alignments", {{"tried", tally.alignments_tried}, {"accepted", tally.alignments_accepted}}},
          {"fixes",
           {{"weighed", tally.fixes_weighed},
            {"with_map", fixes_with_map_},
            {"widened", fixes_widened_},
            {"bad", fixes_bad_},
            {"doubted", fixes_doubted_},
            {"without_position", tally.fixes_without_position},
            {"left_out", tally.fixes_left_out},
            {"missing", nlohmann::json(tally.fixes_without)}}},
          {"satellites", satellites}};
}

}  // namespace urban_gnss
