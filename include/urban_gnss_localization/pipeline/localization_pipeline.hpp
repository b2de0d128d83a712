#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/localizers/nishida/bias_kalman_filter.hpp"
#include "urban_gnss_localization/localizers/localizer.hpp"
#include "urban_gnss_localization/gnss/datum_initializer.hpp"
#include "urban_gnss_localization/gnss/fix_sanitation.hpp"
#include "urban_gnss_localization/gnss/heading_initializer.hpp"
#include "urban_gnss_localization/motion/odometry_history.hpp"
#include "urban_gnss_localization/motion/yaw_rate_check.hpp"
#include "urban_gnss_localization/pipeline/stamp_monitor.hpp"

namespace urban_gnss {

struct LocalizationParameters {
  std::vector<double> initial_pose;              ///< m, m, rad in the map frame; empty: from fixes and motion
  double initial_position_sigma{1.0};            ///< m, of initial_pose
  double initial_heading_sigma{0.2};             ///< rad, of initial_pose
  std::vector<double> antenna_offset{0.0, 0.0};  ///< m, x and y of the antenna in the base frame
  bool use_imu_yaw_rate{true};                   ///< the IMU's yaw rate in place of the odometry's, where there is one
  bool use_gps_velocity{true};                   ///< the receiver's velocity, where the localizer makes use of it
  double velocity_sigma_default{0.3};  ///< m/s per axis, where a receiver declares no covariance of its velocity
  double velocity_sigma_floor{0.05};   ///< m/s per axis, added to the declared covariance
  double odometry_gap{2.0};            ///< s without odometry after which the robot's place is unknown
  /// m, beyond three declared standard deviations: a fix farther from the estimate cannot be explained by reflections
  /// (Nishida et al., Japanese text: the distance does not vary by more than some tens of metres)
  double max_bias_radius{50.0};
  double lost_timeout{10.0};       ///< s of nothing but such fixes after which the estimate is what is wrong
  double fix_timeout{10.0};        ///< s without a fix that was used after which this is dead reckoning
  double bias_timeout{0.5};        ///< s that a fix waits for its gps/bias
  double satellites_timeout{0.5};  ///< s that a fix waits for its gps/satellites, where those before it had some
  double time_jump{1.0};           ///< s, a stamp older by more than this is a clock that was set back
  bool reset_on_time_jump{true};
  double heading_converged_sigma{0.3};  ///< rad, heading is said to be known below this
  DatumParameters datum;
  FixSanitationParameters fix;
  HeadingInitializerParameters heading;

  template <class V>
  void visit(V& v) {
    v("initial_pose", initial_pose);
    v("initial_position_sigma", initial_position_sigma, non_negative());
    v("initial_heading_sigma", initial_heading_sigma, non_negative());
    v("antenna_offset", antenna_offset);
    v("use_imu_yaw_rate", use_imu_yaw_rate);
    v("use_gps_velocity", use_gps_velocity);
    v("velocity_sigma_default", velocity_sigma_default, positive());
    v("velocity_sigma_floor", velocity_sigma_floor, positive());
    v("odometry_gap", odometry_gap, positive());
    v("max_bias_radius", max_bias_radius, positive());
    v("lost_timeout", lost_timeout, positive());
    v("fix_timeout", fix_timeout, positive());
    v("bias_timeout", bias_timeout, non_negative());
    v("satellites_timeout", satellites_timeout, non_negative());
    v("time_jump", time_jump, positive());
    v("reset_on_time_jump", reset_on_time_jump);
    v("heading_converged_sigma", heading_converged_sigma, positive());
    datum.visit(v);
    fix.visit(v);
    heading.visit(v);
  }
  void check(std::vector<std::string>& faults) const;
};

/// The states of LocalizationStatus.msg.
enum class LocalizationState : std::uint8_t {
  kWaitingForOdometry = 0,
  kWaitingForFix = 1,
  kWaitingForDatum = 2,
  kInitializing = 3,
  kTracking = 4,
  kDeadReckoning = 5,
  kLost = 6,
};
const char* to_string(LocalizationState state);

/// The estimate at the stamp of an odometry message.
struct LocalizationOutput {
  Stamp stamp{0};
  PoseEstimate estimate;  ///< base in the map frame
  Pose2 odometry_pose;    ///< base in the odometry frame, as the message said
  Twist2 twist;
};

/// The map frame's odometry origin: the transform map -> odom that makes the odometry's pose the estimated one.
Pose2 map_to_odometry(const LocalizationOutput& output);

/// What LocalizationStatus.msg says.
struct LocalizationReport {
  LocalizationState state{LocalizationState::kWaitingForOdometry};
  bool healthy{false};
  std::string reason;
  FixVerdict last_fix;
  std::uint64_t fixes_used{0};
  std::uint64_t fixes_rejected{0};
  std::uint64_t fixes_with_ranges{0};  ///< of those used, with FixVerdict::of_ranges
  std::uint64_t velocities_used{0};    ///< of the receiver
  double fix_age_s{std::numeric_limits<double>::quiet_NaN()};
  double odometry_age_s{0.0};
  double position_sigma_m{std::numeric_limits<double>::quiet_NaN()};
  bool heading_converged{false};
  double bias_radius_m{0.0};
  LocalizerHealth health;
};

/// A fix that waits for the bias at its stamp.
struct BiasQuery {
  LocalFix fix;
  FixVerdict sanitation;
  Eigen::Vector2d predicted_antenna_position{Eigen::Vector2d::Zero()};  ///< m, map frame, at the fix's stamp
};

/// Everything between the messages and the filter, the same for every localizer, live and offline: sanitation, datum,
/// start, odometry gaps, late fixes, fixes that wait for odometry or for their bias, clocks that are set back.
///
/// It acts on stamps, not on times of arrival: what it does depends only on the order in which messages come. A fix
/// waits for the first odometry message that is not older than it, and is then compared with where the robot was at the
/// fix's own stamp.
class LocalizationPipeline {
 public:
  /// Requires parameters without faults.
  LocalizationPipeline(const LocalizationParameters& parameters, std::unique_ptr<Localizer> localizer);

