#pragma once

#include "urban_gnss_localization/motion/motion_model.hpp"

namespace urban_gnss {

/// Speed below which wheels stand: those that do report exactly 0, or the rounding of a tick.
inline constexpr double kStandstill_mps = 1e-3;
/// Yaw rate that may be left at a standstill: the offset of a gyroscope, up to 0.6 degrees a second.
inline constexpr double kStandstill_radps = 0.01;
/// Below this mean speed between two fixes the robot stood. The jitter of odometry from lidar or cameras adds up to
/// some centimetres a second, and a robot that creeps more slowly still meets the same reflections.
inline constexpr double kStandstillMean_mps = 0.05;

/// Whether the robot stands during a step of odometry, which then has no error, neither noise nor bias. A method whose
/// yaw rate is the wheels' may be stricter than `yaw_rate_limit_radps` is by default.
bool is_standstill(const Twist2& twist, double yaw_rate_limit_radps = kStandstill_radps);

/// What the odometry says of the time since some event, such as the last fix.
struct Travel {
  double distance_m{0.0};  ///< forwards and backwards alike
  double duration_s{0.0};

  void add(const Twist2& twist, double step_s);
  /// Whether the robot stood on the whole; false where no time has passed.
  bool is_standstill() const;
};

}  // namespace urban_gnss
