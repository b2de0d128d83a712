#include "urban_gnss_localization/pipeline/bias_pipeline.hpp"

#include <utility>

#include "limits.hpp"

namespace urban_gnss {

void BiasPipelineParameters::check(std::vector<std::string>& faults) const {
  if (antenna_offset.size() != 2) faults.push_back("antenna_offset: must be x and y (m)");
}

BiasPipeline::BiasPipeline(const BiasPipelineParameters& parameters)
    : parameters_(parameters),
      tracker_(parameters.bias),
      history_(kHistory_s),
      odometry_stamps_(parameters.time_jump),
      estimate_stamps_(parameters.time_jump),
      fix_stamps_(parameters.time_jump) {}

void BiasPipeline::reset(const std::string& why) {
  if (!why.empty()) events_.push_back({PipelineEvent::Level::kWarn, "reset: " + why});
  tracker_.reset();
  history_.clear();
  odometry_stamps_.reset();
  estimate_stamps_.reset();
  fix_stamps_.reset();
  poses_.clear();
  pending_.clear();
  last_fix_stamp_.reset();
}

void BiasPipeline::set_datum(const GeodeticPosition& datum) {
  if (frame_ && frame_->datum() == datum) return;
  LocalFrame frame(datum);  // throws before anything changes
  if (frame_) reset("the datum moved");
  frame_ = std::move(frame);
}

bool BiasPipeline::is_new(StampMonitor& monitor, Stamp stamp, const char* stream) {
  return monitor.accept(stamp, [&](Stamp) {
    if (parameters_.reset_on_time_jump) reset(std::string("the clock of the ") + stream + " jumped back");
    return parameters_.reset_on_time_jump;
  });
}

void BiasPipeline::add_odometry(const OdometrySample& sample) {
  if (!odometry_fault(sample).empty()) return;
  if (!is_new(odometry_stamps_, sample.stamp, "odometry")) return;
  if (!history_.empty() && to_seconds(sample.stamp - history_.latest()) > parameters_.odometry_gap) {
    // The localizer starts anew after such a gap, and what the fix is compared with is another estimate.
    history_.clear();
    tracker_.reset();
  }
  history_.add(sample.stamp, sample.twist);
  while (process_next_fix()) {
  }
}

void BiasPipeline::add_estimate(Stamp stamp, const Pose2& pose) {
  if (!is_finite(pose)) return;
  if (!is_new(estimate_stamps_, stamp, "estimate")) return;
  poses_.emplace_back(stamp, pose);
  while (poses_.size() > 2 && to_seconds(stamp - poses_.front().first) > kHistory_s) poses_.pop_front();
  while (process_next_fix()) {
  }
}

void BiasPipeline::add_fix(const RawFix& fix) {
  if (!frame_) return;
  // A receiver that does not know where it is may not know the time either.
  if (is_usable_position(fix)) is_new(fix_stamps_, fix.stamp, "fixes");  // validation judges the rest
  ValidatedFix sane = validate_fix(fix, *frame_, last_fix_stamp_, parameters_.fix);
  if (is_rejected(sane.verdict.decision)) {
    reject(sane.verdict);
    return;
  }
  last_fix_stamp_ = fix.stamp;
  if (pending_.size() >= kMaxWaitingFixes) pending_.pop_front();
  pending_.push_back(std::move(sane));
  while (process_next_fix()) {
  }
}

void BiasPipeline::reject(const FixVerdict& verdict) {
  BiasEstimate unchanged = tracker_.estimate();
  unchanged.stamp = verdict.stamp;
  unchanged.verdict = verdict;
  estimates_.push_back(std::move(unchanged));
}

std::optional<Pose2> BiasPipeline::pose_at(Stamp stamp) const {
  // The last estimate before the fix, carried on by odometry: an estimate after it may contain the fix already.
  for (auto it = poses_.rbegin(); it != poses_.rend(); ++it) {
    if (it->first == stamp) return it->second;
    if (it->first > stamp) continue;
    const auto motion = history_.motion_between(it->first, stamp);
    if (motion) return compose(it->second, *motion);
    return std::nullopt;
  }
  return std::nullopt;
}

bool BiasPipeline::process_next_fix() {
  if (pending_.empty() || poses_.empty()) return false;
  const ValidatedFix& next = pending_.front();
  const Stamp stamp = next.fix.stamp;
  const bool has_estimate = poses_.back().first >= stamp;
  const bool has_waited = !history_.empty() && to_seconds(history_.latest() - stamp) >= parameters_.estimate_timeout;
  if (!has_estimate && !has_waited) return false;
  if (const auto pose = pose_at(stamp)) {
    const Eigen::Vector2d offset(parameters_.antenna_offset[0], parameters_.antenna_offset[1]);
    estimates_.push_back(tracker_.process(next.fix, transform_point(*pose, offset), next.verdict));
  } else {
    // Without odometry between the estimate and the fix the wait may still be worth it.
    if (!has_waited && (history_.empty() || history_.latest() < stamp)) return false;
    FixVerdict verdict = next.verdict;
    verdict.decision = FixDecision::kNotExamined;
    verdict.reason = "no estimate at its stamp";
    reject(verdict);
  }
  pending_.pop_front();
  return true;
}

std::vector<BiasEstimate> BiasPipeline::take_estimates() { return std::exchange(estimates_, {}); }
std::vector<PipelineEvent> BiasPipeline::take_events() { return std::exchange(events_, {}); }

std::string BiasPipeline::waiting_for() const {
  if (!frame_) return "gps/datum";
  if (poses_.empty()) return "odometry/filtered";
  if (!last_fix_stamp_) return "a usable fix";
  return {};
}

}  // namespace urban_gnss
