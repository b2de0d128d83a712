#pragma once

#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "urban_gnss_localization/localizers/bias_estimate.hpp"
#include "urban_gnss_localization/localizers/localizer.hpp"
#include "urban_gnss_localization/motion/odometry_history.hpp"
#include "urban_gnss_localization/pipeline/bias_matcher.hpp"
#include "urban_gnss_localization/pipeline/epoch_matcher.hpp"
#include "urban_gnss_localization/pipeline/fix_queue.hpp"
#include "urban_gnss_localization/pipeline/fix_speed.hpp"
#include "urban_gnss_localization/pipeline/heading_source.hpp"
#include "urban_gnss_localization/pipeline/input_clocks.hpp"
#include "urban_gnss_localization/pipeline/localization_parameters.hpp"
#include "urban_gnss_localization/pipeline/map_datum.hpp"
#include "urban_gnss_localization/pipeline/odometry_source.hpp"
#include "urban_gnss_localization/pipeline/pipeline_event.hpp"
#include "urban_gnss_localization/pipeline/rate_monitor.hpp"
#include "urban_gnss_localization/pipeline/saved_state.hpp"
#include "urban_gnss_localization/pipeline/start_supervisor.hpp"
#include "urban_gnss_localization/pipeline/status_reporter.hpp"
#include "urban_gnss_localization/pipeline/stream_offsets.hpp"
#include "urban_gnss_localization/pipeline/velocity_queue.hpp"
#include "urban_gnss_localization/pipeline/yaw_rate_source.hpp"

namespace urban_gnss {

/// The estimate at the stamp of an odometry message.
struct LocalizationOutput {
  Stamp stamp{0};
  PoseEstimate estimate;  ///< base in the map frame
  Pose2 odometry_pose;    ///< base in the odometry frame, as the message said
  Twist2 twist;
  std::size_t starts{0};  ///< of the localizer, up to here
};

/// The map frame's odometry origin: the transform map -> odom that makes the odometry's pose the estimated one.
Pose2 map_to_odometry(const LocalizationOutput& output);

/// A fix that waits for the bias at its stamp.
struct BiasQuery {
  LocalFix fix;
  FixOutcome validation;
  Eigen::Vector2d predicted_antenna_position{Eigen::Vector2d::Zero()};  ///< m, map frame, at the fix's stamp
};

/// Everything between the messages and the filter, the same for every localizer, live and offline.
///
/// It acts on stamps, not on times of arrival: what it does depends only on the order in which messages come. A fix
/// waits for the first odometry message that is not older than it, and is then compared with where the robot was at the
/// fix's own stamp.
class LocalizationPipeline {
 public:
  /// Requires parameters without faults.
  LocalizationPipeline(const LocalizationParameters& parameters, std::unique_ptr<Localizer> localizer);
  LocalizationPipeline(const LocalizationPipeline&) = delete;  // its clocks refer to it
  LocalizationPipeline& operator=(const LocalizationPipeline&) = delete;

  void add_odometry(const OdometrySample& message);
  /// The IMU, whose yaw rate YawRateSource puts in place of the odometry's, and whose heading, if it tells one, the
  /// localizer may take.
  void add_imu(const ImuSample& sample);
  /// How the IMU is mounted: its frame in the base frame, as tf says it. Requires a unit quaternion.
  void set_imu_mounting(const Eigen::Quaterniond& base_from_imu) { imu_.set_mounting(base_from_imu); }
  /// The same of an IMU that tells nothing but its yaw rate, of the robot.
  void add_imu_yaw_rate(Stamp stamp, double yaw_rate_radps);
  /// The IMU's heading, of the robot. With a stamp far ahead of the odometry it is left out.
  void add_imu_heading(const HeadingSample& heading);
  void add_fix(const RawFix& fix);
  /// Whether an IMU changes anything: its yaw rate, or its heading.
  bool takes_imu() const {
    return parameters_.imu.use_imu_yaw_rate || (localizer_->takes_heading() && parameters_.imu_orientation.is_used());
  }
  /// Whether velocities of the receiver change anything: where they are wanted, and the localizer makes use of them.
  bool takes_velocity() const {
    return parameters_.velocity.use_gps_velocity && (localizer_->takes_velocity() || parameters_.speed.check_wheels);
  }
  /// A velocity of the receiver. It waits for the odometry of its stamp, tells the heading from which to start, and is
  /// taken by the localizer. One that cannot be used is left out, with an event that says why.
  void add_velocity(const RawVelocity& velocity);
  /// The satellites of the fix at `stamp`, before or after it. Once satellites have come to a fix, the next waits for
  /// its own, by satellites_wait at the most, if the localizer makes use of them. Whatever the localizer, they tell
  /// whether a fix is spoilt (IntegrityMonitor). Residuals that are not those of the fixes (ResidualCheck) are left
  /// out.
  void add_satellites(Stamp stamp, std::vector<SatelliteObservation> satellites);
  /// The bias at a fix, where the localizer wants one.
  void add_bias(const BiasEstimate& bias);

