#include "urban_gnss_localization/localizers/nishida/sampling.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace urban_gnss {

void sample_motion(ParticleSet& particles, const MotionStep& step, RandomEngine& engine) {
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const Pose2 moved = move_noisily(particles.pose(i), step, draw_motion_noise(engine));
    particles.x[i] = moved.x;
    particles.y[i] = moved.y;
    particles.yaw[i] = moved.yaw;
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
