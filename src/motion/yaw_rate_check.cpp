#include "urban_gnss_localization/motion/yaw_rate_check.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {
namespace {

/// Two yaw rates contradict each other by this and a share of the slower one; once they do, by less.
constexpr double kBegin_radps = 0.3;
constexpr double kBeginShare = 1.0;
constexpr double kEnd_radps = 0.2;
constexpr double kEndShare = 0.5;
/// Over which both rates are averaged while they agree.
constexpr double kMemory_s = 0.5;

}  // namespace

std::optional<double> YawRateCheck::add(double odometry_radps, double imu_radps, double duration_s) {
  if (std::abs(odometry_radps) < kTurning_radps) return std::nullopt;
  turning_s_ += duration_s;
  cross_ += odometry_radps * imu_radps * duration_s;
  square_ += odometry_radps * odometry_radps * duration_s;
  if (turning_s_ < kTurningTime_s) return std::nullopt;
  const double factor = cross_ / square_;
  *this = {};
  return factor;
}

YawRateFault YawRateArbiter::add(double odometry_radps, double imu_radps, double duration_s) {
  const double slower_radps = std::min(std::abs(odometry_radps), std::abs(imu_radps));
  const bool was_wrong = fault_ != YawRateFault::kNone;
  const double limit_radps =
      was_wrong ? kEnd_radps + kEndShare * slower_radps : kBegin_radps + kBeginShare * slower_radps;
  if (std::abs(imu_radps - odometry_radps) <= limit_radps) {
    if (!agreement_ || was_wrong) agreement_ = {odometry_radps, imu_radps};
    const double rate = 1.0 - std::exp(-duration_s / kMemory_s);
    agreement_->odometry_radps += rate * (odometry_radps - agreement_->odometry_radps);
    agreement_->imu_radps += rate * (imu_radps - agreement_->imu_radps);
    fault_ = YawRateFault::kNone;
    lasted_s_ = 0.0;
    return fault_;
  }
  if (!was_wrong) {
    const bool imu_changed = agreement_ && std::abs(imu_radps - agreement_->imu_radps) >
                                               std::abs(odometry_radps - agreement_->odometry_radps);
    fault_ = imu_changed ? YawRateFault::kImu : YawRateFault::kOdometry;
  }
  lasted_s_ += duration_s;
  return fault_;
}

}  // namespace urban_gnss
