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

/// Which of two yaw rates contradicts the other.
enum class YawRateFault {
  kNone,
  kImu,       ///< it changed at once, and the wheels did not: a gyroscope's glitch or step
  kOdometry,  ///< the wheels changed at once, or were wrong from the start: one dead, or slipping
};

/// Tells which yaw rate is wrong where IMU and odometry contradict each other grossly: the one that has changed more
/// since they agreed. Wheels that skid turn up to twice as fast as the robot; that is no contradiction.
class YawRateArbiter {
 public:
  /// One step with both rates.
  YawRateFault add(double odometry_radps, double imu_radps, double duration_s);

  YawRateFault fault() const { return fault_; }
  /// s since the contradiction began; 0 where there is none.
  double lasted_s() const { return lasted_s_; }

 private:
  /// Both rates (rad/s) a moment ago, while they agreed.
  struct Agreement {
    double odometry_radps{0.0};
    double imu_radps{0.0};
  };
  std::optional<Agreement> agreement_;
  YawRateFault fault_{YawRateFault::kNone};
  double lasted_s_{0.0};
};

}  // namespace urban_gnss
