#include "urban_gnss_localization/motion/motion_model.hpp"

#include <cmath>

#include "urban_gnss_localization/motion/standstill.hpp"

namespace urban_gnss {

EnumNames<MotionModel> enum_names(MotionModel) {
  return {{"bicycle", MotionModel::kBicycle}, {"velocity", MotionModel::kVelocity}};
}

double yaw_rate(const BicycleInput& input, double wheelbase_m) {
  return input.speed_mps / wheelbase_m * std::tan(input.steering_rad);
}

BicycleInput bicycle_input(const Twist2& twist, double wheelbase_m) {
  if (std::abs(twist.speed_mps) < kStandstill_mps) return {twist.speed_mps, 0.0};
  return {twist.speed_mps, std::atan(wheelbase_m * twist.yaw_rate_radps / twist.speed_mps)};
}

Pose2 move(const Pose2& pose, const Twist2& twist, double duration_s) {
  const double half_turn = 0.5 * twist.yaw_rate_radps * duration_s;
  const double sinc = std::abs(half_turn) < 1e-4 ? 1.0 - half_turn * half_turn / 6.0 : std::sin(half_turn) / half_turn;
  const double chord = twist.speed_mps * duration_s * sinc;
  const double sideways = twist.lateral_mps * duration_s * sinc;
  const double c = std::cos(pose.yaw + half_turn);
  const double s = std::sin(pose.yaw + half_turn);
  return {pose.x + chord * c - sideways * s, pose.y + chord * s + sideways * c, wrap_angle(pose.yaw + 2.0 * half_turn)};
}

Twist2 twist_between(const Pose2& from, const Pose2& to, double duration_s) {
  const double turn = angle_difference(to.yaw, from.yaw);
  const double sinc = std::abs(turn) < 2e-4 ? 1.0 - turn * turn / 24.0 : 2.0 * std::sin(0.5 * turn) / turn;
  const double yaw = from.yaw + 0.5 * turn;
  const double scale = 1.0 / (sinc * duration_s);
  const Eigen::Vector2d way = to.position() - from.position();
  return {(way.x() * std::cos(yaw) + way.y() * std::sin(yaw)) * scale, turn / duration_s,
          (way.y() * std::cos(yaw) - way.x() * std::sin(yaw)) * scale};
}

MotionStep make_motion_step(const Twist2& twist, double duration_s, const MotionParameters& p) {
  MotionStep step;
  step.twist = twist;
  step.duration_s = duration_s;
  step.model = p.motion_model;
  step.wheelbase_m = p.wheelbase;
  if (step.model == MotionModel::kBicycle) {
    // A twist that no steering gives (turning on the spot) is moved by, and disturbed in, the twist itself.
    if (std::abs(twist.speed_mps) < kStandstill_mps) step.model = MotionModel::kVelocity;
    step.steering_rad = bicycle_input(twist, p.wheelbase).steering_rad;
  }
  const double second = step.model == MotionModel::kBicycle ? step.steering_rad : twist.yaw_rate_radps;
  const double v2 = twist.speed_mps * twist.speed_mps + twist.lateral_mps * twist.lateral_mps;
  if (twist.lateral_mps != 0.0) {
    step.direction =
        Eigen::Vector2d(twist.speed_mps, twist.lateral_mps) / std::copysign(std::sqrt(v2), twist.speed_mps);
  }
  const double i2 = second * second;
  const double scale = duration_s > 0.0 ? p.odom_noise_scale * p.odom_noise_interval / duration_s : 0.0;
  step.speed_sigma = std::sqrt(scale * (p.odom_alpha1 * v2 + p.odom_alpha2 * i2));
  step.input_sigma = std::sqrt(scale * (p.odom_alpha3 * v2 + p.odom_alpha4 * i2));
  step.yaw_rate_sigma = std::sqrt(scale * (p.odom_alpha5 * v2 + p.odom_alpha6 * i2));
  return step;
}

Pose2 move_noisily(const Pose2& pose, const MotionStep& step, const MotionNoise& noise, const OdometryErrors& errors) {
  Twist2 twist = step.twist;
  twist.speed_mps += step.speed_sigma * noise.speed * step.direction.x();
  twist.lateral_mps += step.speed_sigma * noise.speed * step.direction.y();
  if (step.model == MotionModel::kBicycle) {
    twist.yaw_rate_radps =
        yaw_rate({twist.speed_mps, step.steering_rad + step.input_sigma * noise.input}, step.wheelbase_m);
  } else {
    twist.yaw_rate_radps += step.input_sigma * noise.input;
  }
  twist.speed_mps += errors.speed_scale * step.twist.speed_mps;
  twist.lateral_mps += errors.speed_scale * step.twist.lateral_mps;
  twist.yaw_rate_radps += errors.yaw_rate_scale * step.twist.yaw_rate_radps + errors.yaw_rate_bias_radps;
  Pose2 moved = move(pose, twist, step.duration_s);
  moved.yaw = wrap_angle(moved.yaw + step.yaw_rate_sigma * noise.yaw_rate * step.duration_s);
  return moved;
}

}  // namespace urban_gnss