  /// A fix that nothing can be said of but why it is not used.
  void refuse_fix(Stamp stamp, const std::string& reason);

  /// Starts the filter at a pose of the map frame (m, rad), now or as soon as it can. Variances of 0 stand for
  /// initial_position_sigma and initial_heading_sigma. Throws std::invalid_argument where
  /// estimate_fault() finds a fault.
  void set_pose(const PoseEstimate& pose);
  /// Starts where a former run was, with its datum, as soon as odometry says how old the state is. It is a pose that
  /// was set. The state is left out, with an event that says why, where it is too old or of the future (age_fault()),
  /// or the datum is another. A pose that is set before goes first. Requires no state_fault().
  void restore(const SavedState& state, const SavedStateParameters& parameters);
  /// What a later run can go on from, without names of frames. Nothing where that is not worth it: before the start,
  /// without a heading, lost, or where no fix has confirmed the pose.
  std::optional<SavedState> state() const;
  /// Sets the map frame's origin; the filter starts anew where it had another. Throws std::invalid_argument where there
  /// is no such place.
  void set_datum(const GeodeticPosition& datum);
  /// Why somebody who asks for this datum cannot mean it: it is all 0, or so far from the robot that no fix would be
  /// accepted any more; empty where nothing is known against it. Throws as set_datum() does.
  std::string doubt_of_datum(const GeodeticPosition& datum) const;
  /// Sets the antenna's place in the base frame (m), e.g. as tf says it. Requires finite numbers.
  void set_antenna_offset(const Eigen::Vector2d& offset) { antenna_ = offset; }

  /// Forgets everything but parameters, the datum and what the clocks said: stamps still ascend.
  void reset(const std::string& why);

  /// What came of the messages since the last call.
  std::vector<LocalizationOutput> take_outputs();
  std::vector<FixOutcome> take_outcomes();
  std::vector<PipelineEvent> take_events();
  /// The biases that the localizer itself found, one a fix, where it estimates them.
  std::vector<BiasEstimate> take_bias_estimates() { return localizer_->take_bias_estimates(); }

  /// The fix that waits for its bias next; who has a bias filter at hand answers by add_bias() (BiasResponder).
  std::optional<BiasQuery> bias_query() const;
  /// Changes where the odometry's history was forgotten (reset, gap): a bias tracked across that means nothing.
  std::size_t epoch() const { return epoch_; }
  /// Of the odometry that was used last; nothing before the first.
  std::optional<Stamp> latest_odometry() const {
    return history_.empty() ? std::nullopt : std::optional<Stamp>(history_.latest());
  }
  /// Messages that were left out for an odd stamp.
  std::size_t odd_stamps() const { return clocks_.odd_count(); }
  /// How often the filter's state was no estimate, and it was started anew.
  std::size_t broken_states() const { return broken_states_; }

  const std::optional<LocalFrame>& frame() const { return datum_.frame(); }
  bool initialized() const { return start_.has_started(); }
  const Localizer& localizer() const { return *localizer_; }
  Localizer& localizer() { return *localizer_; }
  /// The pose as it is published: the localizer's, with a covariance that covers what fixes contradict it by.
  PoseEstimate estimate() const;
  LocalizationReport report() const;
  /// One sentence for people; empty where nothing is waited for.
  std::string waiting_for() const;

