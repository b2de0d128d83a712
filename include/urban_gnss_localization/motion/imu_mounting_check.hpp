#pragma once

#include "urban_gnss_localization/motion/imu_sample.hpp"

namespace urban_gnss {

/// Whether an IMU's yaw rate is that of the robot.
enum class ImuVerdict {
  kUnknown,
  kFits,         ///< as it is told to be mounted
  kGravityFits,  ///< only about the axis that gravity says is up
  kNotVertical,  ///< it turns, but about another axis
  kReversed,     ///< NED, or upside down
  kDegrees,
  kScaled,
  kStill,  ///< exactly 0 about all axes
};

/// Compares an IMU with the yaw rate of the odometry while the robot turns: a factor of about 1 fits, near 0 its axis
/// is not vertical, near -1 it is upside down or NED, near 57 it tells degrees. A window has 0.6 rad and 2 s of
/// turning; two in a row with the same result decide. An IMU that fits is not doubted any more: wheels that slip, or
/// one that dies, turn the odometry where the robot does not turn. One that does not fit is looked at on.
class ImuMountingCheck {
 public:
  /// One step with both; says whether the verdict is another one than before.
  bool add(double odometry_radps, const ImuYawRate& imu, double duration_s);
  ImuVerdict verdict() const { return verdict_; }
  /// Of the last window: the IMU's rate over the odometry's, as it is told to be mounted.
  double factor() const { return factor_; }

 private:
  struct Window {
    double turning_s{0.0}, turned_rad{0.0};
    double odometry_square{0.0}, told_square{0.0}, any_square{0.0};
    double told_product{0.0}, gravity_product{0.0};
    bool has_gravity{true};
  };
  static ImuVerdict judge(const Window& window);

  Window window_;
  ImuVerdict last_{ImuVerdict::kUnknown};
  ImuVerdict verdict_{ImuVerdict::kUnknown};
  double factor_{0.0};
};

}  // namespace urban_gnss