  void add_odometry(const OdometrySample& sample);
  /// Where use_imu_yaw_rate is set, a step of odometry has the mean of the IMU's yaw rates within it, or the last one
  /// from up to 0.2 s before it, and where there is none the odometry's own.
  ///
  /// A localizer that estimates the yaw rate's bias has one bias for both sources. That of the IMU holds on while the
  /// odometry steps in, which is wrong by the difference of their biases: some hundredths of a radian in 10 s, little
  /// beside the uncertainty that grows in that time, but not to be kept up for minutes. So a source that changes for
  /// longer than odometry_gap is an event.
  void add_imu_yaw_rate(Stamp stamp, double yaw_rate_radps);
  void add_fix(const RawFix& fix);
  /// Whether velocities of the receiver change anything: where they are wanted, and the localizer makes use of them.
  bool takes_velocity() const { return parameters_.use_gps_velocity && localizer_->takes_velocity(); }
  /// A velocity of the receiver. It waits for the odometry of its stamp, tells the heading from which to start, and is
  /// taken by the localizer. One that cannot be used is left out, with an event that says why.
  void add_velocity(const RawVelocity& velocity);
  /// Whether satellites change anything.
  bool takes_satellites() const { return localizer_->takes_satellites(); }
  /// The satellites of the fix at `stamp`, before or after it. Once satellites have come to a fix, the next waits for
  /// its own, by satellites_timeout at the most.
  void add_satellites(Stamp stamp, std::vector<SatelliteObservation> satellites);
  /// The bias at a fix, where the localizer wants one.
  void add_bias(const BiasEstimate& bias);

  /// Starts the filter at a pose of the map frame (m, rad), now or as soon as it can. Throws std::invalid_argument
  /// where the pose or the covariance is not finite.
  void set_pose(const PoseEstimate& pose);
  /// Sets the map frame's origin; the filter starts anew where it had another. Throws std::invalid_argument where there
  /// is no such place.
  void set_datum(const GeodeticPosition& datum);

  /// Sets the antenna's place in the base frame (m), e.g. as tf says it. Requires finite numbers.
  void set_antenna_offset(const Eigen::Vector2d& offset) { parameters_.antenna_offset = {offset.x(), offset.y()}; }

  /// Forgets everything but parameters, a datum that was set and what the clocks said: stamps still ascend.
  void reset(const std::string& why);

  /// What came of the messages since the last call.
  std::vector<LocalizationOutput> take_outputs();
  std::vector<FixVerdict> take_verdicts();
  std::vector<PipelineEvent> take_events();

  /// The fix that waits for its bias next, where the one who calls has the bias filter at hand.
  std::optional<BiasQuery> bias_query() const;

