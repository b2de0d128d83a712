#include "urban_gnss_localization/localizers/switching/bias_quad.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "urban_gnss_localization/common/quad.hpp"
#include "urban_gnss_localization/gnss/chi_squared.hpp"

namespace urban_gnss {
namespace {

constexpr int kYaw = 2;
constexpr int kSpeedScale = 3;
constexpr int kYawRateBias = 4;
constexpr int kYawRateScale = kErrorStates;
constexpr int kBias = kMotionStates;
constexpr double kQuarterTurn = 0.5 * kPi;

template <class F, int... kIndices>
URBAN_GNSS_INLINE void for_each_state(const F& f, std::integer_sequence<int, kIndices...>) {
  (f(kIndices), ...);
}
/// f(0), f(1), … of the states, without a loop, so that the compiler knows each index.
template <class F>
URBAN_GNSS_INLINE void for_each_state(const F& f) {
  for_each_state(f, std::make_integer_sequence<int, kBiasStates>());
}
/// f(i, j) of the upper triangle.
template <class F>
URBAN_GNSS_INLINE void for_each_pair(const F& f) {
  for_each_state([&](int i) URBAN_GNSS_INLINE_LAMBDA {
    for_each_state([&](int j) URBAN_GNSS_INLINE_LAMBDA {
      if (i <= j) f(i, j);
    });
  });
}

/// A symmetric matrix of 2 x 2.
struct Symmetric2 {
  Quad xx, xy, yy;

