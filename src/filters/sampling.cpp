#include "urban_gnss_localization/filters/sampling.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace urban_gnss {
namespace {

/// The odometry has no errors.
struct NoErrors {
  OdometryErrors draw(std::size_t, RandomEngine&) const { return {}; }
  void learn(std::size_t, const OdometryErrors&, double, double) const {}
};

/// Draws the errors of a step about each particle's means, and moves the means by the gains. What a step deviates by
/// from its mean is known exactly: the particle's path is a sample.
struct LearntErrors {
  OdometryErrorSet& set;
  double measured_speed;
  double scale_sigma;
  double bias_sigma;
  double scale_gain;  ///< s/m
  double bias_gain;   ///< 1

  OdometryErrors draw(std::size_t i, RandomEngine& engine) const {
    OdometryErrors errors{set.speed_scale[i], set.yaw_rate_bias[i]};
    if (scale_sigma > 0.0) errors.speed_scale += scale_sigma * draw_normal(engine);
    if (bias_sigma > 0.0) errors.yaw_rate_bias_radps += bias_sigma * draw_normal(engine);
    return errors;
  }
  void learn(std::size_t i, const OdometryErrors& drawn, double speed_noise, double rate_noise) const {
    set.speed_scale[i] += scale_gain * (measured_speed * (drawn.speed_scale - set.speed_scale[i]) + speed_noise);
    set.yaw_rate_bias[i] += bias_gain * (drawn.yaw_rate_bias_radps - set.yaw_rate_bias[i] + rate_noise);
  }
};

template <class Errors>
void sample_motion_with(ParticleSet& particles, const MotionStep& step, RandomEngine& engine, const Errors& errors) {
  const std::size_t count = particles.size();
  const double dt = step.duration_s;
  const bool steered = step.model == MotionModel::kBicycle;
  const double inverse_wheelbase = 1.0 / step.wheelbase_m;
  for (std::size_t i = 0; i < count; ++i) {
    const double speed = step.twist.speed_mps + step.speed_sigma * draw_normal(engine);
    const double input_noise = step.input_sigma * draw_normal(engine);
    const double yaw_noise = step.yaw_rate_sigma * draw_normal(engine);
    const OdometryErrors drawn = errors.draw(i, engine);
    const double noisy_rate = steered ? speed * inverse_wheelbase * std::tan(step.steering_rad + input_noise)
                                      : step.twist.yaw_rate_radps + input_noise;
    const double rate = noisy_rate + drawn.yaw_rate_bias_radps;
    const double half_turn = 0.5 * rate * dt;
    const double sinc =
        std::abs(half_turn) < 1e-4 ? 1.0 - half_turn * half_turn / 6.0 : std::sin(half_turn) / half_turn;
    const double chord = (speed + drawn.speed_scale * step.twist.speed_mps) * dt * sinc;
    const double direction = particles.yaw[i] + half_turn;
    particles.x[i] += chord * std::cos(direction);
    particles.y[i] += chord * std::sin(direction);
    particles.yaw[i] = wrap_angle(particles.yaw[i] + rate * dt + yaw_noise * dt);
    errors.learn(i, drawn, speed - step.twist.speed_mps, noisy_rate - step.twist.yaw_rate_radps + yaw_noise);
  }
}

double square(double value) { return value * value; }

/// Variance (rad/s)^2 of the yaw rate of one noisy step.
double yaw_rate_variance(const MotionStep& step) {
  double variance = square(step.input_sigma);
  if (step.model == MotionModel::kBicycle) {
    const double tangent = std::tan(step.steering_rad);
    variance = square(step.twist.speed_mps * (1.0 + tangent * tangent) * step.input_sigma) +
               square(tangent * step.speed_sigma);
    variance /= square(step.wheelbase_m);
  }
  return variance + square(step.yaw_rate_sigma);
}

}  // namespace

void sample_motion(ParticleSet& particles, const MotionStep& step, RandomEngine& engine) {
  sample_motion_with(particles, step, engine, NoErrors{});
}

void sample_motion(ParticleSet& particles, OdometryErrorSet& errors, const MotionStep& step, RandomEngine& engine) {
  const double v = step.twist.speed_mps;
  double& scale = errors.speed_scale_variance;
  double& bias = errors.yaw_rate_bias_variance;
  const double speed_variance = square(step.speed_sigma);
  const double rate_variance = yaw_rate_variance(step);
  const double of_speed = v * v * scale + speed_variance;
  const double of_rate = bias + rate_variance;
  const LearntErrors learnt{errors,
                            v,
                            std::sqrt(scale),
                            std::sqrt(bias),
                            of_speed > 0.0 ? v * scale / of_speed : 0.0,
                            of_rate > 0.0 ? bias / of_rate : 0.0};
  sample_motion_with(particles, step, engine, learnt);
  scale *= 1.0 - learnt.scale_gain * v;
  bias *= 1.0 - learnt.bias_gain;
}

void OdometryErrorSet::reset(const OdometryErrorParameters& parameters) {
  std::fill(speed_scale.begin(), speed_scale.end(), 0.0);
  std::fill(yaw_rate_bias.begin(), yaw_rate_bias.end(), 0.0);
  speed_scale_variance = square(parameters.speed_scale_sigma);
  yaw_rate_bias_variance = square(parameters.yaw_rate_bias_sigma);
}

void OdometryErrorSet::walk(double duration_s, const OdometryErrorParameters& parameters) {
  speed_scale_variance += square(parameters.speed_scale_walk) * duration_s;
  yaw_rate_bias_variance += square(parameters.yaw_rate_bias_walk) * duration_s;
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