 private:
  void add_imu_rate(const ImuYawRate& rate);
  /// Whether a message with this stamp is to be used now, kNew; `again` gives it again (InputClocks).
  StampVerdict judge(InputStream stream, Stamp stamp, const InputClocks::Again& again,
                     const InputClocks::Refuse& refuse = {});
  bool is_new(InputStream stream, Stamp stamp, const InputClocks::Again& again) {
    return judge(stream, stamp, again) == StampVerdict::kNew;
  }
  /// The clock of this stream alone was set back.
  void restart(InputStream stream);
  /// A message was left out for its stamp: says once of each stream where that was never set.
  void note_unset_stamp(InputStream stream, Stamp stamp);
  /// Whether the stamp is farther ahead of the odometry than any delay explains.
  bool is_far_ahead(Stamp stamp) const;
  /// Why a message of the stream cannot be used, then.
  std::string far_ahead(InputStream stream) const;
  void forget_odometry(double gap_s);
  /// Starts from the state that is to be restored, if it can be.
  void start_from_state(Stamp now);
  /// Tells the localizer, unless it is as printed.
  void doubt_motion(const MotionDoubt& doubt);
  /// The odometry is moved by another part of its messages from now on.
  void change_odometry();
  void change_yaw_rate();
  void correct_heading();
  /// Compares the IMU's heading with that of fixes and motion.
  void compare_heading();
  void process_velocities();
  void process_velocity(const RawVelocity& velocity);
  /// rad, by which what the receiver calls east is turned from the map's x axis, counter-clockwise.
  double convergence_rad() const { return place_ && frame() ? frame()->convergence_rad(*place_) : 0.0; }

  /// Says where the fixes come at another rate than before.
  void watch_rate(Stamp fix);
  void process_fixes();
  bool process_next_fix();
  /// Whether the fix should wait for its satellites or its bias.
  bool awaits_more(Stamp fix) const;
  void start_with(const ValidatedFix& fix);
  bool restart_with(const ValidatedFix& fix);
  void check_residuals(std::vector<SatelliteObservation>& satellites);
  /// Which sources contradict each other; empty where none do.
  std::string complaint() const;
  /// Whether the heading is known to `sigma_rad`.
  bool knows_heading(double sigma_rad) const;
  void compare_speed(const MatchedVelocity& velocity);
  /// The same by fixes, where there are no velocities.
  void compare_speed(const LocalFix& fix);
  void watch_integrity(const ValidatedFix& fix, const Eigen::Vector2d& antenna_in_body);
  std::optional<BiasEstimate> take_bias(Stamp fix);
  void correct_with(const ValidatedFix& fix);

  void start_from(const Start& start);
  StartFix with_odometry(const LocalFix& fix) const;
  /// When the robot was as a fix or a velocity of this stamp says.
  Stamp undelayed(Stamp stamp) const { return stamp - from_seconds(delay_.delay_s()); }
  /// Where the antenna was at `stamp` (m, map frame), by the estimate now; nothing outside the odometry's history.
  std::optional<Eigen::Vector2d> predicted_antenna(Stamp stamp) const;
  /// Whether there is no fault (pose_fault(), estimate_fault()) of what the filter says; otherwise it is started anew
  /// from the fixes.
  bool guard_state(const std::string& fault);

  /// Says where the gate finds nothing any more, or finds something again.
  void watch_gate();
  void decide_stale(FixOutcome outcome, const std::string& reason);
  void decide(FixOutcome outcome);
  void decide_unexamined(const ValidatedFix& fix, const std::string& reason, bool is_start);
  void event(PipelineEvent::Level level, const std::string& text) { events_.push_back({level, text}); }

  LocalizationParameters parameters_;
  std::unique_ptr<Localizer> localizer_;
  Eigen::Vector2d antenna_;  ///< m, in the base frame
  InputClocks clocks_;
  std::set<InputStream> unset_stamps_;  ///< that were said
  StreamOffsets offsets_;
  bool said_far_imu_{false};
  MapDatum datum_;
  std::optional<GeodeticPosition> place_;  ///< of the last fix that has one
  OdometryHistory history_;
  std::size_t epoch_{0};
  std::size_t broken_states_{0};
  std::size_t starts_{0};
  bool is_gate_inert_{false};
  RateMonitor fix_rate_;
  OdometrySource odometry_;
  ImuLeveller imu_;
  YawRateSource yaw_rate_;
  HeadingSource heading_;
  SpeedSource speed_;
  FixSpeed fix_speed_;
  std::optional<Stamp> compared_velocity_;  ///< the receiver's last one
  VelocityQueue velocities_;
  FixQueue fixes_;
  FixDelayEstimator delay_;
  EpochMatcher satellites_;
  ResidualCheck residuals_;
  BiasMatcher biases_;
  StartSupervisor start_;
  std::optional<std::pair<SavedState, SavedStateParameters>> saved_;  ///< to be restored at the first odometry
  IntegrityMonitor integrity_;
  StatusReporter reporter_;

  std::vector<LocalizationOutput> outputs_;
  std::vector<FixOutcome> outcomes_;
  std::vector<PipelineEvent> events_;
};

}  // namespace urban_gnss
