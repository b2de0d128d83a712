// How the pipeline comes to a datum and to a start, and how it notices that it is lost.

#include <Eigen/Dense>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "text.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"

namespace urban_gnss {
namespace {

constexpr double kFarSigmas = 3.0;
/// Fixes closer together than this share their error: for the start they count as one.
constexpr double kStartFixInterval_s = 1.0;

}  // namespace

void LocalizationPipeline::use_datum(const GeodeticPosition& datum, const std::string& source) {
  frame_.emplace(datum);
  std::ostringstream text;
  text.precision(10);
  text << "datum from " << source << ": latitude " << datum.latitude_deg << ", longitude " << datum.longitude_deg
       << ", altitude " << datum.altitude_m << " m";
  event(PipelineEvent::Level::kInfo, text.str());
  const std::deque<RawFix> waiting = std::exchange(before_datum_, {});
  for (const RawFix& fix : waiting) validate(fix);
  process_fixes();
}

void LocalizationPipeline::set_datum(const GeodeticPosition& datum) {
  LocalFrame checked(datum);  // throws before anything changes
  datum_was_set_ = true;
  if (frame_) {
    if (frame_->datum() == datum) return;
    frame_ = std::move(checked);
    reset("the datum was set to another place");
    return;
  }
  use_datum(datum, "request");
}

void LocalizationPipeline::set_pose(const PoseEstimate& pose) {
  if (!is_finite(pose.pose) || !pose.covariance.allFinite()) {
    throw std::invalid_argument("pose or covariance is not finite");
  }
  start_ = pose;
  if (frame_ && last_odometry_) start(pose, "a pose that was set");
}

void LocalizationPipeline::initialize_with(const PendingFix& pending) {
  decide_unexamined(pending, "used for the start");
  take_satellites_of(pending.fix.stamp);
  remember_for_start(pending);
  try_start(pending);
}

void LocalizationPipeline::remember_for_start(const PendingFix& pending) {
  if (last_start_fix_ && to_seconds(pending.fix.stamp - *last_start_fix_) < kStartFixInterval_s) return;
  last_start_fix_ = pending.fix.stamp;
  const Eigen::Vector2d offset = antenna_offset();
  const Pose2 antenna{offset.x(), offset.y(), 0.0};
  heading_initializer_.add(compose(*history_.pose_at(pending.fix.stamp), antenna), pending.fix);
}

bool LocalizationPipeline::try_start(const PendingFix& pending) {
  if (last_start_fix_ != pending.fix.stamp) return false;  // nothing new since the last try
  std::optional<PoseEstimate> found = heading_initializer_.estimate();
  std::string how = "fixes and motion";
  const bool is_without_heading = !found && !initialized_ && heading_initializer_.timed_out();
  if (is_without_heading) {
    found = heading_initializer_.without_heading();
    how = "fixes, heading unknown";
  }
  if (!found) return false;
  // The mean of the fixes is no better than their common error, which their scatter does not show.
  found->covariance.topLeftCorner<2, 2>() += pending.fix.covariance;
  const Eigen::Vector2d offset = antenna_offset();
  const Pose2 since = *history_.motion_between(pending.fix.stamp, history_.latest());
  found->pose = compose(compose(found->pose, inverse(Pose2{offset.x(), offset.y(), 0.0})), since);
  last_used_ = pending.fix.stamp;
  start(*found, how);
  heading_unknown_ = is_without_heading;
  return true;
}

bool LocalizationPipeline::start_with_heading(const PendingFix& pending) {
  if (!heading_unknown_) return false;
  if (!try_start(pending)) return false;
  decide_unexamined(pending, "used for a start with heading");
  return true;
}

bool LocalizationPipeline::restart_if_lost(const PendingFix& pending) {
  remember_for_start(pending);
  if (start_with_heading(pending)) return true;
  const Eigen::Vector2d predicted = *predicted_antenna(pending.fix.stamp);
  const double sigma = std::sqrt(pending.fix.covariance.trace());  // of the distance, as the receiver declares it
  if ((pending.fix.position - predicted).norm() <= parameters_.max_bias_radius + kFarSigmas * sigma) {
    far_since_.reset();
    lost_ = false;
    return false;
  }
  if (!far_since_) far_since_ = pending.fix.stamp;
  if (to_seconds(pending.fix.stamp - *far_since_) < parameters_.lost_timeout) return false;
  if (!lost_) {
    event(PipelineEvent::Level::kWarn,
          "lost: every fix of the last " + seconds_text(parameters_.lost_timeout) + " is farther than max_bias_radius");
  }
  lost_ = true;
  if (!try_start(pending)) return false;
  decide_unexamined(pending, "used for a new start");
  return true;
}

void LocalizationPipeline::start(const PoseEstimate& pose, const std::string& how) {
  localizer_->initialize(pose);
  initialized_ = true;
  lost_ = false;
  heading_unknown_ = false;
  far_since_.reset();
  start_.reset();
  last_radius_m_ = 0.0;
  std::ostringstream text;
  text.precision(4);
  text << "started from " << how << ": x " << pose.pose.x << " m, y " << pose.pose.y << " m, yaw " << pose.pose.yaw
       << " rad";
  event(PipelineEvent::Level::kInfo, text.str());
}

void LocalizationPipeline::forget_start() {
  heading_initializer_.reset();
  last_start_fix_.reset();
}

}  // namespace urban_gnss
