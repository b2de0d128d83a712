#include "urban_gnss_localization/pipeline/bias_pipeline.hpp"

#include <utility>

#include "limits.hpp"

namespace urban_gnss {

BiasPipeline::BiasPipeline(const BiasPipelineParameters& parameters)
    : parameters_(parameters),
      antenna_(parameters.input.antenna()),
      tracker_(parameters.bias),
      clocks_(parameters.input.stamps,
              {[this](const std::string& why) { reset(why); }, [this](InputStream stream) { restart(stream); }}),
      history_(kHistory_s),
      fixes_(parameters.input.fix_validation) {}

void BiasPipeline::reset(const std::string& why) {
  if (!why.empty()) events_.push_back({PipelineEvent::Level::kWarn, "reset: " + why});
  tracker_.reset();
  odometry_.reset();
  history_.clear();
  poses_.clear();
  fixes_.reset();
}

void BiasPipeline::set_datum(const GeodeticPosition& datum) {
  if (frame_ && frame_->datum() == datum) return;
  LocalFrame frame(datum);  // throws before anything changes
  if (frame_) {
    reset("the datum moved");
    clocks_.reset();
  }
  frame_ = std::move(frame);
}

void BiasPipeline::restart(InputStream stream) {
  if (stream == InputStream::kFixes) fixes_.reset();
  if (stream == InputStream::kEstimates) poses_.clear();
}

void BiasPipeline::add_odometry(const OdometrySample& told) {
  if (!OdometrySource::fault_of(told).empty()) return;
  if (!clocks_.accept(
          InputStream::kOdometry, told.stamp, [this, told] { add_odometry(told); }, events_))
    return;
  std::vector<PipelineEvent> said_by_the_localizer;
  const OdometrySample sample = odometry_.resolve(told, said_by_the_localizer);
  const double odometry_gap = parameters_.input.stamps.odometry_gap;
  if (!history_.empty() && to_seconds(sample.stamp - history_.latest()) > odometry_gap) {
    // The localizer starts anew after such a gap, and what the fix is compared with is another estimate.
    history_.clear();
    tracker_.reset();
  }
  history_.add(sample.stamp, sample.twist);
  process_fixes();
}

void BiasPipeline::add_estimate(Stamp stamp, const Pose2& pose) {
  if (!is_finite(pose)) return;
  const auto again = [this, stamp, pose] { add_estimate(stamp, pose); };
  if (!clocks_.accept(InputStream::kEstimates, stamp, again, events_)) return;
  poses_.emplace_back(stamp, pose);
  while (poses_.size() > 2 && to_seconds(stamp - poses_.front().first) > kHistory_s) poses_.pop_front();
  process_fixes();
}

void BiasPipeline::add_fix(const RawFix& fix) {
  if (!frame_) return;
  // A receiver that does not know where it is may not know the time either. What is not new, the validation rejects.
  if (is_usable_position(fix) && fix.stamp != Stamp::zero()) {
    const auto again = [this, fix] { add_fix(fix); };
    const auto refuse = [this, fix](const std::string& why) { refuse_fix(fix.stamp, why); };
    if (clocks_.judge(InputStream::kFixes, fix.stamp, again, events_, refuse) == StampVerdict::kOdd) return;
  }
  if (const auto rejected = fixes_.add(fix)) pass_on(*rejected);
  for (const FixOutcome& rejected : fixes_.validate(*frame_)) pass_on(rejected);
  process_fixes();
}

void BiasPipeline::refuse_fix(Stamp stamp, const std::string& reason) {
  FixOutcome outcome;
  outcome.stamp = stamp;
  outcome.decision = FixDecision::kRejectedStale;
  outcome.reason = reason;
  pass_on(outcome);
}

void BiasPipeline::pass_on(const FixOutcome& outcome) {
  BiasEstimate unchanged = tracker_.estimate();
  unchanged.stamp = outcome.stamp;
  unchanged.outcome = outcome;
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

void BiasPipeline::process_fixes() {
  while (process_next_fix()) {
  }
}

bool BiasPipeline::process_next_fix() {
  const ValidatedFix* next = fixes_.next();
  if (next == nullptr || poses_.empty()) return false;
  const Stamp stamp = next->fix.stamp;
  const bool has_estimate = poses_.back().first >= stamp;
  const bool has_waited = !history_.empty() && to_seconds(history_.latest() - stamp) >= parameters_.estimate_timeout;
  if (!has_estimate && !has_waited) return false;
  const std::optional<Pose2> pose = pose_at(stamp);
  // Without odometry between the estimate and the fix the wait may still be worth it.
  if (!pose && !has_waited && (history_.empty() || history_.latest() < stamp)) return false;

  ValidatedFix fix = fixes_.pop();
  if (pose) {
    estimates_.push_back(tracker_.process(fix.fix, transform_point(*pose, antenna_), fix.outcome));
    return true;
  }
  fix.outcome.decision = FixDecision::kNotExamined;
  fix.outcome.reason = "no estimate at its stamp";
  pass_on(fix.outcome);
  return true;
}

std::vector<BiasEstimate> BiasPipeline::take_estimates() { return std::exchange(estimates_, {}); }
std::vector<PipelineEvent> BiasPipeline::take_events() { return std::exchange(events_, {}); }

std::string BiasPipeline::waiting_for() const {
  if (!frame_) return "gps/datum";
  if (poses_.empty()) return "odometry/filtered";
  if (!fixes_.last_stamp()) return "a usable fix";
  return {};
}

}  // namespace urban_gnss
