#include "urban_gnss_localization/localizers/nishida/sampling.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace urban_gnss {

void sample_motion(ParticleSet& particles, const MotionStep& step, RandomEngine& engine) {
  const std::size_t count = particles.size();
  const double dt = step.duration_s;
  const bool steered = step.model == MotionModel::kBicycle;
  const double inverse_wheelbase = 1.0 / step.wheelbase_m;
  const bool slides = step.twist.lateral_mps != 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const double speed_noise = step.speed_sigma * draw_normal(engine);
    const double speed = step.twist.speed_mps + speed_noise * step.direction.x();
    const double input_noise = step.input_sigma * draw_normal(engine);
    const double yaw_noise = step.yaw_rate_sigma * draw_normal(engine);
    const double rate = steered ? speed * inverse_wheelbase * std::tan(step.steering_rad + input_noise)
                                : step.twist.yaw_rate_radps + input_noise;
    const double half_turn = 0.5 * rate * dt;
    const double sinc =
        std::abs(half_turn) < 1e-4 ? 1.0 - half_turn * half_turn / 6.0 : std::sin(half_turn) / half_turn;
    const double chord = speed * dt * sinc;
    const double direction = particles.yaw[i] + half_turn;
    particles.x[i] += chord * std::cos(direction);
    particles.y[i] += chord * std::sin(direction);
    if (slides) {
      const double sideways = (step.twist.lateral_mps + speed_noise * step.direction.y()) * dt * sinc;
      particles.x[i] -= sideways * std::sin(direction);
      particles.y[i] += sideways * std::cos(direction);
    }
    particles.yaw[i] = wrap_angle(particles.yaw[i] + rate * dt + yaw_noise * dt);
  }
}

RingSampler::RingSampler(std::size_t particle_count, double share)
    : count_(static_cast<std::size_t>(std::llround(share * static_cast<double>(particle_count)))),
      order_(particle_count) {
  reset();
}

void RingSampler::reset() { std::iota(order_.begin(), order_.end(), 0U); }

void RingSampler::sample(ParticleSet& particles, const Pose2& predicted, double radius_m, double radius_sigma_m,
                         double weight_sigma_m, RandomEngine& engine) {
  const double variance = weight_sigma_m * weight_sigma_m;
  const double log_scale = -std::log(static_cast<double>(particles.size())) - 0.5 * std::log(2.0 * kPi * variance);
  const std::size_t remaining = order_.size();
  for (std::size_t k = 0; k < count_; ++k) {
    // The first steps of a Fisher-Yates shuffle choose distinct particles at random.
    const auto pick = k + static_cast<std::size_t>(draw_uniform(engine) * static_cast<double>(remaining - k));
    std::swap(order_[k], order_[pick]);
    const std::size_t i = order_[k];
    const double psi = kPi * (2.0 * draw_uniform(engine) - 1.0);         // (25)
    const double rho = radius_m + radius_sigma_m * draw_normal(engine);  // (24)
    particles.x[i] = predicted.x + rho * std::cos(psi);                  // (23)
    particles.y[i] = predicted.y + rho * std::sin(psi);
    particles.yaw[i] = predicted.yaw;
    particles.log_weight[i] = log_scale - 0.5 * rho * rho / variance;  // (26)
  }
}

}  // namespace urban_gnss
