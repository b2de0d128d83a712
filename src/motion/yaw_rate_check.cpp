#include "urban_gnss_localization/motion/yaw_rate_check.hpp"

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/motion/standstill.hpp"

namespace urban_gnss {
namespace {

/// Two yaw rates contradict each other by this and a share of the slower one; once they do, by less.
constexpr double kBegin_radps = 0.3;
constexpr double kBeginShare = 1.0;
constexpr double kEnd_radps = 0.2;
constexpr double kEndShare = 0.5;
/// Both turn by more than this where they agree in a turn.
constexpr double kTurns_radps = 0.1;
/// For which the odometry must have told a yaw rate, or agreed with the IMU's.
constexpr double kProven_s = 1.0;
/// Share of the difference by which the IMU's rate changes in one step where it jumps.
constexpr double kJumpShare = 0.5;

}  // namespace

bool YawRateArbiter::contradict(double odometry_radps, double imu_radps) const {
  const double slower_radps = std::min(std::abs(odometry_radps), std::abs(imu_radps));
  const bool did = fault_ != YawRateFault::kNone;
  const double limit_radps = did ? kEnd_radps + kEndShare * slower_radps : kBegin_radps + kBeginShare * slower_radps;
  return std::abs(imu_radps - odometry_radps) > limit_radps;
}

YawRateFault YawRateArbiter::judge(const Twist2& odometry, double imu_radps) const {
  const double difference_radps = std::abs(imu_radps - odometry.yaw_rate_radps);
  const bool jumped = last_imu_radps_ && std::abs(imu_radps - *last_imu_radps_) > kJumpShare * difference_radps;
  const bool rolls = std::abs(odometry.speed_mps) > kStandstillMean_mps;
  if (jumped && rolls && told_s_ >= kProven_s) return YawRateFault::kImu;
  return agreed_s_ >= kProven_s ? YawRateFault::kOdometry : YawRateFault::kNone;
}

YawRateFault YawRateArbiter::add(const Twist2& odometry, double imu_radps, double duration_s) {
  const double odometry_radps = odometry.yaw_rate_radps;
  if (contradict(odometry_radps, imu_radps)) {
    if (fault_ == YawRateFault::kNone) fault_ = judge(odometry, imu_radps);
    if (fault_ != YawRateFault::kNone) lasted_s_ += duration_s;
  } else {
    fault_ = YawRateFault::kNone;
    lasted_s_ = 0.0;
    const bool turn_alike =
        odometry_radps * imu_radps > 0.0 && std::min(std::abs(odometry_radps), std::abs(imu_radps)) > kTurns_radps;
    if (turn_alike) agreed_s_ += duration_s;
  }
  if (odometry_radps != 0.0) told_s_ += duration_s;
  last_imu_radps_ = imu_radps;
  return fault_;
}

}  // namespace urban_gnss
