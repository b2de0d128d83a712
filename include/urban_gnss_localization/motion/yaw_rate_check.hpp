#pragma once

#include <optional>

#include "urban_gnss_localization/motion/motion_model.hpp"

namespace urban_gnss {

/// Which of two yaw rates contradicts the other.
enum class YawRateFault {
  kNone,
  kImu,       ///< it jumped, and the wheels did not: a gyroscope's glitch or step
  kOdometry,  ///< the wheels turn, or do not, where the robot does the opposite: one dead, or slipping
};

/// Tells which yaw rate is wrong where IMU and odometry contradict each other grossly: the IMU's where it jumped within
/// one step while the wheels rolled on, else the odometry's. Some odometry tells no yaw rate at all: it has a say
/// against the IMU once it has told one, and is wrong only once it has agreed with the IMU in a turn. Wheels that skid
/// turn up to twice as fast as the robot; that is no contradiction.
class YawRateArbiter {
 public:
  /// One step with both rates.
  YawRateFault add(const Twist2& odometry, double imu_radps, double duration_s);

  YawRateFault fault() const { return fault_; }
  /// s since the contradiction began; 0 where there is none.
  double lasted_s() const { return lasted_s_; }

 private:
  bool contradict(double odometry_radps, double imu_radps) const;
  /// Which of them is wrong, at the first step of a contradiction.
  YawRateFault judge(const Twist2& odometry, double imu_radps) const;

  double told_s_{0.0};    ///< in which the odometry told a yaw rate other than 0
  double agreed_s_{0.0};  ///< of turning
  std::optional<double> last_imu_radps_;
  YawRateFault fault_{YawRateFault::kNone};
  double lasted_s_{0.0};
};

}  // namespace urban_gnss
