#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"

#include <cmath>
#include <sstream>
#include <utility>

#include "limits.hpp"
#include "text.hpp"
#include "told_start.hpp"
#include "urban_gnss_localization/common/positive_definite.hpp"
#include "urban_gnss_localization/geometry/pose_faults.hpp"
#include "urban_gnss_localization/gnss/position_hint.hpp"

namespace urban_gnss {

using Level = PipelineEvent::Level;

Pose2 map_to_odometry(const LocalizationOutput& output) {
  return compose(output.estimate.pose, inverse(output.odometry_pose));
}

LocalizationPipeline::LocalizationPipeline(const LocalizationParameters& parameters,
                                           std::unique_ptr<Localizer> localizer)
    : parameters_(parameters),
      localizer_(std::move(localizer)),
      antenna_(parameters.input.antenna()),
      clocks_(parameters.input.stamps,
              {[this](const std::string& why) { reset(why); }, [this](InputStream stream) { restart(stream); }}),
      datum_(parameters.datum),
      history_(kHistory_s),
      yaw_rate_(parameters.imu, parameters.input.stamps.odometry_gap),
      heading_(parameters.imu_orientation),
      speed_(parameters.speed),
      velocities_(parameters.velocity),
      fixes_(parameters.input.fix_validation),
      delay_(parameters.fix_delay),
      residuals_(parameters.satellites.residuals),
      biases_(parameters.bias),
      start_(parameters.start),
      integrity_(parameters.integrity),
      reporter_(parameters.status, parameters.input.stamps.odometry_gap) {
  reset({});
}

void LocalizationPipeline::reset(const std::string& why) {
  if (!why.empty()) event(Level::kWarn, "reset: " + why);
  datum_.reset();
  place_.reset();
  history_.clear();
  ++epoch_;
  offsets_.reset();
  said_far_imu_ = false;
  odometry_.reset();
  imu_.reset();
  yaw_rate_.reset();
  heading_.reset();
  speed_.reset();
  fix_speed_ = {};
  compared_velocity_.reset();
  velocities_.reset();
  fixes_.reset();
  fix_rate_.reset();
  delay_.reset();
  satellites_.reset();
  residuals_.reset();
  biases_.reset();
  start_.reset();
  saved_.reset();
  integrity_.reset();
  reporter_.reset();
  is_gate_inert_ = false;
  if (frame()) event(Level::kInfo, datum_.describe());
}

StampVerdict LocalizationPipeline::judge(InputStream stream, Stamp stamp, const InputClocks::Again& again,
                                         const InputClocks::Refuse& refuse) {
  const StampVerdict verdict = clocks_.judge(stream, stamp, again, events_, refuse);
  if (verdict != StampVerdict::kNew) note_unset_stamp(stream, stamp);
  return verdict;
}

void LocalizationPipeline::restart(InputStream stream) {
  if (stream == InputStream::kFixes) {
    fixes_.reset();
    fix_rate_.reset();
  }
  if (stream == InputStream::kVelocities) velocities_.reset();
}

void LocalizationPipeline::note_unset_stamp(InputStream stream, Stamp stamp) {
  if (stamp != Stamp::zero() || !unset_stamps_.insert(stream).second) return;
  event(Level::kWarn, std::string("header.stamp of ") + to_string(stream) + " is 0: its driver must set it");
}

std::string LocalizationPipeline::far_ahead(InputStream stream) const {
  const auto offset_s = offsets_.offset_s(stream);  // nothing where the odometry is what is missing
  return "more than " + seconds_text(kMaxAhead_s) + " ahead of the odometry" + (offset_s ? clock_hint(*offset_s) : "");
}

bool LocalizationPipeline::is_far_ahead(Stamp stamp) const {
  return !history_.empty() && to_seconds(stamp - history_.latest()) > kMaxAhead_s;
}

void LocalizationPipeline::add_satellites(Stamp stamp, std::vector<SatelliteObservation> satellites) {
  check_residuals(satellites);
  satellites_.add({stamp, std::move(satellites)});
  process_fixes();
}

void LocalizationPipeline::check_residuals(std::vector<SatelliteObservation>& satellites) {
  const bool belonged = residuals_.belong();
  residuals_.add(satellites);
  const bool belong = residuals_.belong();
  if (belonged && !belong) {
    event(Level::kWarn,
          "the range residuals on gps/satellites are not those of the fixes (of another solution, or of a "
          "filter in the receiver): the ranges are not used");
  } else if (!belonged && belong) {
    event(Level::kInfo, "the range residuals on gps/satellites are those of the fixes: the ranges are used");
  }
  if (belong) return;
  for (SatelliteObservation& each : satellites) each.residual_m = SatelliteObservation::kUnknown;
}

void LocalizationPipeline::add_bias(const BiasEstimate& bias) {
  biases_.add(bias);
  process_fixes();
}

std::optional<BiasQuery> LocalizationPipeline::bias_query() const {
  const ValidatedFix* next = fixes_.next();
  if (!initialized() || !localizer_->wants_bias() || next == nullptr || history_.empty()) return std::nullopt;
  const auto predicted = predicted_antenna(next->fix.stamp);
  if (!predicted) return std::nullopt;
  return BiasQuery{next->fix, next->outcome, *predicted};
}

void LocalizationPipeline::add_fix(const RawFix& fix) {
  if (fix.has_fix) offsets_.add(InputStream::kFixes, fix.stamp);
  if (is_far_ahead(fix.stamp)) {
    refuse_fix(fix.stamp, far_ahead(InputStream::kFixes));
    return;
  }
  // A receiver that does not know where it is may not know the time either, and a stamp that was not set is no time.
  // What is not new, the queue rejects.
  if (is_usable_position(fix) && fix.stamp != Stamp::zero()) {
    const StampVerdict verdict = judge(
        InputStream::kFixes, fix.stamp, [this, fix] { add_fix(fix); },
        [this, fix](const std::string& why) { refuse_fix(fix.stamp, why); });
    if (verdict == StampVerdict::kOdd) return;
    place_ = fix.position;
    if (verdict == StampVerdict::kNew) watch_rate(fix.stamp);
  }
  const auto rejected = fixes_.add(fix);
  if (rejected) {
    if (rejected->decision == FixDecision::kRejectedStale) note_unset_stamp(InputStream::kFixes, fix.stamp);
    decide(*rejected);
  } else if (!frame()) {
    reporter_.note_waiting_fix(fix.stamp);
  }
  if (!frame()) {
    datum_.add(fix);
    if (frame()) event(Level::kInfo, datum_.describe());
  }
  process_fixes();
}

void LocalizationPipeline::refuse_fix(Stamp stamp, const std::string& reason) {
  FixOutcome outcome;
  outcome.stamp = stamp;
  decide_stale(std::move(outcome), reason);
}

void LocalizationPipeline::watch_rate(Stamp fix) {
  const std::string news = fix_rate_.add(fix);
  if (!news.empty()) {
    event(Level::kWarn, "gps/fix comes at another rate, " + news + ": do two sources publish it, or does one pause?");
  }
}

void LocalizationPipeline::process_fixes() {
  std::vector<FixOutcome> rejected;
  if (frame()) rejected = fixes_.validate(*frame());
  for (PipelineEvent& mistake : fixes_.take_events()) events_.push_back(std::move(mistake));
  for (FixOutcome& each : rejected) decide(std::move(each));
  if (!frame()) return;
  while (process_next_fix()) {
  }
}

bool LocalizationPipeline::process_next_fix() {
  const ValidatedFix* next = fixes_.next();
  if (next == nullptr || history_.empty() || next->fix.stamp > history_.latest()) return false;
  const bool is_too_old = undelayed(next->fix.stamp) < history_.oldest();
  if (!is_too_old && initialized() && awaits_more(next->fix.stamp)) return false;

  const ValidatedFix fix = fixes_.pop();
  // The receiver's own speed, in place of the odometry's, does not tell how late the receiver is.
  if (speed_.is_wrong()) delay_.forget_odometry();
  delay_.add(fix.fix.stamp, fix.fix.position, history_, antenna_);
  if (const auto news = delay_.take_news()) event(Level::kInfo, *news);
  odometry_.add_fix(undelayed(fix.fix.stamp), fix.fix.position, events_);
  if (is_too_old) {
    const auto offset_s = offsets_.offset_s(InputStream::kFixes);
    decide_stale(fix.outcome, "older than the odometry that is remembered" + (offset_s ? clock_hint(*offset_s) : ""));
    return true;
  }
  if (!initialized()) {
    start_with(fix);
    return true;
  }
  compare_speed(fix.fix);
  const std::optional<BiasEstimate> bias = take_bias(fix.fix.stamp);
  const bool restarts = restart_with(fix);
  compare_heading();
  if (restarts) return true;
  if (bias && is_rejected(bias->outcome.decision)) {
    decide(bias->outcome);
  } else {
    correct_with(fix);
  }
  return true;
}

bool LocalizationPipeline::awaits_more(Stamp fix) const {
  const double waited_s = to_seconds(history_.latest() - fix);
  return (localizer_->takes_satellites() && satellites_.awaits(fix) &&
          waited_s < parameters_.satellites.satellites_wait) ||
         (localizer_->wants_bias() && biases_.awaits(fix, waited_s));
}

void LocalizationPipeline::start_with(const ValidatedFix& fix) {
  satellites_.take(fix.fix.stamp);
  const auto start = start_.find_start(with_odometry(fix.fix));
  decide_unexamined(fix, "used for the start", start.has_value());
  if (start) start_from(*start);
}

bool LocalizationPipeline::restart_with(const ValidatedFix& fix) {
  const bool had_heading = start_.has_heading();
  const auto start = start_.find_restart(with_odometry(fix.fix), *predicted_antenna(fix.fix.stamp),
                                         integrity_.is_persistent(), events_);
  if (!start || (had_heading && localizer_->is_as_printed())) return false;
  decide_unexamined(fix, start->fix_use, true);
  start_from(*start);
  return true;
}

std::optional<BiasEstimate> LocalizationPipeline::take_bias(Stamp fix) {
  if (!localizer_->wants_bias()) return std::nullopt;
  const std::optional<BiasEstimate> bias = biases_.take(fix);
  if (!bias) {
    event(Level::kWarn,
          "no gps/bias for a fix within " + seconds_text(parameters_.bias.bias_timeout) + ": the last radius is used");
  }
  return bias;
}

void LocalizationPipeline::correct_with(const ValidatedFix& fix) {
  const Stamp stamp = fix.fix.stamp;
  FixMeasurement measurement;
  measurement.position = fix.fix.position;
  measurement.covariance = fix.fix.covariance;
  measurement.antenna_in_body =
      transform_point(*history_.motion_between(history_.latest(), undelayed(stamp)), antenna_);
  measurement.bias_radius_m = biases_.radius_m().value_or(0.0);
  measurement.time_s = to_seconds(stamp);
  measurement.stamp = stamp;
  const SatelliteEpoch* epoch = satellites_.take(stamp);
  if (epoch != nullptr && localizer_->takes_satellites()) {
    measurement.satellites = epoch->satellites;
    const double turn_rad = convergence_rad();
    for (SatelliteObservation& each : measurement.satellites) each.look.azimuth_rad -= turn_rad;
  }

  const bool is_spoilt = epoch != nullptr && residual_rms_m(epoch->satellites) > parameters_.integrity.residual_limit;
  if (!is_spoilt) watch_integrity(fix, measurement.antenna_in_body);
  const Eigen::Vector2d before = localizer_->pose().position();
  FixOutcome outcome = localizer_->correct(measurement);
  if (!is_spoilt) integrity_.note_correction(localizer_->pose().position() - before);
  outcome.stamp = stamp;
  outcome.covariance_clamped = fix.outcome.covariance_clamped;
  if (outcome.decision == FixDecision::kAccepted) outcome.decision = fix.outcome.decision;
  if (outcome.reason.empty()) outcome.reason = fix.outcome.reason;
  decide(std::move(outcome));
  watch_gate();
  guard_state(estimate_fault(localizer_->estimate()));
}

void LocalizationPipeline::watch_gate() {
  const bool is_inert = reporter_.is_gate_inert(*localizer_);
  if (is_inert == std::exchange(is_gate_inert_, is_inert)) return;
  event(is_inert ? Level::kWarn : Level::kInfo,
        is_inert ? "gate inert: the fixes scatter far less than their covariance says" : "the gate works again");
}

void LocalizationPipeline::watch_integrity(const ValidatedFix& fix, const Eigen::Vector2d& antenna_in_body) {
  const PoseEstimate before = localizer_->estimate();
  const bool was_contradicted = integrity_.contradiction().has_value();
  integrity_.add({fix.fix.stamp, fix.fix.position - transform_point(before.pose, antenna_in_body), fix.fix.covariance,
                  before.covariance.topLeftCorner<2, 2>()});
  const auto& contradiction = integrity_.contradiction();
  if (contradiction.has_value() == was_contradicted) return;
  event(contradiction ? Level::kWarn : Level::kInfo,
        contradiction ? describe(*contradiction) : "estimate and fixes agree again");
}

void LocalizationPipeline::decide_stale(FixOutcome outcome, const std::string& reason) {
  outcome.decision = FixDecision::kRejectedStale;
  outcome.reason = reason;
  decide(std::move(outcome));
}

void LocalizationPipeline::decide_unexamined(const ValidatedFix& fix, const std::string& reason, bool is_start) {
  FixOutcome outcome = fix.outcome;
  outcome.decision = FixDecision::kNotExamined;
  outcome.reason = reason;
  reporter_.note_start_fix(outcome, is_start);
  outcomes_.push_back(std::move(outcome));
}

void LocalizationPipeline::decide(FixOutcome outcome) {
  reporter_.count(outcome);
  outcomes_.push_back(std::move(outcome));
}

void LocalizationPipeline::set_pose(const PoseEstimate& pose) {
  start_.give(pose);
  saved_.reset();
  if (frame() && !history_.empty()) start_from(told(*start_.given(), "a pose that was set"));
}

void LocalizationPipeline::restore(const SavedState& state, const SavedStateParameters& parameters) {
  saved_.emplace(state, parameters);
}

void LocalizationPipeline::start_from_state(Stamp now) {
  const auto [state, parameters] = *std::exchange(saved_, std::nullopt);
  std::string fault = age_fault(state, now, parameters);
  if (fault.empty() && frame() && !(frame()->datum() == state.datum)) fault = "its datum is another";
  if (!fault.empty()) {
    event(Level::kWarn, "saved state left out: " + fault);
    return;
  }
  if (datum_.set(state.datum, "the saved state")) event(Level::kInfo, datum_.describe());
  start_.give(estimate_at(state, now, parameters));
  start_from(told(*start_.given(), "the saved state, " + seconds_text(to_seconds(now - state.stamp)) + " old"));
}

std::optional<SavedState> LocalizationPipeline::state() const {
  const bool is_known = initialized() && start_.has_heading() && !start_.is_lost() && !integrity_.is_unconfirmed();
  if (!is_known || !frame() || history_.empty()) return std::nullopt;
  SavedState state;
  state.stamp = history_.latest();
  state.datum = frame()->datum();
  state.estimate = estimate();
  return state_fault(state).empty() ? std::make_optional(state) : std::nullopt;
}

void LocalizationPipeline::set_datum(const GeodeticPosition& datum) {
  const bool had_frame = frame().has_value();
  if (!datum_.set(datum)) return;
  if (had_frame) {
    reset("the datum was set to another place");
    return;
  }
  event(Level::kInfo, datum_.describe());
  process_fixes();
}

std::string LocalizationPipeline::doubt_of_datum(const GeodeticPosition& datum) const {
  if (datum == GeodeticPosition{}) return "latitude, longitude and altitude are all 0";
  const LocalFrame asked(datum);
  if (!frame() || !initialized()) return {};
  const Eigen::Vector2d robot = localizer_->pose().position();
  return why_too_far(frame()->to_geodetic({robot.x(), robot.y(), 0.0}), asked,
                     parameters_.input.fix_validation.max_distance_from_datum, "robot");
}

void LocalizationPipeline::start_from(const Start& start) {
  Eigen::Vector2d moved = Eigen::Vector2d::Zero();
  if (initialized() && !start.is_told) moved = start.estimate.pose.position() - localizer_->pose().position();
  localizer_->initialize(start.estimate);
  ++starts_;
  start_.note(start);
  integrity_.restart(start.is_told, moved);
  speed_.forget_heading();
  biases_.forget_radius();
  const Pose2& pose = start.estimate.pose;
  std::ostringstream text;
  text.precision(4);
  text << "started from " << start.source << ": x " << pose.x << " m, y " << pose.y << " m, yaw " << pose.yaw << " rad";
  event(Level::kInfo, text.str());
}

StartFix LocalizationPipeline::with_odometry(const LocalFix& fix) const {
  StartFix start{fix, history_, antenna_};
  start.fix.stamp = undelayed(fix.stamp);
  return start;
}

std::optional<Eigen::Vector2d> LocalizationPipeline::predicted_antenna(Stamp stamp) const {
  const auto motion = history_.motion_between(history_.latest(), undelayed(stamp));
  if (!motion) return std::nullopt;
  return transform_point(compose(localizer_->pose(), *motion), antenna_);
}

bool LocalizationPipeline::guard_state(const std::string& fault) {
  if (fault.empty()) return true;
  event(Level::kError, "the estimate is none (" + fault + "): starting anew from the fixes");
  ++broken_states_;
  start_.lose_place();
  return false;
}

PoseEstimate LocalizationPipeline::estimate() const {
  PoseEstimate published = localizer_->estimate();
  if (!is_positive_definite<3>(published.covariance) && estimate_fault(published).empty()) {
    published.covariance = nearest_positive_definite<3>(published.covariance);  // of particles that are all the same
  }
  if (!localizer_->is_as_printed()) published.covariance.topLeftCorner<2, 2>() += integrity_.covariance();
  return published;
}

LocalizationReport LocalizationPipeline::report() const {
  PipelineStatus status;
  if (!history_.empty()) status.last_odometry = history_.latest();
  status.last_fix = fixes_.last_stamp();
  status.has_datum = frame().has_value();
  status.has_started = initialized();
  status.is_lost = start_.is_lost();
  status.waiting_for = waiting_for();
  if (biases_.radius_m()) status.bias_radius_m = *biases_.radius_m();
  status.complaint = complaint();
  status.receiver_note = fixes_.complaint();
  status.time_to_detect_s = integrity_.time_to_detect_s();
  status.time_to_recover_s = integrity_.time_to_recover_s();
  status.fix_delay_s = delay_.delay_s();
  status.contradiction_m2 = integrity_.covariance();
  return reporter_.report(status, *localizer_);
}

std::string LocalizationPipeline::complaint() const {
  if (integrity_.contradiction()) return describe(*integrity_.contradiction());
  if (integrity_.is_unconfirmed()) return "no fix has confirmed the pose that was set";
  for (const std::string& each : {odometry_.complaint(), speed_.complaint()}) {
    if (!each.empty()) return each;
  }
  return yaw_rate_.complaint();
}

std::string LocalizationPipeline::waiting_for() const {
  if (initialized()) return {};
  if (history_.empty()) return "odometry";
  const std::string rejected = reporter_.last_rejection();
  if (!frame()) return "the datum: " + datum_.waiting_for() + rejected;
  const std::string offset = offsets_.describe(InputStream::kFixes);
  if (!fixes_.last_stamp()) return "a usable fix" + (offset.empty() ? rejected : ": " + offset);
  return "the start: " + start_.waiting_for() + rejected;
}

std::vector<LocalizationOutput> LocalizationPipeline::take_outputs() { return std::exchange(outputs_, {}); }
std::vector<FixOutcome> LocalizationPipeline::take_outcomes() { return std::exchange(outcomes_, {}); }
std::vector<PipelineEvent> LocalizationPipeline::take_events() { return std::exchange(events_, {}); }

}  // namespace urban_gnss
