#include "urban_gnss_localization/filters/dead_reckoning.hpp"

#include <cmath>

namespace urban_gnss {
namespace {

double square(double value) { return value * value; }

}  // namespace

bool is_standstill(const Twist2& twist) {
  constexpr double kStandstill_mps = 1e-3;
  constexpr double kStandstill_radps = 1e-4;
  return std::abs(twist.speed_mps) < kStandstill_mps && std::abs(twist.yaw_rate_radps) < kStandstill_radps;
}

DeadReckoningStep dead_reckon(const Pose2& pose, const OdometryErrors& errors, const Twist2& measured,
                              double duration_s, const DeadReckoningParameters& p) {
  DeadReckoningStep step;
  step.transition.setIdentity();
  step.noise.setZero();
  if (p.estimate_odometry_errors) {
    step.noise(3, 3) = square(p.odom_scale_walk) * duration_s;
    step.noise(4, 4) = square(p.odom_yaw_bias_walk) * duration_s;
  }
  if (is_standstill(measured)) {
    step.pose = pose;
    return step;
  }
  const Twist2 corrected{(1.0 + errors.speed_scale) * measured.speed_mps,
                         measured.yaw_rate_radps + errors.yaw_rate_bias_radps};
  step.pose = move(pose, corrected, duration_s);

  const double dx = step.pose.x - pose.x;
  const double dy = step.pose.y - pose.y;
  step.transition(0, 2) = -dy;
  step.transition(1, 2) = dx;
  // Of a distance, along the chord; of a turn, half of it shows in the chord's direction.
  const double chord_yaw = pose.yaw + 0.5 * corrected.yaw_rate_radps * duration_s;
  const Eigen::Vector2d along(std::cos(chord_yaw), std::sin(chord_yaw));
  const Eigen::Vector2d by_turn(-0.5 * dy, 0.5 * dx);
  Eigen::Matrix<double, 3, 2> k;  // columns: of a distance (m), of a turn (rad)
  k << along, by_turn, 0.0, 1.0;
  if (p.estimate_odometry_errors) {
    step.transition.block<3, 1>(0, 3) = k.col(0) * measured.speed_mps * duration_s;
    step.transition.block<3, 1>(0, 4) = k.col(1) * duration_s;
  }
  const Eigen::Vector2d sigma_v(square(p.odom_speed_noise * measured.speed_mps) * duration_s,
                                square(p.odom_yaw_rate_noise * measured.yaw_rate_radps) * duration_s);
  const Eigen::Vector3d sigma_n(square(p.odom_position_noise) * duration_s, square(p.odom_position_noise) * duration_s,
                                square(p.odom_heading_noise) * duration_s);
  step.noise.topLeftCorner<3, 3>() = k * sigma_v.asDiagonal() * k.transpose();
  step.noise.topLeftCorner<3, 3>().diagonal() += sigma_n;
  return step;
}

ErrorCovariance initial_error_covariance(const Eigen::Matrix3d& pose_covariance, const DeadReckoningParameters& p) {
  ErrorCovariance covariance = ErrorCovariance::Zero();
  covariance.topLeftCorner<3, 3>() = pose_covariance;
  if (p.estimate_odometry_errors) {
    covariance(3, 3) = square(p.odom_scale_sigma);
    covariance(4, 4) = square(p.odom_yaw_bias_sigma);
  }
  return covariance;
}

}  // namespace urban_gnss