  URBAN_GNSS_INLINE Quad determinant() const { return xx * yy - xy * xy; }
  URBAN_GNSS_INLINE Symmetric2 inverse() const {
    const Quad factor = 1.0 / determinant();
    return {yy * factor, -xy * factor, xx * factor};
  }
  /// v' A v.
  URBAN_GNSS_INLINE Quad square(const Quad& x, const Quad& y) const {
    return x * (xx * x + xy * y) + y * (xy * x + yy * y);
  }
};
URBAN_GNSS_INLINE Symmetric2 sum(const Symmetric2& a, const Quad& factor, const Symmetric2& b) {
  return {a.xx + factor * b.xx, a.xy + factor * b.xy, a.yy + factor * b.yy};
}

URBAN_GNSS_INLINE Quad mean(const BiasQuad& q, int i) { return load(q.mean[static_cast<std::size_t>(i)].data()); }
URBAN_GNSS_INLINE Quad covariance(const BiasQuad& q, int i, int j) {
  return load(q.covariance[BiasQuad::pair(i, j)].data());
}
URBAN_GNSS_INLINE void set_mean(BiasQuad& q, int i, const Quad& value) {
  store(value, q.mean[static_cast<std::size_t>(i)].data());
}
URBAN_GNSS_INLINE void set_covariance(BiasQuad& q, int i, int j, const Quad& value) {
  store(value, q.covariance[BiasQuad::pair(i, j)].data());
}
URBAN_GNSS_INLINE void add_covariance(BiasQuad& q, int i, int j, const Quad& value) {
  set_covariance(q, i, j, covariance(q, i, j) + value);
}
URBAN_GNSS_INLINE Quad difference_of(int i, const Quad& a, const Quad& b) {
  return i == kYaw ? quad_wrap(a - b) : a - b;
}

/// match_moments() of `kParts` states: mean_of(part, i), covariance_of(part, i, j).
template <int kParts, class MeanOf, class CovarianceOf>
URBAN_GNSS_INLINE void mix(const Quad (&weight)[kParts], const MeanOf& mean_of, const CovarianceOf& covariance_of,
                           BiasQuad& whole) {
  Quad apart[kParts][kBiasStates];  // of each part from the mean
  for_each_state([&](int i) URBAN_GNSS_INLINE_LAMBDA {
    Quad heaviest = weight[0];
    Quad centre = mean_of(0, i);
    for (int part = 1; part < kParts; ++part) {
      const QuadBits is_heavier = weight[part] > heaviest;
      heaviest = is_heavier ? weight[part] : heaviest;
      centre = is_heavier ? mean_of(part, i) : centre;
    }
    Quad moved = weight[0] * difference_of(i, mean_of(0, i), centre);
    for (int part = 1; part < kParts; ++part) moved += weight[part] * difference_of(i, mean_of(part, i), centre);
    const Quad at = i == kYaw ? quad_wrap(centre + moved) : centre + moved;
    set_mean(whole, i, at);
    for (int part = 0; part < kParts; ++part) apart[part][i] = difference_of(i, mean_of(part, i), at);
  });
  for_each_pair([&](int i, int j) URBAN_GNSS_INLINE_LAMBDA {
    Quad sum = weight[0] * (covariance_of(0, i, j) + apart[0][i] * apart[0][j]);
    for (int part = 1; part < kParts; ++part) {
      sum += weight[part] * (covariance_of(part, i, j) + apart[part][i] * apart[part][j]);
    }
    set_covariance(whole, i, j, sum);
  });
}

/// Subtracts `used` of the gain times (P H')', adds what is left open by a share `open`, corrects the mean.
URBAN_GNSS_INLINE void correct(BiasQuad& states, const Quad (&x)[kBiasStates], const Quad (&y)[kBiasStates],
                               const Symmetric2& s, const Quad& innovation_x, const Quad& innovation_y,
                               const Quad& used, const Quad& open) {
  const Symmetric2 inverse = s.inverse();
  Quad gain_x[kBiasStates];
  Quad gain_y[kBiasStates];
  Quad correction[kBiasStates];
  for_each_state([&](int i) URBAN_GNSS_INLINE_LAMBDA {
    const Quad by_x = x[i] * inverse.xx + y[i] * inverse.xy;
    const Quad by_y = x[i] * inverse.xy + y[i] * inverse.yy;
    correction[i] = by_x * innovation_x + by_y * innovation_y;
    gain_x[i] = used * by_x;
    gain_y[i] = used * by_y;
    const Quad corrected = mean(states, i) + used * correction[i];
    set_mean(states, i, i == kYaw ? quad_wrap(corrected) : corrected);
  });
  const Quad added = used * open;
  for_each_pair([&](int i, int j) URBAN_GNSS_INLINE_LAMBDA {
    add_covariance(states, i, j, added * correction[i] * correction[j] - (gain_x[i] * x[j] + gain_y[i] * y[j]));
  });
}

/// -(dof + 2) / 2 log(1 + nis / dof) - 1/2 log(det): Student's t of two dimensions, without a constant.
URBAN_GNSS_INLINE Quad log_student(const Quad& nis, const Quad& dof, const Quad& determinant) {
  return -0.5 * (dof + 2.0) * quad_log1p(nis / dof) - 0.5 * quad_log(determinant);
}

URBAN_GNSS_INLINE double sum_of(const Quad& x) { return (x[0] + x[1]) + (x[2] + x[3]); }

/// The heaviest of the filters.
struct Heaviest {
  std::size_t level{0};
  std::size_t mode{0};
};
URBAN_GNSS_INLINE Heaviest heaviest_of(const QualityNumbers& weights) {
  Heaviest found;
  for (std::size_t level = 0; level < kQualityLevels; ++level) {
    for (std::size_t m = 0; m < kLastingModes; ++m) {
      if (weights[level][m] > weights[found.level][found.mode]) found = {level, m};
    }
  }
  return found;
}

/// match_means() of all in one state.
URBAN_GNSS_INLINE double mean_of(const BiasQuads& filters, const Quad (&weights)[kQualityLevels], const Heaviest& from,
                                 int i) {
  const double centre = filters[from.level].mean[static_cast<std::size_t>(i)][from.mode];
  Quad moved{};
  for (std::size_t k = 0; k < kQualityLevels; ++k) {
    moved += weights[k] * difference_of(i, mean(filters[k], i), quad(centre));
  }
  const double at = centre + sum_of(moved);
  return i == kYaw ? wrap_angle(at) : at;
}

}  // namespace

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

URBAN_GNSS_VECTORISED bool is_finite(const BiasQuad& states) {
  Quad nothing{};  // 0, or NaN where a number is not finite
  for (const ModeNumbers& each : states.mean) nothing += load(each.data()) - load(each.data());
  for (const ModeNumbers& each : states.covariance) nothing += load(each.data()) - load(each.data());
  return sum_of(nothing) == 0.0;
}

bool BiasQuad::is_finite() const { return urban_gnss::is_finite(*this); }

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
      if (std::abs(half_turn[lane]) > 0.5 * kQuarterTurn) sinc[lane] = std::sin(half_turn[lane]) / half_turn[lane];
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

URBAN_GNSS_VECTORISED Pose2 pose_of(const BiasQuads& filters, const QualityNumbers& probability) {
  Quad weights[kQualityLevels];
  for (std::size_t level = 0; level < kQualityLevels; ++level) weights[level] = load(probability[level].data());
  const Heaviest from = heaviest_of(probability);
  return {mean_of(filters, weights, from, 0), mean_of(filters, weights, from, 1),
          mean_of(filters, weights, from, kYaw)};
}

URBAN_GNSS_VECTORISED BiasGaussian mixture_of(const BiasQuads& filters, const QualityNumbers& probability) {
  Quad weights[kQualityLevels];
  for (std::size_t level = 0; level < kQualityLevels; ++level) weights[level] = load(probability[level].data());
  const Heaviest from = heaviest_of(probability);
  BiasGaussian whole;
  Quad apart[kBiasStates][kQualityLevels];
  for_each_state([&](int i) URBAN_GNSS_INLINE_LAMBDA {
    whole.mean[i] = mean_of(filters, weights, from, i);
    for (std::size_t k = 0; k < kQualityLevels; ++k) {
      apart[i][k] = difference_of(i, mean(filters[k], i), quad(whole.mean[i]));
    }
  });
  for_each_pair([&](int i, int j) URBAN_GNSS_INLINE_LAMBDA {
    Quad sum{};
    for (std::size_t k = 0; k < kQualityLevels; ++k) {
      sum += weights[k] * (covariance(filters[k], i, j) + apart[i][k] * apart[j][k]);
    }
    whole.covariance(i, j) = whole.covariance(j, i) = sum_of(sum);
  });
  return whole;
}

URBAN_GNSS_VECTORISED void mix_qualities(const BiasQuads& filters, const QualityNumbers& weights, BiasQuad& mixed) {
  Quad weight[kQualityLevels];
  for (std::size_t level = 0; level < kQualityLevels; ++level) weight[level] = load(weights[level].data());
  mix(
      weight,
      [&](int part, int i) URBAN_GNSS_INLINE_LAMBDA { return mean(filters[static_cast<std::size_t>(part)], i); },
      [&](int part, int i, int j)
          URBAN_GNSS_INLINE_LAMBDA { return covariance(filters[static_cast<std::size_t>(part)], i, j); },
      mixed);
}

BiasSteps bias_steps(double elapsed_s, const BiasModeParameters& p) {
  BiasSteps steps;
  for (std::size_t from = 0; from < kLastingModes; ++from) {
    for (std::size_t to = 0; to < kContinuations; ++to) {
      steps[from][to] = bias_step(static_cast<BiasMode>(from), static_cast<BiasMode>(to), elapsed_s, p);
    }
  }
  return steps;
}

URBAN_GNSS_VECTORISED void continue_biases(const BiasQuad& before,
                                           const std::array<ModeNumbers, kLastingModes>& weights,
                                           const BiasSteps& steps, BiasQuad& after) {
  Quad weight[kLastingModes];
  Quad left[kLastingModes];
  Quad growth[kLastingModes];
  for (std::size_t from = 0; from < kLastingModes; ++from) {
    weight[from] = load(weights[from].data());
    for (int to = 0; to < static_cast<int>(kContinuations); ++to) {
      left[from][to] = steps[from][static_cast<std::size_t>(to)].left;
      growth[from][to] = steps[from][static_cast<std::size_t>(to)].growth_m2;
    }
  }
  mix(
      weight,
      [&](int part, int i) URBAN_GNSS_INLINE_LAMBDA {
        const Quad old = quad(before.mean[static_cast<std::size_t>(i)][static_cast<std::size_t>(part)]);
        return i < kBias ? old : left[part] * old;
      },
      [&](int part, int i, int j) URBAN_GNSS_INLINE_LAMBDA {
        Quad old = quad(before.covariance[BiasQuad::pair(i, j)][static_cast<std::size_t>(part)]);
        if (j >= kBias) old *= left[part];
        if (i >= kBias) old *= left[part];
        return i >= kBias && i == j ? old + growth[part] : old;
      },
      after);
}

URBAN_GNSS_VECTORISED void merge_jump(const BiasQuad& before, double slow, double jump, BiasQuad& merged) {
  const Quad weight[2] = {{1.0, slow, 1.0, 1.0}, {0.0, jump, 0.0, 0.0}};
  constexpr std::size_t kJump = index_of(BiasMode::kJump);
  mix(
      weight,
      [&](int part, int i) URBAN_GNSS_INLINE_LAMBDA {
        return part == 0 ? mean(before, i) : quad(before.mean[static_cast<std::size_t>(i)][kJump]);
      },
      [&](int part, int i, int j) URBAN_GNSS_INLINE_LAMBDA {
        return part == 0 ? covariance(before, i, j) : quad(before.covariance[BiasQuad::pair(i, j)][kJump]);
      },
      merged);
}

URBAN_GNSS_VECTORISED void weigh(QualityNumbers& probability, const std::array<BiasQuadUpdate, kQualityLevels>& updates,
                                 double largest) {
  Quad posterior[kQualityLevels];
  Quad sums{};
  for (std::size_t level = 0; level < kQualityLevels; ++level) {
    const Quad likelihood = quad_exp(load(updates[level].log_likelihood.data()) - largest);
    const Quad prior = load(probability[level].data());
    posterior[level] = prior > 0.0 ? prior * likelihood : Quad{};
    sums += posterior[level];
  }
  const double sum = sum_of(sums);
  for (std::size_t level = 0; level < kQualityLevels; ++level) store(posterior[level] / sum, probability[level].data());
}

URBAN_GNSS_VECTORISED BiasQuadUpdate take_fix(BiasQuad& states, const FixMeasurement& fix, const FixNoise& noise,
                                              const SwitchingModelParameters& p) {
  constexpr Quad kIsBiased{0.0, 1.0, 1.0, 1.0};
  // Innovation, and P H', as columns for x and y.
  const QuadSineCosine heading = quad_sincos(mean(states, kYaw));
  const Quad lever_x = fix.antenna_in_body.x() * heading.cosine - fix.antenna_in_body.y() * heading.sine;
  const Quad lever_y = fix.antenna_in_body.x() * heading.sine + fix.antenna_in_body.y() * heading.cosine;
  const Quad innovation_x = fix.position.x() - (mean(states, 0) + lever_x) - kIsBiased * mean(states, kBias);
  const Quad innovation_y = fix.position.y() - (mean(states, 1) + lever_y) - kIsBiased * mean(states, kBias + 1);
  Quad x[kBiasStates];
  Quad y[kBiasStates];
  for_each_state([&](int i) URBAN_GNSS_INLINE_LAMBDA {
    const Quad by_yaw = covariance(states, i, kYaw);
    x[i] = covariance(states, i, 0) - lever_y * by_yaw + kIsBiased * covariance(states, i, kBias);
    y[i] = covariance(states, i, 1) + lever_x * by_yaw + kIsBiased * covariance(states, i, kBias + 1);
  });
  const Symmetric2 hph{x[0] - lever_y * x[kYaw] + kIsBiased * x[kBias], y[0] - lever_y * y[kYaw] + kIsBiased * y[kBias],
                       y[1] + lever_x * y[kYaw] + kIsBiased * y[kBias + 1]};

  Eigen::Matrix2d direct = fix.covariance;
  Eigen::Matrix2d shadow = fix.covariance;
  if (!noise.of_ranges) {
    direct = noise.scale * p.fix.direct_covariance(fix.covariance);
    shadow = noise.scale * p.fix.shadow_covariance(fix.covariance);
  }
  const auto of_modes = [&](int i, int j) URBAN_GNSS_INLINE_LAMBDA {
    const double added = i == j ? noise.added_m2 : 0.0;
    return Quad{direct(i, j), shadow(i, j), shadow(i, j), shadow(i, j)} + added;
  };
  const Symmetric2 white{of_modes(0, 0), of_modes(0, 1), of_modes(1, 1)};
  const Quad white_nis = sum(hph, quad(1.0), white).inverse().square(innovation_x, innovation_y);
  const Quad tail_dof{p.modes.student_dof, 1e6, 1e6, 1e6};
  const Quad weight = quad_min(quad(1.0), (tail_dof + kFixDof) / (tail_dof + white_nis));
  const Symmetric2 plain = sum(hph, quad(noise.inflation), white);
  const Quad nis = plain.inverse().square(innovation_x, innovation_y);
  const Quad log_used =
      std::log1p(-p.modes.outlier_share) - std::log(2.0 * kPi) + log_student(nis, tail_dof, plain.determinant());
  const double log_outlier = std::log(p.modes.outlier_density());  // -infinity where there are none
  const Quad ratio = quad_exp(-quad_abs(log_used - log_outlier));
  const Quad outlier = (log_used > log_outlier ? ratio : quad(1.0)) / (1.0 + ratio);
  const Quad log_likelihood = quad_max(log_used, quad(log_outlier)) + quad_log1p(ratio);
  correct(states, x, y, sum(hph, noise.inflation / weight, white), innovation_x, innovation_y, 1.0 - outlier, outlier);

  BiasQuadUpdate update;
  store(log_likelihood, update.log_likelihood.data());
  store(nis, update.nis.data());
  store(white_nis, update.white_nis.data());
  store(outlier, update.outlier.data());
  return update;
}

URBAN_GNSS_VECTORISED BiasQuadUpdate take_velocity(BiasQuad& states, const VelocityMeasurement& measured,
                                                   const Eigen::Matrix2d& noise, double inflation, double dof) {
  const QuadSineCosine heading = quad_sincos(mean(states, kYaw));
  const Eigen::Vector2d& body = measured.antenna_velocity_in_body;
  const Quad along_x = body.x() * heading.cosine - body.y() * heading.sine;
  const Quad along_y = body.x() * heading.sine + body.y() * heading.cosine;
  const Quad stretch = 1.0 + mean(states, kSpeedScale);
  const Quad predicted_x = stretch * along_x;
  const Quad predicted_y = stretch * along_y;
  const Quad innovation_x = measured.velocity.x() - predicted_x;
  const Quad innovation_y = measured.velocity.y() - predicted_y;
  Quad x[kBiasStates];
  Quad y[kBiasStates];
  for_each_state([&](int i) URBAN_GNSS_INLINE_LAMBDA {
    x[i] = along_x * covariance(states, i, kSpeedScale) - predicted_y * covariance(states, i, kYaw);
    y[i] = along_y * covariance(states, i, kSpeedScale) + predicted_x * covariance(states, i, kYaw);
  });
  const Symmetric2 hph{along_x * x[kSpeedScale] - predicted_y * x[kYaw],
                       along_x * y[kSpeedScale] - predicted_y * y[kYaw],
                       along_y * y[kSpeedScale] + predicted_x * y[kYaw]};
  const Symmetric2 white{quad(noise(0, 0)), quad(noise(0, 1)), quad(noise(1, 1))};
  const Quad white_nis = sum(hph, quad(1.0), white).inverse().square(innovation_x, innovation_y);
  const Quad weight = quad_min(quad(1.0), (dof + 2.0) / (dof + white_nis));
  const Symmetric2 plain = sum(hph, quad(inflation), white);
  const Quad nis = plain.inverse().square(innovation_x, innovation_y);
  const Quad log_likelihood = log_student(nis, quad(dof), plain.determinant());
  correct(states, x, y, sum(hph, inflation / weight, white), innovation_x, innovation_y, quad(1.0), Quad{});

  BiasQuadUpdate update;
  store(log_likelihood, update.log_likelihood.data());
  store(nis, update.nis.data());
  store(white_nis, update.white_nis.data());
  update.outlier = {};
  return update;
}

}  // namespace urban_gnss
