#include "urban_gnss_localization/pipeline/occlusion_queue.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "urban_gnss_localization/geometry/isometry.hpp"

namespace urban_gnss {

using Level = PipelineEvent::Level;

namespace {

constexpr Stamp kSilence = std::chrono::seconds(10);
/// Between two questions how the IMU is mounted.
constexpr Stamp kMountingInterval = std::chrono::seconds(1);

}  // namespace

std::size_t OcclusionTally::all_clouds_left_out() const {
  std::size_t sum = 0;
  for (const auto& [reason, count] : clouds_left_out) sum += count;
  return sum;
}

OcclusionQueue::OcclusionQueue(const OcclusionPipelineParameters& pipeline, const OcclusionQueueParameters& parameters,
                               OcclusionFrames frames, FrameSource& transforms)
    : parameters_(parameters),
      frames_(std::move(frames)),
      transforms_(transforms),
      pipeline_(pipeline),
      antenna_known_(pipeline.occlusion.antenna_offset != std::vector<double>{0.0, 0.0, 0.0}),
      fix_stamps_(parameters.time_jump),
      cloud_stamps_(parameters.time_jump) {}

void OcclusionQueue::add_cloud(QueuedCloud cloud) {
  ++tally_.clouds;
  if (cloud.stamp == Stamp(0)) {
    leave_out(cloud, "header.stamp is 0", "its driver must set it");
    return;
  }
  const auto last = cloud_stamps_.last();
  if (cloud_stamps_.judge(cloud.stamp) == StampVerdict::kOdd) {
    leave_out(cloud, "its stamp is odd", describe_oddness(cloud.stamp, *last));
    return;
  }
  clouds_.push_back(std::move(cloud));
  while (clouds_.size() > static_cast<std::size_t>(parameters_.cloud_queue)) {
    const QueuedCloud oldest = std::move(clouds_.front());
    clouds_.pop_front();
    ++tally_.clouds_left_out["too many wait"];
    std::ostringstream text;
    text << tally_.all_clouds_left_out() << " of " << tally_.clouds
         << " clouds dropped: they come faster than they go into the map, or tf does not follow: "
         << (transforms_.fault().empty() ? "no fault of tf" : transforms_.fault());
    say(Level::kWarn, "queue", oldest.stamp, text.str());
  }
}

void OcclusionQueue::add_satellites(const SatelliteEpoch& epoch) {
  pipeline_.set_satellites(epoch.stamp, epoch.satellites, epoch.angle_resolution_rad);
}

void OcclusionQueue::add_imu(const ImuSample& sample, const std::string& frame) {
  const bool is_told = imu_mounting_known_ || frame.empty() || frame == frames_.base_link;
  if (!is_told && sample.stamp >= next_mounting_) {
    next_mounting_ = sample.stamp + kMountingInterval;
    if (const auto mounting = transforms_.newest(frames_.base_link, frame)) {
      pipeline_.set_imu_mounting(Eigen::Quaterniond(mounting->pose.linear()));
      imu_mounting_known_ = true;
    }
  }
  pipeline_.add_imu(sample);
}

void OcclusionQueue::add_fix(QueuedFix fix) {
  const auto last = fix_stamps_.last();
  const auto base = transforms_.newest(frames_.odom, frames_.base_link);  // its stamp is the odometry's time
  const bool has_time = base && base->stamp != Stamp(0);
  const StampVerdict verdict =
      fix_stamps_.judge(fix.stamp, has_time ? std::optional<Stamp>(base->stamp) : std::nullopt);
  if (verdict == StampVerdict::kNotNewer) {
    ++tally_.fixes_left_out;
    say(Level::kWarn, "order", fix.stamp, "a fix is not newer than the one before it; left out");
    return;
  }
  if (verdict == StampVerdict::kOdd) {
    say(Level::kWarn, "odd", *last, "fix held back: " + describe_oddness(fix.stamp, *last));
    if (fix_stamps_.run() == 1) tally_.fixes_left_out += std::exchange(odd_fixes_, {}).size();
    odd_fixes_.push_back(std::move(fix));
    return;
  }
  std::vector<QueuedFix> held = std::exchange(odd_fixes_, {});
  if (verdict == StampVerdict::kWentBack) {
    std::ostringstream text;
    text << "the clock was set back by " << to_seconds(*last - fix.stamp) << " s: started anew";
    say(Level::kWarn, "clock", fix.stamp, text.str());
    start_anew();
  }
  // Those that the stream goes on from, or that it has come up to, were not odd.
  for (QueuedFix& each : held) {
    const bool belongs = each.stamp < fix.stamp && (verdict == StampVerdict::kWentBack || each.stamp > *last);
    if (belongs) keep(std::move(each));
    if (!belongs) ++tally_.fixes_left_out;
  }
  keep(std::move(fix));
  forget_former_clock();
}

void OcclusionQueue::keep(QueuedFix fix) {
  newest_ = std::max(newest_, fix.stamp);
  fixes_.push_back(std::move(fix));
}

void OcclusionQueue::set_yaw_variance(double variance) {
  yaw_sigma_ = std::sqrt(variance);  // of a negative one not a number
}

bool OcclusionQueue::work() {
  update_alignment();
  const bool has_settled = !clouds_.empty() && insert(clouds_.front());
  if (has_settled) clouds_.pop_front();
  settle_fixes();
  return has_settled;
}

void OcclusionQueue::settle_fixes() {
  if (fixes_.empty()) return;
  update_alignment();
  while (!fixes_.empty() && assess(fixes_.front())) fixes_.pop_front();
}

void OcclusionQueue::finish() {
  is_finished_ = true;
  while (work()) {
  }
}

void OcclusionQueue::clear_map() {
  pipeline_.clear_map();
  prior_is_in_ = false;
}

void OcclusionQueue::start_anew() {
  former_newest_ = newest_;
  pipeline_.reset();
  prior_is_in_ = false;
  clouds_.clear();
  cloud_stamps_.reset();
  fixes_.clear();
  transforms_.forget();
  newest_ = next_mounting_ = Stamp(0);
  yaw_sigma_ = 0.0;
}

/// A transform from before the clock was set back may come after the others were forgotten, by another connection or
/// tf's own thread. tf ignores all that is older than it: then they are forgotten again.
void OcclusionQueue::forget_former_clock() {
  if (former_newest_ <= newest_) return;  // none, or caught up with
  const Stamp midway = newest_ + (former_newest_ - newest_) / 2;
  for (const auto& [parent, child] :
       {std::pair(frames_.odom, frames_.base_link), std::pair(frames_.map, frames_.odom)}) {
    const auto newest = transforms_.newest(parent, child);
    if (newest && newest->stamp > midway) transforms_.forget();
  }
}

/// Whether what has this stamp need not wait for its transform any longer. By stamps, so that a bag that is played
/// fast or slowly gives the same.
bool OcclusionQueue::is_overdue(Stamp stamp) const {
  return is_finished_ || newest_ > stamp + from_seconds(parameters_.tf_timeout);
}

void OcclusionQueue::update_alignment() {
  const auto found = transforms_.newest(frames_.map, frames_.odom);
  if (!found) return;
  WorldAlignment alignment;
  alignment.odom_in_world = {found->pose.translation().x(), found->pose.translation().y(), yaw_of(found->pose)};
  alignment.yaw_sigma_rad = yaw_sigma_;
  alignment.stamp = found->stamp == Stamp(0) ? newest_ : found->stamp;
  pipeline_.set_alignment(alignment);
  if (!prior_.empty() && !prior_is_in_) {
    prior_is_in_ = true;
    pipeline_.add_prior(prior_, alignment.odom_in_world);
  }
}

/// Whether the cloud is settled: in the map, or left out.
bool OcclusionQueue::insert(const QueuedCloud& cloud) {
  const auto base = transforms_.find(frames_.odom, frames_.base_link, cloud.stamp);
  const auto sensor = transforms_.find(frames_.base_link, cloud.frame, cloud.stamp);
  if (!base || !sensor) {
    if (!is_overdue(cloud.stamp)) return false;
    leave_out(cloud, "no transform at its stamp", transforms_.fault());
    return true;
  }
  try {
    const CloudOutcome outcome = pipeline_.add_cloud(cloud.stamp, cloud.read(), *sensor, *base);
    note_alignment(cloud, outcome.scan);
    if (outcome.decision == CloudDecision::kInserted) {
      note(cloud, outcome.scan);
    } else {
      leave_out(cloud, to_string(outcome.decision), "");
    }
  } catch (const std::invalid_argument& error) {
    leave_out(cloud, error.what(), "");
  }
  return true;
}

void OcclusionQueue::leave_out(const QueuedCloud& cloud, const std::string& reason, const std::string& detail) {
  ++tally_.clouds_left_out[reason];
  say(Level::kWarn, "cloud", cloud.stamp, "cloud left out, " + reason + (detail.empty() ? "" : ": " + detail));
}

void OcclusionQueue::note(const QueuedCloud& cloud, const ScanReport& scan) {
  ++tally_.clouds_in_map;
  if (scan.insertion.dropped_by_limit > 0) {
    say(Level::kWarn, "limit", cloud.stamp,
        "max_voxels is too small for the window: " + std::to_string(scan.insertion.dropped_by_limit) +
            " voxels dropped");
  }
}

void OcclusionQueue::note_alignment(const QueuedCloud& cloud, const ScanReport& scan) {
  const Alignment& alignment = scan.alignment;
  if (!scan.is_keyframe || alignment.decision == AlignmentDecision::kNotTried) return;
  ++tally_.alignments_tried;
  tally_.last_alignment = enum_name(alignment.decision);
  if (alignment.is_accepted()) {
    ++tally_.alignments_accepted;
  } else {
    say(Level::kInfo, "alignment", cloud.stamp, "scan not aligned: " + alignment.reason);
  }
}

/// Whether the fix is settled.
bool OcclusionQueue::assess(const QueuedFix& fix) {
  if (!fix.has_position) {
    ++tally_.fixes_without_position;
    fix.settle(nullptr);
    return true;
  }
  const auto base = transforms_.find(frames_.odom, frames_.base_link, fix.stamp);
  if (!base && !is_overdue(fix.stamp) && transforms_.newest(frames_.odom, frames_.base_link)) return false;
  // A fix waits for its satellites, which may come after it; until the next fix at the most.
  if (!is_finished_ && newest_ <= fix.stamp && pipeline_.awaits_satellites(fix.stamp)) return false;
  if (!antenna_known_) place_antenna(fix);
  const FixAssessment assessment = pipeline_.assess(fix.stamp, fix.claimed, base);
  for (PipelineEvent& event : pipeline_.take_events()) events_.push_back(std::move(event));
  missing_ = assessment.missing;
  doubt_ = assessment.doubt;
  source_ = assessment.covariance.source;
  ++tally_.fixes_weighed;
  if (!missing_.empty()) {
    ++tally_.fixes_without[missing_];
    say(Level::kWarn, missing_, fix.stamp, "without " + missing_ + ": weighed by " + to_string(source_));
  }
  if (!doubt_.empty()) say(Level::kWarn, "doubt", fix.stamp, doubt_);
  fix.settle(&assessment);
  return true;
}

/// From the transforms, once they are there; until then the antenna stays in base_link's place.
void OcclusionQueue::place_antenna(const QueuedFix& fix) {
  std::ostringstream text;
  if (const auto antenna = transforms_.find(frames_.base_link, fix.frame, fix.stamp)) {
    const Eigen::Vector3d place = antenna->translation();
    pipeline_.set_antenna(place);
    antenna_known_ = true;
    text << "antenna at " << place.transpose() << " m in " << frames_.base_link;
    say(Level::kInfo, "antenna", fix.stamp, text.str());
    return;
  }
  text << "no transform from '" << fix.frame << "': the antenna is taken to be in the place of " << frames_.base_link
       << "; antenna_offset tells otherwise";
  say(Level::kWarn, "no antenna", fix.stamp, text.str());
}

void OcclusionQueue::say(Level level, const std::string& kind, Stamp stamp, const std::string& text) {
  const auto said = said_.find(kind);
  if (said != said_.end() && stamp < said->second + kSilence && stamp > said->second - kSilence) return;
  said_[kind] = stamp;
  events_.push_back({level, text});
}

}  // namespace urban_gnss
