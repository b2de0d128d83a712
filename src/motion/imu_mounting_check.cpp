#include "urban_gnss_localization/motion/imu_mounting_check.hpp"

#include <cmath>

namespace urban_gnss {
namespace {

constexpr double kTurning_radps = 0.05;  ///< odometry that turns slower than this tells nothing
constexpr double kWindow_s = 2.0;
constexpr double kWindow_rad = 0.6;
/// Wheels that skid turn up to twice as fast as the robot.
constexpr double kLeastFactor = 0.3;
constexpr double kMostFactor = 2.5;
constexpr double kNoFactor = 0.25;
constexpr double kLeastDegrees = 30.0;
constexpr double kMostDegrees = 110.0;
/// Squared correlation above which a factor is one.
constexpr double kCoherent = 0.5;
/// Square of the share of the odometry's turn that an IMU sees about some axis, if it turns at all.
constexpr double kTurns = 0.25;

bool fits(double factor) { return factor > kLeastFactor && factor < kMostFactor; }

}  // namespace

ImuVerdict ImuMountingCheck::judge(const Window& w) {
  const double factor = w.told_product / w.odometry_square;
  if (fits(factor)) return ImuVerdict::kFits;
  if (w.has_gravity && fits(w.gravity_product / w.odometry_square)) return ImuVerdict::kGravityFits;
  if (w.any_square == 0.0) return ImuVerdict::kStill;
  if (std::abs(factor) < kNoFactor) {
    return w.any_square > kTurns * w.odometry_square ? ImuVerdict::kNotVertical : ImuVerdict::kUnknown;
  }
  if (w.told_product * w.told_product < kCoherent * w.told_square * w.odometry_square) return ImuVerdict::kUnknown;
  if (factor < -kLeastFactor && factor > -kMostFactor) return ImuVerdict::kReversed;
  if (std::abs(factor) > kLeastDegrees && std::abs(factor) < kMostDegrees) return ImuVerdict::kDegrees;
  return ImuVerdict::kScaled;
}

bool ImuMountingCheck::add(double odometry_radps, const ImuYawRate& imu, double duration_s) {
  if (verdict_ == ImuVerdict::kFits || std::abs(odometry_radps) < kTurning_radps) return false;
  window_.turning_s += duration_s;
  window_.turned_rad += std::abs(odometry_radps) * duration_s;
  window_.odometry_square += odometry_radps * odometry_radps * duration_s;
  window_.told_square += imu.told_radps * imu.told_radps * duration_s;
  window_.any_square += imu.any_axis_radps * imu.any_axis_radps * duration_s;
  window_.told_product += odometry_radps * imu.told_radps * duration_s;
  window_.gravity_product += odometry_radps * imu.by_gravity_radps.value_or(0.0) * duration_s;
  window_.has_gravity = window_.has_gravity && imu.by_gravity_radps.has_value();
  if (window_.turning_s < kWindow_s || window_.turned_rad < kWindow_rad) return false;
  factor_ = window_.told_product / window_.odometry_square;
  const ImuVerdict found = judge(window_);
  window_ = {};
  const bool is_new = found == last_ && found != verdict_ && found != ImuVerdict::kUnknown;
  if (is_new) verdict_ = found;
  last_ = found;
  return is_new;
}

}  // namespace urban_gnss
