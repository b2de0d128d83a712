#pragma once

#include <array>
#include <cstddef>
#include <deque>
#include <functional>
#include <optional>

#include "urban_gnss_localization/common/stamp.hpp"

namespace urban_gnss {

/// Finds by how much the clock of an IMU is ahead of the odometry's, from the yaw rates of both: the lag at which the
/// one looks most like a multiple of the other. A robot that turns evenly says nothing.
class RateLagSearch {
 public:
  static constexpr int kMostSteps = 40;
  static constexpr double kStep_s = 0.1;
  /// The rate of the IMU at a stamp of its own clock, rad/s; nothing where it is not known.
  using RateAt = std::function<std::optional<double>(Stamp)>;

  /// A rate of the odometry (rad/s); stamps ascend. Whether it adds to what lead_s() knows.
  bool add(Stamp stamp, double odometry_radps, const RateAt& imu_at);
  /// Whether the robot has turned for long enough to tell: without a lead_s() the clocks agree.
  bool has_turned_enough() const { return count_ >= kLeastCount; }
  /// s by which the IMU's stamps are ahead; nothing until it is clear that they are off.
  std::optional<double> lead_s() const;

 private:
  static constexpr int kLeastCount = 200;
  static constexpr std::size_t kLags = 2 * kMostSteps + 1;
  struct Rate {
    Stamp stamp;
    double radps;
  };
  std::deque<Rate> waiting_;  ///< until the IMU's rates around it are known
  std::optional<Stamp> last_;
  int count_{0};
  double odometry_square_{0.0};
  std::array<double, kLags> imu_square_{};
  std::array<double, kLags> product_{};
};

}  // namespace urban_gnss
