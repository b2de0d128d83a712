// The motion in a LocalizationPipeline: odometry, IMU, and the receiver's velocity.

#include <Eigen/Geometry>
#include <cmath>
#include <utility>

#include "limits.hpp"
#include "text.hpp"
#include "told_start.hpp"
#include "urban_gnss_localization/geometry/pose_faults.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"

namespace urban_gnss {

using Level = PipelineEvent::Level;

namespace {

/// Standard deviation below which a heading tells forwards from backwards.
constexpr double kKnownHeading_rad = 0.15;
/// The same once the fixes contradict the odometry: by its error the robot seems to move sideways, which counts as
/// theirs.
constexpr double kRoughHeading_rad = 0.5;
/// Share of a speed over ground by which the robot moves sideways.
constexpr double kSideways = 0.1;
/// Standard deviation of the heading after turns by a rate that was not the robot's.
constexpr double kWrongTurns_rad = 1.0;
/// Without a velocity of the receiver, after which its fixes tell the speed.
constexpr double kNoVelocity_s = 5.0;

bool is_sideways(const Twist2& twist, double speed_mps) { return std::abs(twist.lateral_mps) > kSideways * speed_mps; }

}  // namespace

void LocalizationPipeline::add_odometry(const OdometrySample& message) {
  const std::string fault = OdometrySource::fault_of(message);
  if (!fault.empty()) {
    event(Level::kWarn, "odometry left out: " + fault);
    return;
  }
  if (!is_new(InputStream::kOdometry, message.stamp, [this, message] { add_odometry(message); })) return;
  offsets_.add_odometry(message.stamp, events_);
  const OdometrySample sample = odometry_.resolve(message, events_);
  if (odometry_.has_changed()) change_odometry();

  const Stamp since = history_.empty() ? sample.stamp : history_.latest();
  const double elapsed_s = to_seconds(sample.stamp - since);
  yaw_rate_.set_comes_ahead(offsets_.offset_s(InputStream::kImu).value_or(0.0) > 0.0);
  Twist2 twist = yaw_rate_.twist_of(sample, since, events_);
  if (yaw_rate_.has_changed()) change_yaw_rate();
  speed_.set_wheels_contradicted(yaw_rate_.contradicts_wheels());
  twist.speed_mps = speed_.speed_of(twist.speed_mps, sample.stamp, elapsed_s, events_);
  if (elapsed_s > parameters_.input.stamps.odometry_gap) forget_odometry(elapsed_s);
  history_.add(sample.stamp, twist);
  if (initialized() && elapsed_s > 0.0) {
    localizer_->move(twist, elapsed_s);
    const MotionDoubt doubt{speed_.doubt_m2(), yaw_rate_.doubt_rad2()};
    if (doubt.exists()) doubt_motion(doubt);
    correct_heading();
    guard_state(pose_fault(localizer_->pose()));
  }
  if (saved_) start_from_state(sample.stamp);
  if (!initialized() && start_.given() && frame()) start_from(told(*start_.given(), "the given pose"));
  process_velocities();
  process_fixes();
  if (!initialized()) return;
  const PoseEstimate published = estimate();
  if (guard_state(estimate_fault(published)))
    outputs_.push_back({sample.stamp, published, sample.pose, twist, starts_});
}

void LocalizationPipeline::doubt_motion(const MotionDoubt& doubt) {
  if (!localizer_->is_as_printed()) localizer_->doubt(doubt);
}

void LocalizationPipeline::change_odometry() {
  speed_.expect_jump();
  delay_.forget_odometry();
  const MotionDoubt doubt = odometry_.doubt();
  if (!doubt.exists()) return;
  if (initialized()) {
    doubt_motion(doubt);
  } else {
    start_.lose_place();  // what was found until now is of another motion
  }
}

void LocalizationPipeline::change_yaw_rate() {
  delay_.forget_odometry();
  if (initialized()) {
    doubt_motion({0.0, kWrongTurns_rad * kWrongTurns_rad});
  } else {
    start_.lose_place();  // what was found until now is of other turns
  }
}

void LocalizationPipeline::forget_odometry(double gap_s) {
  event(Level::kWarn, "no odometry for " + seconds_text(gap_s) +
                          (initialized() ? ": place unknown, starting anew from the fixes" : ""));
  history_.clear();
  fix_speed_ = {};
  delay_.forget_odometry();
  ++epoch_;
  start_.lose_place();
}

void LocalizationPipeline::add_imu(const ImuSample& sample) {
  if (!sample.rate_radps.allFinite()) return;
  add_imu_rate(imu_.yaw_rate(sample));
  if (const auto heading = imu_.heading(sample)) add_imu_heading(*heading);
}

void LocalizationPipeline::add_imu_heading(const HeadingSample& heading) {
  if (localizer_->takes_heading() && !is_far_ahead(heading.stamp)) heading_.add(heading);
}

void LocalizationPipeline::correct_heading() {
  const Stamp lead = from_seconds(yaw_rate_.lead_s());
  const auto told = heading_.take_due(history_.latest() + lead);
  if (!told) return;
  const auto since = history_.motion_between(told->stamp - lead, history_.latest());
  if (since) localizer_->correct_heading({wrap_angle(told->yaw_rad + since->yaw), told->sigma_rad});
}

void LocalizationPipeline::compare_heading() {
  const auto stamp = start_.remembered();
  const Stamp lead = from_seconds(yaw_rate_.lead_s());
  if (!stamp || !heading_.wants_comparison(*stamp + lead)) return;
  const auto by_motion = start_.by_motion();
  if (!by_motion) return;
  heading_.compare(*stamp + lead, by_motion->pose.yaw, std::sqrt(by_motion->covariance(2, 2)), events_);
}

void LocalizationPipeline::add_imu_yaw_rate(Stamp stamp, double yaw_rate_radps) {
  add_imu_rate({stamp, yaw_rate_radps, {}, std::abs(yaw_rate_radps)});
}

void LocalizationPipeline::add_imu_rate(const ImuYawRate& rate) {
  if (!parameters_.imu.use_imu_yaw_rate || !std::isfinite(rate.told_radps)) return;
  offsets_.add(InputStream::kImu, rate.stamp);
  if (is_far_ahead(rate.stamp)) {
    if (!std::exchange(said_far_imu_, true)) {
      event(Level::kWarn, "yaw rate of the IMU left out: " + far_ahead(InputStream::kImu));
    }
    return;
  }
  if (is_new(InputStream::kImu, rate.stamp, [this, rate] { add_imu_rate(rate); })) yaw_rate_.add(rate);
}

void LocalizationPipeline::add_velocity(const RawVelocity& velocity) {
  if (!takes_velocity()) return;
  std::string fault = velocity_fault(velocity);
  offsets_.add(InputStream::kVelocities, velocity.stamp);
  if (fault.empty() && is_far_ahead(velocity.stamp)) fault = far_ahead(InputStream::kVelocities);
  if (fault.empty()) {
    const StampVerdict verdict =
        judge(InputStream::kVelocities, velocity.stamp, [this, velocity] { add_velocity(velocity); });
    if (verdict == StampVerdict::kOdd) return;  // the clocks say so, if it is not followed
    if (verdict == StampVerdict::kNotNewer) fault = "not newer than the last";
  }
  if (!fault.empty()) {
    event(Level::kWarn, "velocity of the receiver left out: " + fault);
    return;
  }
  velocities_.add(velocity);
  process_velocities();
}

void LocalizationPipeline::process_velocities() {
  if (history_.empty()) return;
  while (const auto velocity = velocities_.take(history_.latest())) process_velocity(*velocity);
}

void LocalizationPipeline::process_velocity(const RawVelocity& velocity) {
  RawVelocity in_time = velocity;
  in_time.stamp = undelayed(velocity.stamp);
  const Eigen::Matrix2d to_map = Eigen::Rotation2Dd(convergence_rad()).toRotationMatrix();
  in_time.velocity = to_map * velocity.velocity;
  in_time.covariance = to_map * velocity.covariance * to_map.transpose();
  const auto matched = match_velocity(in_time, history_, antenna_);
  if (!matched) {
    event(Level::kWarn, "velocity of the receiver left out: older than the odometry that is remembered");
    return;
  }
  start_.add_velocity(matched->pair);
  odometry_.add_velocity(in_time.stamp, in_time.velocity, events_);
  compare_speed(*matched);
  if (!initialized() || !localizer_->takes_velocity()) return;
  localizer_->correct_velocity(matched->measurement);
  reporter_.count_velocity();
  guard_state(estimate_fault(localizer_->estimate()));
}

bool LocalizationPipeline::knows_heading(double sigma_rad) const {
  return initialized() && localizer_->health().heading_sigma_rad < sigma_rad;
}

void LocalizationPipeline::compare_speed(const LocalFix& fix) {
  const Stamp stamp = undelayed(fix.stamp);
  const bool has_velocities = compared_velocity_ && to_seconds(stamp - *compared_velocity_) < kNoVelocity_s;
  const bool has_direction = knows_heading(speed_.is_wrong() ? kRoughHeading_rad : kKnownHeading_rad);
  // Without a heading, what the fixes move sideways does not show: that suffices for a fault's end only.
  if (has_velocities || !(has_direction || speed_.is_wrong())) {
    fix_speed_ = {};
    return;
  }
  std::optional<double> path_yaw;
  if (has_direction) path_yaw = localizer_->pose().yaw - history_.pose_at(history_.latest())->yaw;
  const auto speed = fix_speed_.add(stamp, fix.position, history_, path_yaw, antenna_);
  if (speed && !is_sideways(*history_.twist_at(stamp), speed->speed_mps)) speed_.compare(*speed, events_);
}

void LocalizationPipeline::compare_speed(const MatchedVelocity& velocity) {
  compared_velocity_ = velocity.pair.stamp;
  const Eigen::Vector2d& measured = velocity.measurement.velocity;
  const bool moves_sideways = is_sideways(*history_.twist_at(velocity.pair.stamp), measured.norm());
  ReceiverSpeed speed;
  speed.stamp = velocity.pair.stamp;
  speed.speed_mps = measured.norm();
  speed.sigma_mps = std::sqrt(0.5 * velocity.measurement.covariance.trace());
  if (knows_heading(kKnownHeading_rad)) {
    const double turned = velocity.pair.yaw_rad - history_.pose_at(history_.latest())->yaw;
    const double yaw = localizer_->pose().yaw + turned;
    speed.forward_mps = measured.x() * std::cos(yaw) + measured.y() * std::sin(yaw);
    if (moves_sideways) speed.speed_mps = std::abs(*speed.forward_mps);
  } else if (moves_sideways) {
    return;  // how much of it is forwards is not known
  }
  speed_.compare(speed, events_);
}

}  // namespace urban_gnss
