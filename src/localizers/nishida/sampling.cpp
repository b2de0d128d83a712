#include "urban_gnss_localization/localizers/nishida/sampling.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace urban_gnss {
namespace {

constexpr std::size_t kBlock = 256;  ///< draws at a time, which stay in the fastest cache

/// Draws first, first + 1, … of a stream.
struct WordBlock {
  std::uint32_t a[kBlock], b[kBlock], c[kBlock], d[kBlock];

  URBAN_GNSS_INLINE WordBlock(const RandomStream& stream, std::size_t first) {
    for (std::size_t i = 0; i < kBlock; ++i) {
      const RandomWords words = stream.words(first + i);
      a[i] = words[0];
      b[i] = words[1];
      c[i] = words[2];
      d[i] = words[3];
    }
  }
};

/// What the ring's particles of a block are, before it is known which particles they are.
struct RingBlock {
  std::uint32_t pick[kBlock];
  float x[kBlock], y[kBlock], log_weight[kBlock];
};

URBAN_GNSS_VECTORISED void draw_ring(RingBlock& ring, const RandomStream& stream, std::size_t first, float radius_m,
                                     float radius_sigma_m, float weight_variance_m2) {
  const WordBlock words(stream, first);
  for (std::size_t i = 0; i < kBlock; ++i) {
    const float rho = radius_m + radius_sigma_m * to_normals(words.a[i], words.b[i]).first;  // (24)
    const SineCosine psi = vector_sincos(to_angle(words.c[i]));                              // (25)
    ring.x[i] = rho * psi.cosine;                                                            // (23)
    ring.y[i] = rho * psi.sine;
    ring.log_weight[i] = -0.5F * rho * rho / weight_variance_m2;  // (26)
    ring.pick[i] = words.d[i];
  }
}

}  // namespace

MotionNoise motion_noise(const RandomStream& stream, std::size_t particle) {
  const RandomWords words = stream.words(particle);
  const NormalPair inputs = to_normals(words[0], words[1]);
  return {inputs.first, inputs.second, to_normals(words[2], words[3]).first};
}

URBAN_GNSS_VECTORISED void sample_motion(ParticleSet& particles, const MotionStep& step, const RandomStream& stream) {
  float* __restrict const x = particles.x.data();
  float* __restrict const y = particles.y.data();
  float* __restrict const yaw = particles.yaw.data();
  const auto dt = static_cast<float>(step.duration_s);
  const auto mean_speed = static_cast<float>(step.twist.speed_mps);
  const auto mean_lateral = static_cast<float>(step.twist.lateral_mps);
  const auto mean_rate = static_cast<float>(step.twist.yaw_rate_radps);
  const auto mean_steering = static_cast<float>(step.steering_rad);
  const auto speed_sigma = static_cast<float>(step.speed_sigma * step.direction.x());
  const auto lateral_sigma = static_cast<float>(step.speed_sigma * step.direction.y());
  const auto input_sigma = static_cast<float>(step.input_sigma);
  const auto disturbance_sigma = static_cast<float>(step.yaw_rate_sigma);
  const auto inverse_wheelbase = static_cast<float>(1.0 / step.wheelbase_m);

  float speed[kBlock], lateral[kBlock], rate[kBlock], disturbance[kBlock];
  for (std::size_t first = 0; first < particles.size(); first += kBlock) {
    const std::size_t count = std::min(kBlock, particles.size() - first);
    const WordBlock words(stream, first);
    for (std::size_t i = 0; i < kBlock; ++i) {  // (5), (6)
      const NormalPair noise = to_normals(words.a[i], words.b[i]);
      speed[i] = mean_speed + speed_sigma * noise.first;
      lateral[i] = mean_lateral + lateral_sigma * noise.first;
      rate[i] = input_sigma * noise.second;
    }
    for (std::size_t i = 0; i < kBlock; ++i) {  // (7)
      disturbance[i] = disturbance_sigma * to_normals(words.c[i], words.d[i]).first;
    }
    if (step.model == MotionModel::kBicycle) {
      for (std::size_t i = 0; i < kBlock; ++i) {  // (4)
        const SineCosine steering = vector_sincos(mean_steering + rate[i]);
        rate[i] = speed[i] * inverse_wheelbase * steering.sine / steering.cosine;
      }
    } else {
      for (std::size_t i = 0; i < kBlock; ++i) rate[i] += mean_rate;
    }
    for (std::size_t i = 0; i < count; ++i) {  // (3) in chord form, (8)
      const float half_turn = 0.5F * rate[i] * dt;
      const float sinc = std::abs(half_turn) < 1e-4F ? 1.0F : vector_sincos(half_turn).sine / half_turn;
      const float chord = speed[i] * dt * sinc;
      const float sideways = lateral[i] * dt * sinc;
      const SineCosine direction = vector_sincos(yaw[first + i] + half_turn);
      x[first + i] += chord * direction.cosine - sideways * direction.sine;
      y[first + i] += chord * direction.sine + sideways * direction.cosine;
      yaw[first + i] = vector_wrap(yaw[first + i] + (rate[i] + disturbance[i]) * dt);
    }
  }
}

RingSampler::RingSampler(std::size_t particle_count, double share)
    : count_(static_cast<std::size_t>(std::llround(share * static_cast<double>(particle_count)))),
      order_(particle_count) {
  reset();
}

void RingSampler::reset() { std::iota(order_.begin(), order_.end(), 0U); }

void RingSampler::sample(ParticleSet& particles, const Pose2& predicted, double radius_m, double radius_sigma_m,
                         double weight_sigma_m, const RandomStream& stream) {
  const double variance = weight_sigma_m * weight_sigma_m;
  const auto log_scale =
      static_cast<float>(-std::log(static_cast<double>(particles.size())) - 0.5 * std::log(2.0 * kPi * variance));
  const auto centre_x = static_cast<float>(predicted.x - particles.origin.x());
  const auto centre_y = static_cast<float>(predicted.y - particles.origin.y());
  RingBlock ring;
  for (std::size_t k = 0; k < count_; ++k) {
    const std::size_t j = k % kBlock;
    if (j == 0) {
      draw_ring(ring, stream, k, static_cast<float>(radius_m), static_cast<float>(radius_sigma_m),
                static_cast<float>(variance));
    }
    // The first steps of a Fisher-Yates shuffle choose distinct particles at random.
    const std::uint64_t remaining = order_.size() - k;
    std::swap(order_[k], order_[k + ((ring.pick[j] * remaining) >> 32U)]);
    const std::size_t i = order_[k];
    particles.x[i] = centre_x + ring.x[j];
    particles.y[i] = centre_y + ring.y[j];
    particles.yaw[i] = static_cast<float>(predicted.yaw);
    particles.log_weight[i] = log_scale + ring.log_weight[j];
  }
}

}  // namespace urban_gnss
