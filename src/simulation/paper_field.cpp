#include "urban_gnss_localization/simulation/paper_field.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {
namespace {

enum Stream : std::uint64_t { kMotionStream = 101, kFixStream = 102, kDirectionStream = 103 };

}  // namespace

EnumNames<BiasDirection> enum_names(BiasDirection) {
  return {{"random", BiasDirection::kRandom}, {"negative_x", BiasDirection::kNegativeX}};
}

std::vector<double> PaperFieldParameters::targets() const {
  std::vector<double> points;
  for (int i = 0; i < target_count; ++i) {
    const double angle = 2.0 * kPi * i / target_count;
    points.push_back(target_ring_radius * std::cos(angle));
    points.push_back(target_ring_radius * std::sin(angle));
  }
  return points;
}

Pose2 PaperFieldParameters::start() const {
  const std::vector<double> points = targets();
  return {points[0], points[1], std::atan2(points[3] - points[1], points[2] - points[0])};
}

PaperField::PaperField(const PaperFieldParameters& parameters, const MotionParameters& motion)
    : parameters_(parameters),
      motion_(motion),
      motion_engine_(make_engine(static_cast<std::uint64_t>(parameters.seed), kMotionStream)),
      fix_engine_(make_engine(static_cast<std::uint64_t>(parameters.seed), kFixStream)),
      direction_engine_(make_engine(static_cast<std::uint64_t>(parameters.seed), kDirectionStream)),
      truth_(parameters.start()) {}

void PaperField::step(const BicycleInput& input) {
  const Twist2 twist{input.speed_mps, yaw_rate(input, motion_.wheelbase)};
  truth_ =
      move_noisily(truth_, make_motion_step(twist, parameters_.interval, motion_), draw_motion_noise(motion_engine_));
}

SimulatedFix PaperField::fix() {
  SimulatedFix fix;
  const double depth = parameters_.shadow_border - truth_.x;
  fix.in_shadow = depth > 0.0;
  if (fix.in_shadow && !was_in_shadow_ && parameters_.bias_direction == BiasDirection::kRandom) {
    direction_rad_ = kPi * (2.0 * draw_uniform(direction_engine_) - 1.0);
  }
  was_in_shadow_ = fix.in_shadow;
  if (fix.in_shadow) {
    const double length = std::min(depth, parameters_.bias_limit);
    fix.bias = length * Eigen::Vector2d(std::cos(direction_rad_), std::sin(direction_rad_));
  }
  const double sigma = fix.in_shadow ? parameters_.fix_shadow_sigma : parameters_.fix_direct_sigma;
  const double noise_x = draw_normal(fix_engine_);
  const double noise_y = draw_normal(fix_engine_);
  fix.position = truth_.position() + fix.bias + sigma * Eigen::Vector2d(noise_x, noise_y);
  return fix;
}

}  // namespace urban_gnss
