#include "urban_gnss_localization/experiments/faulty_participant.hpp"

#include <cmath>

namespace urban_gnss {
namespace {

/// The robot turns while its yaw rate is above this.
constexpr double kTurning_radps = 0.1;
constexpr double kSharpTurn_rad = 0.3;

std::optional<Stamp> known_begin(FaultBegin begin, Stamp onset) {
  switch (begin) {
    case FaultBegin::kOnset: return onset;
    case FaultBegin::kTurn: return std::nullopt;
    case FaultBegin::kStart: return Stamp::min();
  }
  return std::nullopt;
}

}  // namespace

FaultyParticipant::FaultyParticipant(const InputFault& fault, Stamp onset, LocalizingParticipant& told)
    : fault_(fault), onset_(onset), told_(told), begin_(known_begin(fault.begin, onset)) {}

bool FaultyParticipant::is_present(Stamp stamp) const {
  if (!begin_ || stamp < *begin_) return false;
  return std::isinf(fault_.duration_s) || stamp < *begin_ + from_seconds(fault_.duration_s);
}

void FaultyParticipant::look_for_turn(const OdometrySample& sample, double elapsed_s) {
  const double yaw_rate_radps = sample.twist.yaw_rate_radps;
  const bool goes_on = std::abs(yaw_rate_radps) > kTurning_radps && yaw_rate_radps * turned_rad_ >= 0.0;
  turned_rad_ = goes_on ? turned_rad_ + yaw_rate_radps * elapsed_s : 0.0;
  if (!begin_ && sample.stamp >= onset_ && std::abs(turned_rad_) > kSharpTurn_rad) begin_ = sample.stamp;
}

void FaultyParticipant::strike_once(Stamp stamp) {
  if (has_struck_ || !begin_ || stamp < *begin_) return;
  has_struck_ = true;
  if (fault_.pose_offset_m != 0.0) told_.set_pose_aside(fault_.pose_offset_m);
  if (fault_.antenna_offset_m != 0.0) told_.move_antenna(fault_.antenna_offset_m);
}

void FaultyParticipant::add_imu_yaw_rate(Stamp stamp, double yaw_rate_radps) {
  told_.add_imu_yaw_rate(stamp, yaw_rate_radps + (is_present(stamp) ? fault_.gyro_offset_radps : 0.0));
}

void FaultyParticipant::add_odometry(const OdometrySample& sample) {
  const double elapsed_s = last_told_ ? to_seconds(sample.stamp - last_told_->stamp) : 0.0;
  look_for_turn(sample, elapsed_s);
  strike_once(sample.stamp);
  OdometrySample told = sample;
  if (fault_.wheels && is_present(sample.stamp)) {
    told.twist = fault_.wheels(sample.twist);
    told.pose = last_told_ ? move(last_told_->pose, told.twist, elapsed_s) : sample.pose;
    odom_error_ = compose(told.pose, inverse(sample.pose));
  } else {
    told.pose = compose(odom_error_, sample.pose);
  }
  last_told_ = told;
  told_.add_odometry(told);
  tell_late_epochs(told.pose);
}

void FaultyParticipant::tell_late_epochs(const Pose2& base_in_odom) {
  for (; !late_epochs_.empty() && late_epochs_.front().stamp <= last_told_->stamp; late_epochs_.pop_front()) {
    told_.add_epoch(late_epochs_.front(), base_in_odom);
  }
}

void FaultyParticipant::add_cloud(Stamp stamp, const PointCloud& cloud, const Eigen::Isometry3d& sensor_in_base,
                                  const Pose2& base_in_odom) {
  told_.add_cloud(stamp, cloud, sensor_in_base, compose(odom_error_, base_in_odom));
}

void FaultyParticipant::add_epoch(const DriveEpoch& epoch, const Pose2& base_in_odom) {
  if (fault_.fix_delay_s == 0.0 || !is_present(epoch.stamp)) {
    told_.add_epoch(epoch, compose(odom_error_, base_in_odom));
    return;
  }
  late_epochs_.push_back(epoch);
  late_epochs_.back().stamp += from_seconds(fault_.fix_delay_s);
}

}  // namespace urban_gnss
