#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "limits.hpp"
#include "text.hpp"

namespace urban_gnss {

namespace {

bool is_same_epoch(Stamp a, Stamp b) { return std::abs(to_seconds(a - b)) <= kSameEpoch_s; }

}  // namespace

void LocalizationParameters::check(std::vector<std::string>& faults) const {
  if (!initial_pose.empty() && initial_pose.size() != 3) {
    faults.push_back("initial_pose: has " + std::to_string(initial_pose.size()) +
                     " numbers; must be x, y (m) and yaw (rad), or empty");
  }
  if (antenna_offset.size() != 2) faults.push_back("antenna_offset: must be x and y (m)");
}

Pose2 map_to_odometry(const LocalizationOutput& output) {
  return compose(output.estimate.pose, inverse(output.odometry_pose));
}

LocalizationPipeline::LocalizationPipeline(const LocalizationParameters& parameters,
                                           std::unique_ptr<Localizer> localizer)
    : parameters_(parameters),
      localizer_(std::move(localizer)),
      datum_initializer_(parameters.datum),
      heading_initializer_(parameters.heading),
      history_(kHistory_s),
      odometry_stamps_(parameters.time_jump),
      fix_stamps_(parameters.time_jump),
      imu_stamps_(parameters.time_jump),
      velocity_stamps_(parameters.time_jump) {
  reset({});
}

void LocalizationPipeline::reset(const std::string& why) {
  if (!why.empty()) event(PipelineEvent::Level::kWarn, "reset: " + why);
  datum_initializer_.reset();
  forget_start();
  history_.clear();
  ++epoch_;
  last_odometry_.reset();
  imu_yaw_rates_.clear();
  yaw_rate_check_.emplace();
  without_imu_s_ = 0.0;
  imu_is_silent_ = true;
  before_datum_.clear();
  pending_.clear();
  pending_velocities_.clear();
  last_fix_stamp_.reset();
  biases_.clear();
  satellites_.clear();
  fixes_have_satellites_ = false;
  last_taken_.reset();
  last_radius_m_ = 0.0;
  initialized_ = false;
  lost_ = false;
  heading_unknown_ = false;
  far_since_.reset();
  last_used_.reset();
  last_verdict_ = {};
  fixes_used_ = 0;
  fixes_rejected_ = 0;
  fixes_with_ranges_ = 0;
  velocities_used_ = 0;
  start_.reset();
  if (parameters_.initial_pose.size() == 3) {
    PoseEstimate start;
    start.pose = {parameters_.initial_pose[0], parameters_.initial_pose[1], wrap_angle(parameters_.initial_pose[2])};
    const double p2 = parameters_.initial_position_sigma * parameters_.initial_position_sigma;
    const double h2 = parameters_.initial_heading_sigma * parameters_.initial_heading_sigma;
    start.covariance = Eigen::Vector3d(p2, p2, h2).asDiagonal();
    start_ = start;
  }
  if (!datum_was_set_) {
    frame_.reset();
    if (const auto datum = datum_initializer_.fixed()) use_datum(*datum, "parameter");
  }
}

bool LocalizationPipeline::is_new(StampMonitor& monitor, Stamp stamp, const char* stream) {
  return monitor.accept(stamp, [&](Stamp back) {
    if (!parameters_.reset_on_time_jump) return false;
    reset(std::string("the clock of the ") + stream + " jumped back by " + seconds_text(to_seconds(back)));
    for (StampMonitor* each : {&odometry_stamps_, &fix_stamps_, &imu_stamps_, &velocity_stamps_}) each->reset();
    return true;
  });
}

void LocalizationPipeline::add_odometry(const OdometrySample& sample) {
  const std::string fault = odometry_fault(sample);
  if (!fault.empty()) {
    event(PipelineEvent::Level::kWarn, "odometry left out: " + fault);
    return;
  }
  if (!is_new(odometry_stamps_, sample.stamp, "odometry")) return;

  const double elapsed_s = last_odometry_ ? to_seconds(sample.stamp - last_odometry_->stamp) : 0.0;
  const Twist2 twist = with_imu(sample, last_odometry_ ? last_odometry_->stamp : sample.stamp);
  if (elapsed_s > parameters_.odometry_gap) {
    event(PipelineEvent::Level::kWarn, "no odometry for " + seconds_text(elapsed_s) +
                                           (initialized_ ? ": place unknown, starting anew from the fixes" : ""));
    history_.clear();
    ++epoch_;
    forget_start();
    lost_ = lost_ || initialized_;
    initialized_ = false;
  }
  history_.add(sample.stamp, twist);
  last_odometry_ = sample;
  last_odometry_->twist = twist;
  if (initialized_ && elapsed_s > 0.0) {
    localizer_->move(twist, elapsed_s);
    guard_against_non_finite();
  }
  if (!initialized_ && start_ && frame_) start(*start_, "the given pose");
  process_velocities();
  process_fixes();
  if (initialized_) outputs_.push_back({sample.stamp, localizer_->estimate(), sample.pose, twist});
}

void LocalizationPipeline::add_fix(const RawFix& fix) {
  if (last_odometry_ && to_seconds(fix.stamp - last_odometry_->stamp) > kMaxAhead_s) {
    FixVerdict verdict;
    verdict.stamp = fix.stamp;
    verdict.decision = FixDecision::kRejectedStale;
    verdict.reason = "more than " + seconds_text(kMaxAhead_s) + " ahead of the odometry";
    decide(std::move(verdict));
    return;
  }
  // A receiver that does not know where it is may not know the time either.
  if (is_usable_position(fix)) is_new(fix_stamps_, fix.stamp, "fixes");  // validation judges the rest
  if (!frame_) {
    before_datum_.push_back(fix);
    if (before_datum_.size() > kMaxWaitingFixes) before_datum_.pop_front();
    if (const auto datum = datum_initializer_.add(fix)) {
      use_datum(*datum, std::to_string(parameters_.datum.datum_fix_count) + " agreeing fixes");
    }
    return;
  }
  validate(fix);
  process_fixes();
}

void LocalizationPipeline::validate(const RawFix& fix) {
  ValidatedFix sane = validate_fix(fix, *frame_, last_fix_stamp_, parameters_.fix);
  if (is_rejected(sane.verdict.decision)) {
    decide(std::move(sane.verdict));
    return;
  }
  last_fix_stamp_ = fix.stamp;
  if (pending_.size() >= kMaxWaitingFixes) pending_.pop_front();
  pending_.push_back({sane.fix, std::move(sane.verdict)});
}

void LocalizationPipeline::add_bias(const BiasEstimate& bias) {
  biases_.push_back(bias);
  if (biases_.size() > kMaxWaitingFixes) biases_.pop_front();
  process_fixes();
}

void LocalizationPipeline::add_satellites(Stamp stamp, std::vector<SatelliteObservation> satellites) {
  if (!takes_satellites()) return;
  if (last_taken_ && is_same_epoch(stamp, *last_taken_)) fixes_have_satellites_ = true;  // they came late
  satellites_.emplace_back(stamp, std::move(satellites));
  if (satellites_.size() > kMaxWaitingSatellites) satellites_.pop_front();
  process_fixes();
}

const std::vector<SatelliteObservation>* LocalizationPipeline::satellites_of(Stamp stamp) const {
  // From the back: of two of one stamp, those that came last.
  const auto found = std::find_if(satellites_.rbegin(), satellites_.rend(),
                                  [&](const auto& epoch) { return is_same_epoch(epoch.first, stamp); });
  return found != satellites_.rend() ? &found->second : nullptr;
}

std::vector<SatelliteObservation> LocalizationPipeline::take_satellites_of(Stamp fix_stamp) {
  const auto* satellites = satellites_of(fix_stamp);
  fixes_have_satellites_ = satellites != nullptr;
  last_taken_ = fix_stamp;
  return satellites ? *satellites : std::vector<SatelliteObservation>{};
}

std::optional<BiasQuery> LocalizationPipeline::bias_query() const {
  if (!initialized_ || !localizer_->wants_bias() || pending_.empty() || history_.empty()) return std::nullopt;
  const PendingFix& next = pending_.front();
  const auto predicted = predicted_antenna(next.fix.stamp);
  if (!predicted) return std::nullopt;
  return BiasQuery{next.fix, next.validation, *predicted};
}

std::optional<Eigen::Vector2d> LocalizationPipeline::predicted_antenna(Stamp stamp) const {
  const auto motion = history_.motion_between(history_.latest(), stamp);
  if (!motion) return std::nullopt;
  return transform_point(compose(localizer_->pose(), *motion), antenna_offset());
}

Eigen::Vector2d LocalizationPipeline::antenna_offset() const {
  return {parameters_.antenna_offset[0], parameters_.antenna_offset[1]};
}

void LocalizationPipeline::process_fixes() {
  while (process_next_fix()) {
  }
}

bool LocalizationPipeline::process_next_fix() {
  if (pending_.empty() || history_.empty()) return false;
  const PendingFix next = pending_.front();
  if (next.fix.stamp > history_.latest()) return false;
  if (next.fix.stamp < history_.oldest()) {
    pending_.pop_front();
    FixVerdict verdict = next.validation;
    verdict.decision = FixDecision::kRejectedStale;
    verdict.reason = "older than the odometry that is remembered";
    decide(std::move(verdict));
    return true;
  }
  if (!initialized_) {
    pending_.pop_front();
    initialize_with(next);
    return true;
  }
  if (fixes_have_satellites_ && !satellites_of(next.fix.stamp) &&
      to_seconds(history_.latest() - next.fix.stamp) < parameters_.satellites_timeout) {
    return false;
  }
  if (localizer_->wants_bias()) {
    while (!biases_.empty() && biases_.front().stamp < next.fix.stamp) biases_.pop_front();
    // Searched for: a bias of before the clock was set back, published late, may stand in front for good.
    const auto found = std::find_if(biases_.rbegin(), biases_.rend(),
                                    [&](const BiasEstimate& bias) { return bias.stamp == next.fix.stamp; });
    if (found != biases_.rend()) {
      const BiasEstimate bias = *found;
      last_radius_m_ = bias.radius_m;
      pending_.pop_front();
      if (restart_if_lost(next)) return true;
      if (is_rejected(bias.verdict.decision)) {
        decide(bias.verdict);
      } else {
        correct_with(next, bias.radius_m);
      }
      return true;
    }
    if (to_seconds(history_.latest() - next.fix.stamp) < parameters_.bias_timeout) return false;
    event(PipelineEvent::Level::kWarn,
          "no gps/bias for a fix within " + seconds_text(parameters_.bias_timeout) + ": the last radius is used");
  }
  pending_.pop_front();
  if (!restart_if_lost(next)) correct_with(next, last_radius_m_);
  return true;
}

void LocalizationPipeline::correct_with(const PendingFix& pending, double radius_m) {
  const auto motion = history_.motion_between(history_.latest(), pending.fix.stamp);
  FixMeasurement measurement;
  measurement.position = pending.fix.position;
  measurement.covariance = pending.fix.covariance;
  measurement.antenna_in_body = transform_point(*motion, antenna_offset());
  measurement.bias_radius_m = radius_m;
  measurement.time_s = to_seconds(pending.fix.stamp);
  measurement.stamp = pending.fix.stamp;
  measurement.satellites = take_satellites_of(pending.fix.stamp);
  FixVerdict verdict = localizer_->correct(measurement);
  verdict.stamp = pending.fix.stamp;
  verdict.covariance_clamped = pending.validation.covariance_clamped;
  if (verdict.decision == FixDecision::kAccepted) verdict.decision = pending.validation.decision;
  if (verdict.reason.empty()) verdict.reason = pending.validation.reason;
  decide(std::move(verdict));
  guard_against_non_finite();
}

void LocalizationPipeline::decide_unexamined(const PendingFix& pending, const char* reason) {
  FixVerdict verdict = pending.validation;
  verdict.decision = FixDecision::kNotExamined;
  verdict.reason = reason;
  last_verdict_ = verdict;
  verdicts_.push_back(std::move(verdict));
}

void LocalizationPipeline::decide(FixVerdict verdict) {
  if (is_rejected(verdict.decision)) {
    ++fixes_rejected_;
  } else {
    ++fixes_used_;
    if (verdict.of_ranges) ++fixes_with_ranges_;
    last_used_ = verdict.stamp;
  }
  last_verdict_ = verdict;
  verdicts_.push_back(std::move(verdict));
}

void LocalizationPipeline::guard_against_non_finite() {
  if (is_finite(localizer_->pose())) return;
  event(PipelineEvent::Level::kError, "the estimate is not finite: starting anew from the fixes");
  initialized_ = false;
  lost_ = true;
  forget_start();
}

void LocalizationPipeline::event(PipelineEvent::Level level, const std::string& text) {
  events_.push_back({level, text});
}

std::vector<LocalizationOutput> LocalizationPipeline::take_outputs() { return std::exchange(outputs_, {}); }
std::vector<FixVerdict> LocalizationPipeline::take_verdicts() { return std::exchange(verdicts_, {}); }
std::vector<PipelineEvent> LocalizationPipeline::take_events() { return std::exchange(events_, {}); }

}  // namespace urban_gnss
