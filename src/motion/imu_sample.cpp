#include "urban_gnss_localization/motion/imu_sample.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {
namespace {

/// Over which the accelerations of driving average out.
constexpr double kGravityMean_s = 5.0;
constexpr double kLeastGravity_mps2 = 8.0;
constexpr double kMostGravity_mps2 = 11.5;
/// Of the base's x axis: one that is shorter has no direction.
constexpr double kLeastHorizontal = 0.3;

/// A quaternion of (0, 0, 0, 1) is rather one that was never filled in than an IMU that is exactly level.
bool is_oriented(const ImuSample& sample) { return sample.orientation && sample.orientation->vec().norm() > 0.0; }

}  // namespace

ImuYawRate ImuLeveller::yaw_rate(const ImuSample& sample) {
  const double elapsed_s = std::clamp(to_seconds(sample.stamp - last_), 0.0, kGravityMean_s);
  last_ = sample.stamp;
  if (!gravity_) gravity_ = sample.acceleration_mps2;
  *gravity_ += elapsed_s / kGravityMean_s * (sample.acceleration_mps2 - *gravity_);

  ImuYawRate rate;
  rate.stamp = sample.stamp;
  rate.any_axis_radps = sample.rate_radps.norm();
  const std::optional<Eigen::Quaterniond>& to_level = is_oriented(sample) ? sample.orientation : base_from_imu_;
  rate.told_radps = to_level ? (*to_level * sample.rate_radps).z() : sample.rate_radps.z();
  const double strength_mps2 = gravity_->norm();
  if (strength_mps2 > kLeastGravity_mps2 && strength_mps2 < kMostGravity_mps2) {
    rate.by_gravity_radps = sample.rate_radps.dot(*gravity_) / strength_mps2;
  }
  return rate;
}

std::optional<HeadingSample> ImuLeveller::heading(const ImuSample& sample) const {
  if (!is_oriented(sample)) return std::nullopt;
  const Eigen::Quaterniond imu_from_base =
      base_from_imu_ ? base_from_imu_->conjugate() : Eigen::Quaterniond::Identity();
  const Eigen::Vector3d forward = *sample.orientation * (imu_from_base * Eigen::Vector3d::UnitX());
  if (!(forward.head<2>().norm() > kLeastHorizontal)) return std::nullopt;
  return HeadingSample{sample.stamp, std::atan2(forward.y(), forward.x()), sample.heading_sigma_rad};
}

}  // namespace urban_gnss
