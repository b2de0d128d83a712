#include <cmath>

#include "quad_states.hpp"
#include "urban_gnss_localization/gnss/chi_squared.hpp"

namespace urban_gnss {
namespace {

/// A symmetric matrix of 2 x 2.
struct Symmetric2 {
  Quad xx, xy, yy;

  URBAN_GNSS_INLINE Quad determinant() const { return xx * yy - xy * xy; }
  URBAN_GNSS_INLINE Symmetric2 inverse() const {
    const Quad factor = 1.0 / determinant();
    return {yy * factor, -xy * factor, xx * factor};
  }
  /// v' A^-1 v.
  URBAN_GNSS_INLINE Quad square_by_inverse(const Quad& x, const Quad& y) const {
    return (x * (yy * x - xy * y) + y * (xx * y - xy * x)) / determinant();
  }
};
URBAN_GNSS_INLINE Symmetric2 sum(const Symmetric2& a, const Quad& factor, const Symmetric2& b) {
  return {a.xx + factor * b.xx, a.xy + factor * b.xy, a.yy + factor * b.yy};
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

/// What take_fix() needs beside the states, the same of every quality.
struct QuadFix {
  Eigen::Vector2d position, antenna_in_body;
  Symmetric2 white;
  double inflation;
  Quad tail_dof;
  double log_kept;     ///< of a fix that is no outlier, with the constant of Student's t
  double log_outlier;  ///< -infinity where there are none
};

/// A fix as the states of a quality see it.
struct QuadSight {
  Quad innovation_x, innovation_y;
  Quad x[kBiasStates], y[kBiasStates];  ///< P H', as columns
  Symmetric2 hph;
};
URBAN_GNSS_INLINE void see(const BiasQuad& states, const QuadFix& fix, QuadSight& sight) {
  constexpr Quad kIsBiased{0.0, 1.0, 1.0, 1.0};
  const QuadSineCosine heading = quad_sincos(mean(states, kYaw));
  const Quad lever_x = fix.antenna_in_body.x() * heading.cosine - fix.antenna_in_body.y() * heading.sine;
  const Quad lever_y = fix.antenna_in_body.x() * heading.sine + fix.antenna_in_body.y() * heading.cosine;
  sight.innovation_x = fix.position.x() - (mean(states, 0) + lever_x) - kIsBiased * mean(states, kBias);
  sight.innovation_y = fix.position.y() - (mean(states, 1) + lever_y) - kIsBiased * mean(states, kBias + 1);
  Quad(&x)[kBiasStates] = sight.x;
  Quad(&y)[kBiasStates] = sight.y;
  for_each_state([&](int i) URBAN_GNSS_INLINE_LAMBDA {
    const Quad by_yaw = covariance(states, i, kYaw);
    x[i] = covariance(states, i, 0) - lever_y * by_yaw + kIsBiased * covariance(states, i, kBias);
    y[i] = covariance(states, i, 1) + lever_x * by_yaw + kIsBiased * covariance(states, i, kBias + 1);
  });
  sight.hph = {x[0] - lever_y * x[kYaw] + kIsBiased * x[kBias], y[0] - lever_y * y[kYaw] + kIsBiased * y[kBias],
               y[1] + lever_x * y[kYaw] + kIsBiased * y[kBias + 1]};
}

/// What the fix says to them. Returns the covariance of the innovation by which they are corrected.
URBAN_GNSS_INLINE Symmetric2 judge(const QuadSight& sight, const QuadFix& fix, BiasQuadUpdate& update) {
  const Quad white_nis = sum(sight.hph, quad(1.0), fix.white).square_by_inverse(sight.innovation_x, sight.innovation_y);
  const Quad weight = quad_min(quad(1.0), (fix.tail_dof + kFixDof) / (fix.tail_dof + white_nis));
  const Symmetric2 plain = sum(sight.hph, quad(fix.inflation), fix.white);
  const Quad nis = plain.square_by_inverse(sight.innovation_x, sight.innovation_y);
  const Quad log_used = fix.log_kept + log_student(nis, fix.tail_dof, plain.determinant());
  const Quad ratio = quad_exp(-quad_abs(log_used - fix.log_outlier));
  const Quad outlier = (log_used > fix.log_outlier ? ratio : quad(1.0)) / (1.0 + ratio);
  store(quad_max(log_used, quad(fix.log_outlier)) + quad_log1p(ratio), update.log_likelihood.data());
  store(nis, update.nis.data());
  store(white_nis, update.white_nis.data());
  store(outlier, update.outlier.data());
  return sum(sight.hph, fix.inflation / weight, fix.white);
}

URBAN_GNSS_INLINE BiasQuadUpdate take_velocity(BiasQuad& states, const VelocityMeasurement& measured,
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
  const Quad white_nis = sum(hph, quad(1.0), white).square_by_inverse(innovation_x, innovation_y);
  const Quad weight = quad_min(quad(1.0), (dof + 2.0) / (dof + white_nis));
  const Symmetric2 plain = sum(hph, quad(inflation), white);
  const Quad nis = plain.square_by_inverse(innovation_x, innovation_y);
  const Quad log_likelihood = log_student(nis, quad(dof), plain.determinant());
  correct(states, x, y, sum(hph, inflation / weight, white), innovation_x, innovation_y, quad(1.0), Quad{});

  BiasQuadUpdate update;
  store(log_likelihood, update.log_likelihood.data());
  store(nis, update.nis.data());
  store(white_nis, update.white_nis.data());
  update.outlier = {};
  return update;
}

}  // namespace

URBAN_GNSS_VECTORISED BiasQuadUpdates take_fix(BiasQuads& filters, const FixMeasurement& fix, const FixNoise& noise,
                                               const SwitchingModelParameters& p) {
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
  const QuadFix same{fix.position,
                     fix.antenna_in_body,
                     {of_modes(0, 0), of_modes(0, 1), of_modes(1, 1)},
                     noise.inflation,
                     {p.modes.student_dof, 1e6, 1e6, 1e6},
                     std::log1p(-p.modes.outlier_share) - std::log(2.0 * kPi),
                     std::log(p.modes.outlier_density())};
  // One step after the other for all qualities, which need not wait for each other.
  QuadSight sights[kQualityLevels];
  Symmetric2 innovation[kQualityLevels];
  BiasQuadUpdates updates;
  for (std::size_t level = 0; level < kQualityLevels; ++level) see(filters[level], same, sights[level]);
  for (std::size_t level = 0; level < kQualityLevels; ++level) {
    innovation[level] = judge(sights[level], same, updates[level]);
  }
  for (std::size_t level = 0; level < kQualityLevels; ++level) {
    const Quad outlier = load(updates[level].outlier.data());
    const QuadSight& sight = sights[level];
    correct(filters[level], sight.x, sight.y, innovation[level], sight.innovation_x, sight.innovation_y, 1.0 - outlier,
            outlier);
  }
  return updates;
}

URBAN_GNSS_VECTORISED BiasQuadUpdates take_velocity(BiasQuads& filters, const VelocityMeasurement& measured,
                                                    const Eigen::Matrix2d& noise, double inflation, double dof) {
  BiasQuadUpdates updates;
  for (std::size_t level = 0; level < kQualityLevels; ++level) {
    updates[level] = take_velocity(filters[level], measured, noise, inflation, dof);
  }
  return updates;
}

}  // namespace urban_gnss
