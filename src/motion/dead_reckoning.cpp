#include "urban_gnss_localization/motion/dead_reckoning.hpp"

#include <cmath>

#include "urban_gnss_localization/motion/standstill.hpp"

namespace urban_gnss {
namespace {

double square(double value) { return value * value; }

Pose2 move_along_tangent(const Pose2& pose, const Twist2& twist, double duration_s) {
  const Eigen::Vector2d moved = transform_point(pose, {twist.speed_mps * duration_s, twist.lateral_mps * duration_s});
  return {moved.x(), moved.y(), wrap_angle(pose.yaw + twist.yaw_rate_radps * duration_s)};
}

/// Moves at the corrected twist and fills pose and transition; returns how a distance (m) and a turn (rad) show in the
/// pose, as columns.
Eigen::Matrix<double, 3, 2> linearise(const Pose2& pose, const OdometryErrors& errors, const MotionStep& motion,
                                      StepPath path, DeadReckoningStep& step) {
  const Twist2& measured = motion.twist;
  const double duration_s = motion.duration_s;
  const Twist2 twist = corrected(measured, errors);
  const bool is_chord = path == StepPath::kChord;
  step.pose = is_chord ? move(pose, twist, duration_s) : move_along_tangent(pose, twist, duration_s);
  const double dx = step.pose.x - pose.x;
  const double dy = step.pose.y - pose.y;
  step.transition.setIdentity();
  step.transition(0, 2) = -dy;
  step.transition(1, 2) = dx;
  // Of a distance, along the path; of a turn, half of it shows in the chord's direction, nothing in the tangent's.
  const double shown = is_chord ? 0.5 : 0.0;
  const Pose2 straight{0.0, 0.0, pose.yaw + shown * twist.yaw_rate_radps * duration_s};
  const Eigen::Vector2d along = transform_point(straight, motion.direction);
  Eigen::Matrix<double, 3, 2> k;
  k << along.x(), -shown * dy, along.y(), shown * dx, 0.0, 1.0;
  const Eigen::Vector2d velocity = transform_point(straight, {measured.speed_mps, measured.lateral_mps});
  step.transition.block<3, 1>(0, 3) << velocity * duration_s, 0.0;
  step.transition.block<3, 1>(0, 4) = k.col(1) * duration_s;
  step.yaw_rate_scale = k.col(1) * measured.yaw_rate_radps * duration_s;
  return k;
}

}  // namespace

DeadReckoningStep dead_reckon(const Pose2& pose, const OdometryErrors& errors, const MotionStep& motion,
                              const OdometryErrorParameters& p, StepPath path) {
  const double dt = motion.duration_s;
  DeadReckoningStep step;
  step.noise.setZero();
  step.yaw_rate_scale.setZero();
  if (is_standstill(motion.twist, p.standstill_radps)) {
    step.pose = pose;
    step.transition.setIdentity();
    step.noise(0, 0) = step.noise(1, 1) = square(p.parked_walk) * dt;
    return step;
  }
  const auto k = linearise(pose, errors, motion, path, step);
  // Of the noise of speed and second input, the distance (m) and the turn (rad); the disturbance turns afterwards.
  Eigen::Matrix2d by_input;
  if (motion.model == MotionModel::kBicycle) {
    const double tangent = std::tan(motion.steering_rad);
    by_input << 1.0, 0.0, tangent / motion.wheelbase_m,
        motion.twist.speed_mps * (1.0 + tangent * tangent) / motion.wheelbase_m;
  } else {
    by_input.setIdentity();
  }
  const Eigen::Vector2d sigmas(motion.speed_sigma * dt, motion.input_sigma * dt);
  const Eigen::Matrix<double, 3, 2> root = k * by_input * sigmas.asDiagonal();
  step.noise.topLeftCorner<3, 3>() = root * root.transpose();
  step.noise(0, 0) += square(p.position_walk) * dt;
  step.noise(1, 1) += square(p.position_walk) * dt;
  step.noise(2, 2) += square(motion.yaw_rate_sigma * dt) + square(p.heading_walk) * dt;
  step.noise(3, 3) = square(p.speed_scale_walk) * dt;
  step.noise(4, 4) = square(p.yaw_rate_bias_walk) * dt;
  return step;
}

ErrorCovariance initial_error_covariance(const Eigen::Matrix3d& pose_covariance, const OdometryErrorParameters& p) {
  ErrorCovariance covariance = ErrorCovariance::Zero();
  covariance.topLeftCorner<3, 3>() = pose_covariance;
  covariance(3, 3) = square(p.speed_scale_sigma);
  covariance(4, 4) = square(p.yaw_rate_bias_sigma);
  return covariance;
}

}  // namespace urban_gnss
