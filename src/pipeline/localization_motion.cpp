// What says how the robot moves, beside the odometry: the IMU's yaw rate and the receiver's velocity.

#include <sstream>

#include "limits.hpp"
#include "text.hpp"
#include "urban_gnss_localization/common/positive_definite.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"

namespace urban_gnss {
namespace {

constexpr double kMaxSpeed_mps = 150.0;
/// An IMU that is slower than the odometry, or a message that comes late, is no reason to change the source.
constexpr double kYawRateHold_s = 0.2;
/// An IMU's yaw rate may be smaller than that of wheels that slip, but not in the other direction, nor larger than in
/// degrees.
constexpr double kMaxYawRateFactor = 10.0;

}  // namespace

void LocalizationPipeline::add_imu_yaw_rate(Stamp stamp, double yaw_rate_radps) {
  if (!parameters_.use_imu_yaw_rate) return;
  OdometrySample as_odometry;
  as_odometry.twist.yaw_rate_radps = yaw_rate_radps;
  if (!odometry_fault(as_odometry).empty()) return;
  if (last_odometry_ && to_seconds(stamp - last_odometry_->stamp) > kMaxAhead_s) {
    event(PipelineEvent::Level::kWarn,
          "yaw rate of the IMU left out: more than " + seconds_text(kMaxAhead_s) + " ahead of the odometry");
    return;
  }
  if (!is_new(imu_stamps_, stamp, "IMU")) return;
  imu_yaw_rates_.emplace_back(stamp, yaw_rate_radps);
  while (imu_yaw_rates_.size() > 1 && to_seconds(stamp - imu_yaw_rates_.front().first) > kHistory_s) {
    imu_yaw_rates_.pop_front();
  }
}

Twist2 LocalizationPipeline::with_imu(const OdometrySample& sample, Stamp since) {
  Twist2 twist = sample.twist;
  if (!parameters_.use_imu_yaw_rate) return twist;
  double sum = 0.0;
  int count = 0;
  std::optional<double> rate_radps;
  for (const auto& [stamp, rate] : imu_yaw_rates_) {
    if (stamp > sample.stamp) break;
    if (stamp > since) {
      sum += rate;
      ++count;
    } else if (to_seconds(since - stamp) <= kYawRateHold_s) {
      rate_radps = rate;
    }
  }
  if (count > 0) rate_radps = sum / count;
  watch_imu(sample, rate_radps, to_seconds(sample.stamp - since));
  if (rate_radps) twist.yaw_rate_radps = *rate_radps;
  return twist;
}

void LocalizationPipeline::watch_imu(const OdometrySample& sample, std::optional<double> imu_yaw_rate_radps,
                                     double duration_s) {
  if (!imu_yaw_rate_radps) {
    without_imu_s_ += duration_s;
    if (imu_is_silent_ || without_imu_s_ <= parameters_.odometry_gap) return;
    imu_is_silent_ = true;
    event(PipelineEvent::Level::kWarn,
          "the IMU is silent for " + seconds_text(parameters_.odometry_gap) + ": the odometry's yaw rate is used");
    return;
  }
  without_imu_s_ = 0.0;
  if (imu_is_silent_) event(PipelineEvent::Level::kInfo, "the IMU's yaw rate is used in place of the odometry's");
  imu_is_silent_ = false;
  if (!yaw_rate_check_) return;
  const auto factor = yaw_rate_check_->add(sample.twist.yaw_rate_radps, *imu_yaw_rate_radps, duration_s);
  if (!factor || (*factor > 0.0 && *factor < kMaxYawRateFactor)) return;
  std::ostringstream text;
  text.precision(2);
  text << "the IMU's yaw rate is " << *factor << " times the odometry's in a minute of turning: is it "
       << (*factor > 0.0 ? "in degrees?" : "mounted upside down, without an orientation in its messages?");
  event(PipelineEvent::Level::kWarn, text.str());
  yaw_rate_check_.reset();
}

void LocalizationPipeline::add_velocity(const RawVelocity& raw) {
  if (!takes_velocity()) return;
  if (!raw.velocity.allFinite() || raw.velocity.norm() > kMaxSpeed_mps) {
    event(PipelineEvent::Level::kWarn, "velocity of the receiver left out: not finite, or beyond 150 m/s");
    return;
  }
  if (last_odometry_ && to_seconds(raw.stamp - last_odometry_->stamp) > kMaxAhead_s) {
    event(PipelineEvent::Level::kWarn,
          "velocity of the receiver left out: more than " + seconds_text(kMaxAhead_s) + " ahead of the odometry");
    return;
  }
  if (!is_new(velocity_stamps_, raw.stamp, "velocities")) {
    event(PipelineEvent::Level::kWarn, "velocity of the receiver left out: not newer than the last");
    return;
  }
  RawVelocity velocity = raw;
  const double floor = parameters_.velocity_sigma_floor;
  const double fallback = parameters_.velocity_sigma_default;
  if (is_positive_definite<2>(raw.covariance)) {
    velocity.covariance += floor * floor * Eigen::Matrix2d::Identity();
  } else {
    velocity.covariance = fallback * fallback * Eigen::Matrix2d::Identity();
  }
  if (pending_velocities_.size() >= kMaxWaitingFixes) pending_velocities_.pop_front();
  pending_velocities_.push_back(velocity);
  process_velocities();
}

void LocalizationPipeline::process_velocities() {
  while (!pending_velocities_.empty() && !history_.empty() && pending_velocities_.front().stamp <= history_.latest()) {
    const RawVelocity velocity = pending_velocities_.front();
    pending_velocities_.pop_front();
    const auto then = history_.pose_at(velocity.stamp);
    if (!then) {
      event(PipelineEvent::Level::kWarn,
            "velocity of the receiver left out: older than the odometry that is remembered");
      continue;
    }
    const Twist2 twist = *history_.twist_at(velocity.stamp);
    const Eigen::Vector2d lever = antenna_offset();
    const Eigen::Vector2d in_base(twist.speed_mps - twist.yaw_rate_radps * lever.y(), twist.yaw_rate_radps * lever.x());
    const Pose2 turn{0.0, 0.0, then->yaw};
    heading_initializer_.add_velocity(
        {velocity.stamp, transform_point(turn, in_base), velocity.velocity, velocity.covariance});
    if (!initialized_) continue;
    VelocityMeasurement measurement;
    measurement.velocity = velocity.velocity;
    measurement.covariance = velocity.covariance;
    const Pose2 turn_since{0.0, 0.0, then->yaw - history_.pose_at(history_.latest())->yaw};
    measurement.antenna_velocity_in_body = transform_point(turn_since, in_base);
    localizer_->correct_velocity(measurement);
    ++velocities_used_;
    guard_against_non_finite();
  }
}

}  // namespace urban_gnss