  /// Changes where the odometry's history was forgotten (reset, gap): a bias tracked across that means nothing.
  std::size_t epoch() const { return epoch_; }
  const std::optional<LocalFrame>& frame() const { return frame_; }
  bool initialized() const { return initialized_; }
  const Localizer& localizer() const { return *localizer_; }
  LocalizationReport report() const;
  /// One sentence for people; empty where nothing is waited for.
  std::string waiting_for() const;

 private:
  struct PendingFix {
    LocalFix fix;
    FixVerdict sanitation;
  };

  void use_datum(const GeodeticPosition& datum, const std::string& source);
  void sanitize(const RawFix& fix);
  void process_velocities();
  void process_fixes();
  bool process_next_fix();
  /// The satellites of the fix at `stamp`; nothing where there are none.
  const std::vector<SatelliteObservation>* satellites_of(Stamp stamp) const;
  /// The same for a fix that is processed now; remembers whether there were any.
  std::vector<SatelliteObservation> take_satellites_of(Stamp fix_stamp);
  void initialize_with(const PendingFix& pending);
  void remember_for_start(const PendingFix& pending);
  bool try_start(const PendingFix& pending);
  /// A robot that was parked at its start has its heading as soon as it has moved: whatever the filter made of a
  /// heading that nobody knew is given up for it.
  bool start_with_heading(const PendingFix& pending);
  bool restart_if_lost(const PendingFix& pending);
  void start(const PoseEstimate& pose, const std::string& how);
  void forget_start();
  void correct_with(const PendingFix& pending, double radius_m);
  void decide(FixVerdict verdict);
  void decide_unexamined(const PendingFix& pending, const char* reason);
  void guard_against_non_finite();
  Twist2 with_imu(const OdometrySample& sample, Stamp since);
  void watch_imu(const OdometrySample& sample, std::optional<double> imu_yaw_rate_radps, double duration_s);
  /// Whether the stamp is newer than the stream's last, or the stream's clock was set back, which resets everything.
  bool is_new(StampMonitor& monitor, Stamp stamp, const char* stream);
  Eigen::Vector2d antenna_offset() const;
  /// Where the antenna was at `stamp` (m, map frame), by the estimate now; nothing outside the odometry's history.
  std::optional<Eigen::Vector2d> predicted_antenna(Stamp stamp) const;
  void event(PipelineEvent::Level level, const std::string& text);

  LocalizationParameters parameters_;
  std::unique_ptr<Localizer> localizer_;
  DatumInitializer datum_initializer_;
  HeadingInitializer heading_initializer_;
  bool datum_was_set_{false};
  std::optional<LocalFrame> frame_;
  std::optional<PoseEstimate> start_;  ///< where to start, until it is used

  OdometryHistory history_;
  std::size_t epoch_{0};
  StampMonitor odometry_stamps_;
  StampMonitor fix_stamps_;
  StampMonitor imu_stamps_;
  StampMonitor velocity_stamps_;
  std::optional<OdometrySample> last_odometry_;
  std::deque<std::pair<Stamp, double>> imu_yaw_rates_;
  std::optional<YawRateCheck> yaw_rate_check_;  ///< until it has found something
  double without_imu_s_{0.0};                   ///< of odometry, since the IMU's last yaw rate
  bool imu_is_silent_{true};                    ///< for longer than odometry_gap, or there never was one

  std::deque<RawFix> before_datum_;
  std::deque<PendingFix> pending_;
  std::deque<RawVelocity> pending_velocities_;
  std::optional<Stamp> last_fix_stamp_;
  std::optional<Stamp> last_start_fix_;  ///< that the initial pose is being found from
  std::deque<BiasEstimate> biases_;
  double last_radius_m_{0.0};
  std::deque<std::pair<Stamp, std::vector<SatelliteObservation>>> satellites_;
  bool fixes_have_satellites_{false};  ///< the last one had
  std::optional<Stamp> last_taken_;    ///< fix whose satellites were looked for

  bool initialized_{false};
  bool lost_{false};
  bool heading_unknown_{false};     ///< the last start had none
  std::optional<Stamp> far_since_;  ///< since when every fix has been farther than max_bias_radius
  std::optional<Stamp> last_used_;
  FixVerdict last_verdict_;
  std::uint64_t fixes_used_{0};
  std::uint64_t fixes_rejected_{0};
  std::uint64_t fixes_with_ranges_{0};
  std::uint64_t velocities_used_{0};

  std::vector<LocalizationOutput> outputs_;
  std::vector<FixVerdict> verdicts_;
  std::vector<PipelineEvent> events_;
};

}  // namespace urban_gnss
