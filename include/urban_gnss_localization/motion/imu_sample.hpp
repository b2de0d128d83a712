#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/motion/imu_heading.hpp"

namespace urban_gnss {

/// What an IMU says, in its own frame.
struct ImuSample {
  Stamp stamp{0};
  Eigen::Vector3d rate_radps{Eigen::Vector3d::Zero()};
  Eigen::Vector3d acceleration_mps2{Eigen::Vector3d::Zero()};  ///< specific force: up at rest; 0: not measured
  /// Of the IMU in a level frame, x east and y north by REP-103, where it tells one.
  std::optional<Eigen::Quaterniond> orientation{};
  double heading_sigma_rad{0.0};  ///< of the orientation about the vertical, as declared; 0: not declared
};

/// A yaw rate, counter-clockwise from above, by what is told of how the IMU is mounted, and by gravity.
struct ImuYawRate {
  Stamp stamp{0};
  double told_radps{0.0};                  ///< about the axis that is up by the IMU's orientation, or its mounting
  std::optional<double> by_gravity_radps;  ///< about the axis that is up by the accelerometer, where that tells one
  double any_axis_radps{0.0};              ///< >= 0: about whatever axis
};

/// Turns an IMU's angular velocity into the robot's yaw rate. Up is, in this order, what the message's own orientation
/// says, what the mounting says (tf base_link <- the IMU's frame), or the IMU's z axis. Beside that it is followed
/// which axis gravity says is up.
class ImuLeveller {
 public:
  /// The IMU in the base frame, as tf says it. Requires a unit quaternion.
  void set_mounting(const Eigen::Quaterniond& base_from_imu) { base_from_imu_ = base_from_imu; }
  bool has_mounting() const { return base_from_imu_.has_value(); }

  /// Requires finite numbers.
  ImuYawRate yaw_rate(const ImuSample& sample);
  /// The base's heading by the IMU's orientation and mounting; without a mounting, the IMU's axes are the base's.
  /// Nothing without an orientation, and where the base's x axis would point up or down.
  std::optional<HeadingSample> heading(const ImuSample& sample) const;
  /// Forgets gravity, not the mounting.
  void reset() { gravity_.reset(); }

 private:
  std::optional<Eigen::Quaterniond> base_from_imu_;
  std::optional<Eigen::Vector3d> gravity_;  ///< m/s^2, mean of the last seconds
  Stamp last_{0};
};

}  // namespace urban_gnss
