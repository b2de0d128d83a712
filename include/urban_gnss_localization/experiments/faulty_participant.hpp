#pragma once

#include <deque>
#include <optional>

#include "urban_gnss_localization/experiments/city_drive.hpp"
#include "urban_gnss_localization/experiments/input_faults.hpp"

namespace urban_gnss {

/// A participant that can be told its pose and its antenna's place.
class LocalizingParticipant : public DriveParticipant {
 public:
  /// Sets its pose to the left of where it takes itself to be, with the covariance of rviz's "2D Pose Estimate".
  virtual void set_pose_aside(double left_m) = 0;
  /// Places its antenna ahead of where it took it to be.
  virtual void move_antenna(double forward_m) = 0;
};

/// Stands between a drive and a participant, and changes what the participant is told as the fault says.
///
/// While the wheels are wrong, the odometry's pose is integrated from their wrong twists, so that it stays wrong after
/// the fault.
class FaultyParticipant : public DriveParticipant {
 public:
  /// `told` must outlive this. `onset`: the time that FaultBegin speaks of.
  FaultyParticipant(const InputFault& fault, Stamp onset, LocalizingParticipant& told);

  bool wants_clouds() const override { return told_.wants_clouds(); }
  void add_imu_yaw_rate(Stamp stamp, double yaw_rate_radps) override;
  void add_imu_heading(const HeadingSample& heading) override { told_.add_imu_heading(heading); }
  void add_odometry(const OdometrySample& sample) override;
  void add_cloud(Stamp stamp, const PointCloud& cloud, const Eigen::Isometry3d& sensor_in_base,
                 const Pose2& base_in_odom) override;
  void add_epoch(const DriveEpoch& epoch, const Pose2& base_in_odom) override;

  /// When the fault began; nothing: it waits for a turn.
  const std::optional<Stamp>& begin() const { return begin_; }

 private:
  bool is_present(Stamp stamp) const;
  void look_for_turn(const OdometrySample& sample, double elapsed_s);
  void strike_once(Stamp stamp);
  void tell_late_epochs(const Pose2& base_in_odom);

  InputFault fault_;
  Stamp onset_;
  LocalizingParticipant& told_;
  std::optional<Stamp> begin_;
  bool has_struck_{false};
  double turned_rad_{0.0};  ///< in the present turn
  std::optional<OdometrySample> last_told_;
  Pose2 odom_error_;                    ///< the pose that is told is this, followed by the odometry's own
  std::deque<DriveEpoch> late_epochs_;  ///< with the stamps at which they come
};

}  // namespace urban_gnss
