#pragma once

#include <optional>

namespace urban_gnss {

/// Compares the yaw rate of an IMU with that of the odometry, to find an IMU that is mounted upside down or reports
/// degrees. While the odometry turns, the IMU's rate is fitted as a factor times the odometry's.
class YawRateCheck {
 public:
  /// Odometry that turns slower than this (rad/s) tells nothing.
  static constexpr double kTurning_radps = 0.05;
  /// s of turning that a factor is fitted to.
  static constexpr double kTurningTime_s = 60.0;

  /// One step with both rates. The factor, each time that enough turning has come together since the last.
  std::optional<double> add(double odometry_radps, double imu_radps, double duration_s);

 private:
  double turning_s_{0.0};
  double cross_{0.0};   ///< rad^2/s
  double square_{0.0};  ///< rad^2/s, of the odometry
};

}  // namespace urban_gnss
