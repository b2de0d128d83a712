#include "urban_gnss_localization/localizers/switching/bias_quad.hpp"

#include <cmath>
#include <tuple>
#include <type_traits>

#include "quad_states.hpp"

namespace urban_gnss {

BiasGaussian BiasQuad::at(std::size_t mode) const {
  BiasGaussian state;
  for (int i = 0; i < kBiasStates; ++i) {
    state.mean[i] = mean[static_cast<std::size_t>(i)][mode];
    for (int j = 0; j < kBiasStates; ++j) state.covariance(i, j) = covariance[pair(i, j)][mode];
  }
  return state;
}

void BiasQuad::set(std::size_t mode, const BiasGaussian& state) {
  for (int i = 0; i < kBiasStates; ++i) {
    mean[static_cast<std::size_t>(i)][mode] = state.mean[i];
    for (int j = i; j < kBiasStates; ++j) covariance[pair(i, j)][mode] = state.covariance(i, j);
  }
}

URBAN_GNSS_VECTORISED bool are_finite(const BiasQuads& filters) {
  Quad sums[4]{};  // which need not wait for each other
  const auto add = [&](const auto& numbers) URBAN_GNSS_INLINE_LAMBDA {
    static_assert(std::tuple_size<std::decay_t<decltype(numbers)>>::value % 4 == 0);
    for (std::size_t i = 0; i < numbers.size(); i += 4) {
      for (std::size_t k = 0; k < 4; ++k) sums[k] += load(numbers[i + k].data());
    }
  };
  for (const BiasQuad& states : filters) {
    add(states.mean);
    add(states.covariance);
  }
  return std::isfinite(sum_of((sums[0] + sums[1]) + (sums[2] + sums[3])));
}

URBAN_GNSS_VECTORISED void predict(BiasQuads& filters, const std::array<MotionStep, kQualityLevels>& steps,
                                   const std::array<OdometryErrorParameters, kQualityLevels>& levels) {
  const MotionStep& motion = steps[0];
  const double dt = motion.duration_s;
  if (is_standstill(motion.twist, levels[0].standstill_radps)) {
    for (std::size_t level = 0; level < kQualityLevels; ++level) {
      const Quad walk = quad(levels[level].parked_walk * levels[level].parked_walk * dt);
      add_covariance(filters[level], 0, 0, walk);
      add_covariance(filters[level], 1, 1, walk);
    }
    return;
  }
  // Of the noise of speed and second input, the distance (m) and the turn (rad), as in dead_reckon().
  double turn_of_speed = 0.0;
  double turn_of_input = 1.0;
  if (motion.model == MotionModel::kBicycle) {
    const double tangent = std::tan(motion.steering_rad);
    turn_of_speed = tangent / motion.wheelbase_m;
    turn_of_input = motion.twist.speed_mps * (1.0 + tangent * tangent) / motion.wheelbase_m;
  }
  const double turn_of_scale = motion.twist.yaw_rate_radps * dt;
  for (std::size_t level = 0; level < kQualityLevels; ++level) {
    BiasQuad& q = filters[level];
    const MotionStep& step = steps[level];
    const OdometryErrorParameters& p = levels[level];
    const Quad stretch = (1.0 + mean(q, kSpeedScale)) * dt;
    const Quad forwards = motion.twist.speed_mps * stretch;
    const Quad sideways = motion.twist.lateral_mps * stretch;
    const Quad half_turn =
        0.5 * dt *
        (motion.twist.yaw_rate_radps + mean(q, kYawRateScale) * motion.twist.yaw_rate_radps + mean(q, kYawRateBias));
    const QuadSineCosine heading = quad_sincos(mean(q, kYaw) + half_turn);
    Quad sinc = quad_sinc(half_turn);
    for (int lane = 0; lane < 4; ++lane) {
      if (std::abs(half_turn[lane]) > 0.25 * kPi) sinc[lane] = std::sin(half_turn[lane]) / half_turn[lane];
    }
    const Quad dx = sinc * (forwards * heading.cosine - sideways * heading.sine);
    const Quad dy = sinc * (forwards * heading.sine + sideways * heading.cosine);
    set_mean(q, 0, mean(q, 0) + dx);
    set_mean(q, 1, mean(q, 1) + dy);
    set_mean(q, kYaw, quad_wrap(mean(q, kYaw) + 2.0 * half_turn));

    // How an error of the speed's scale shows in x and y; one of yaw (rad) by (-dy, dx), one of the turn by half of it.
    const Quad scale_x = dt * (motion.twist.speed_mps * heading.cosine - motion.twist.lateral_mps * heading.sine);
    const Quad scale_y = dt * (motion.twist.speed_mps * heading.sine + motion.twist.lateral_mps * heading.cosine);
    // A P of predict() in bias_ekf.cpp, and of that A P A'.
    Quad ap[3][kBiasStates];
    for_each_state([&](int j) URBAN_GNSS_INLINE_LAMBDA {
      const Quad turn = dt * covariance(q, kYawRateBias, j) + turn_of_scale * covariance(q, kYawRateScale, j);
      const Quad yaw = covariance(q, kYaw, j) + 0.5 * turn;
      ap[0][j] = scale_x * covariance(q, kSpeedScale, j) - dy * yaw;
      ap[1][j] = scale_y * covariance(q, kSpeedScale, j) + dx * yaw;
      ap[2][j] = turn;
    });
    Quad apa[3][3];
    for (int i = 0; i < 3; ++i) {
      const Quad turn = dt * ap[i][kYawRateBias] + turn_of_scale * ap[i][kYawRateScale];
      const Quad yaw = ap[i][kYaw] + 0.5 * turn;
      apa[i][0] = scale_x * ap[i][kSpeedScale] - dy * yaw;
      apa[i][1] = scale_y * ap[i][kSpeedScale] + dx * yaw;
      apa[i][2] = turn;
    }
    // Roots of the noise: of the speed, along the direction of motion, and of the turn.
    const double along = step.speed_sigma * dt;
    const double by_speed = along * turn_of_speed;
    const double by_input = step.input_sigma * dt * turn_of_input;
    const Quad root[3][2] = {
        {along * (motion.direction.x() * heading.cosine - motion.direction.y() * heading.sine) - 0.5 * by_speed * dy,
         -0.5 * by_input * dy},
        {along * (motion.direction.x() * heading.sine + motion.direction.y() * heading.cosine) + 0.5 * by_speed * dx,
         0.5 * by_input * dx},
        {quad(by_speed), quad(by_input)}};
    const double position = p.position_walk * p.position_walk * dt;
    const double disturbance = step.yaw_rate_sigma * dt;
    const double walk[3] = {position, position, disturbance * disturbance + p.heading_walk * p.heading_walk * dt};
    for_each_pair([&](int i, int j) URBAN_GNSS_INLINE_LAMBDA {
      if (j < 3) {
        const Quad noise = root[i][0] * root[j][0] + root[i][1] * root[j][1] + (i == j ? walk[i] : 0.0);
        add_covariance(q, i, j, ap[i][j] + ap[j][i] + apa[i][j] + noise);
      } else if (i < 3) {
        add_covariance(q, i, j, ap[i][j]);
      }
    });
    add_covariance(q, kSpeedScale, kSpeedScale, quad(p.speed_scale_walk * p.speed_scale_walk * dt));
    add_covariance(q, kYawRateBias, kYawRateBias, quad(p.yaw_rate_bias_walk * p.yaw_rate_bias_walk * dt));
  }
}

}  // namespace urban_gnss
