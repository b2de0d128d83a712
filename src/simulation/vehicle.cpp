#include "urban_gnss_localization/simulation/vehicle.hpp"

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/motion/standstill.hpp"

namespace urban_gnss {
namespace {

constexpr std::uint64_t kActuationStream = 201;

double approach(double value, double target, double largest_change) {
  return value + std::clamp(target - value, -largest_change, largest_change);
}

}  // namespace

EnumNames<Drive> enum_names(Drive) { return {{"bicycle", Drive::kBicycle}, {"differential", Drive::kDifferential}}; }

MotionParameters VehicleParameters::motion() const {
  MotionParameters motion;
  motion.motion_model = drive == Drive::kBicycle ? MotionModel::kBicycle : MotionModel::kVelocity;
  motion.wheelbase = wheelbase;
  motion.odom_alpha1 = actuation_alpha1;
  motion.odom_alpha2 = actuation_alpha2;
  motion.odom_alpha3 = actuation_alpha3;
  motion.odom_alpha4 = actuation_alpha4;
  motion.odom_alpha5 = actuation_alpha5;
  motion.odom_alpha6 = actuation_alpha6;
  motion.odom_noise_scale = 1.0;
  motion.odom_noise_interval = actuation_noise_interval;
  return motion;
}

Twist2 twist_between(const Pose2& from, const Pose2& to, double duration_s) {
  const double turn = angle_difference(to.yaw, from.yaw);
  const double half_turn = 0.5 * turn;
  const double direction = from.yaw + half_turn;
  const double chord = (to.x - from.x) * std::cos(direction) + (to.y - from.y) * std::sin(direction);
  const double sinc = std::abs(half_turn) < 1e-4 ? 1.0 - half_turn * half_turn / 6.0 : std::sin(half_turn) / half_turn;
  return {chord / (sinc * duration_s), turn / duration_s};
}

Vehicle::Vehicle(const VehicleParameters& parameters, const Pose2& start, std::uint64_t seed)
    : parameters_(parameters),
      motion_(parameters.motion()),
      engine_(make_engine(seed, kActuationStream)),
      pose_(start) {
  pose_.yaw = wrap_angle(pose_.yaw);
}

Twist2 Vehicle::follow(const Twist2& command, double dt_s) {
  const VehicleParameters& p = parameters_;
  const bool is_usable = std::isfinite(command.speed_mps) && std::isfinite(command.yaw_rate_radps);
  const Twist2 target = is_usable ? command : Twist2{};

  const double speed = nominal_.speed_mps;
  const double target_speed = std::clamp(target.speed_mps, -p.max_speed, p.max_speed);
  const bool is_braking = speed * (target_speed - speed) < 0.0;
  const double rate = is_braking ? p.max_deceleration : p.max_acceleration;
  Twist2 twist;
  twist.speed_mps = approach(speed, target_speed, rate * dt_s);

  if (p.drive == Drive::kBicycle) {
    if (std::abs(target.speed_mps) >= kStandstill_mps) {
      const double wanted = bicycle_input(target, p.wheelbase).steering_rad;
      steering_rad_ =
          approach(steering_rad_, std::clamp(wanted, -p.max_steering, p.max_steering), p.max_steering_rate * dt_s);
    }
    twist.yaw_rate_radps = yaw_rate({twist.speed_mps, steering_rad_}, p.wheelbase);
  } else {
    const double wanted = std::clamp(target.yaw_rate_radps, -p.max_yaw_rate, p.max_yaw_rate);
    twist.yaw_rate_radps = approach(nominal_.yaw_rate_radps, wanted, p.max_yaw_acceleration * dt_s);
  }
  return twist;
}

void Vehicle::step(const Twist2& command, double dt_s) {
  const Twist2 next = follow(command, dt_s);
  acceleration_mps2_ = {(next.speed_mps - nominal_.speed_mps) / dt_s,
                        0.25 * (next.speed_mps + nominal_.speed_mps) * (next.yaw_rate_radps + nominal_.yaw_rate_radps)};
  nominal_ = next;

  const Pose2 moved = move_noisily(pose_, make_motion_step(nominal_, dt_s, motion_), draw_motion_noise(engine_));
  // The noise of eq. (7) turns the robot at the end of the step, which is no constant twist. The robot moves by the
  // twist that fits, so that a sensor which measures this twist without error loses nothing.
  twist_ = twist_between(pose_, moved, dt_s);
  pose_ = move(pose_, twist_, dt_s);
}

Eigen::Vector3d Vehicle::point(const Eigen::Vector3d& in_base_link) const {
  const Eigen::Vector2d horizontal = transform_point(pose_, in_base_link.head<2>());
  return {horizontal.x(), horizontal.y(), in_base_link.z()};
}

Eigen::Vector3d Vehicle::velocity(const Eigen::Vector3d& in_base_link) const {
  const Eigen::Vector2d in_base(twist_.speed_mps - twist_.yaw_rate_radps * in_base_link.y(),
                                twist_.yaw_rate_radps * in_base_link.x());
  const Eigen::Vector2d in_map = transform_point({0.0, 0.0, pose_.yaw}, in_base);
  return {in_map.x(), in_map.y(), 0.0};
}

}  // namespace urban_gnss
