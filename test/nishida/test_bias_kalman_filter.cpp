#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "matchers.hpp"
#include "urban_gnss_localization/gnss/chi_squared.hpp"
#include "urban_gnss_localization/localizers/nishida/bias_kalman_filter.hpp"

namespace urban_gnss {
namespace {

/// Eq. (16)-(20) as printed, for one axis, in scalars: no matrix, no process noise, (I - K C) P.
struct PlainAxis {
  double x, v, pxx, pxv, pvv;

  void predict(double dt) {
    x += dt * v;
    pxx += 2.0 * dt * pxv + dt * dt * pvv;
    pxv += dt * pvv;
  }
  void correct(double z, double r) {
    const double kx = pxx / (pxx + r);
    const double kv = pxv / (pxx + r);
    const double innovation = z - x;
    x += kx * innovation;
    v += kv * innovation;
    pvv -= kv * pxv;
    pxv -= kx * pxv;
    pxx -= kx * pxx;
  }
};

TEST(BiasKalmanFilter, IsThePrintedFilterWithoutProcessNoiseEq16To20) {
  RandomEngine engine = make_engine(1);
  BiasKalmanFilter filter;
  filter.state << 1.0, 0.5, -2.0, 0.1;
  filter.covariance = Eigen::Vector4d(0.1, 100.0, 0.1, 100.0).asDiagonal();
  PlainAxis x{1.0, 0.5, 0.1, 0.0, 100.0};
  PlainAxis y{-2.0, 0.1, 0.1, 0.0, 100.0};
  const Eigen::Matrix2d noise = 0.1 * Eigen::Matrix2d::Identity();
  for (int k = 0; k < 1000; ++k) {
    const double dt = uniform_between(0.005, 0.02, engine);
    const Eigen::Vector2d z(5.0 * draw_normal(engine), 5.0 * draw_normal(engine));
    filter.predict(dt, 0.0);
    x.predict(dt);
    y.predict(dt);
    filter.correct(filter.innovation(z, noise), noise);
    x.correct(z.x(), 0.1);
    y.correct(z.y(), 0.1);
    // Rounding of the covariance (100, then smaller) that a thousand steps carry on.
    const Eigen::Vector4d plain(x.x, x.v, y.x, y.v);
    ASSERT_LT((filter.state - plain).norm(), 1e-9) << k;
    ASSERT_NEAR(filter.covariance(0, 0), x.pxx, 1e-11) << k;
    ASSERT_NEAR(filter.covariance(2, 3), y.pxv, 1e-10) << k;
    ASSERT_NEAR(filter.covariance(0, 2), 0.0, 1e-12) << k;
    ASSERT_EQ(filter.covariance, filter.covariance.transpose());
  }
}

TEST(BiasKalmanFilter, ProcessNoiseDoesNotDependOnHowTimeIsCut) {
  BiasKalmanFilter once, often;
  once.predict(2.0, 0.7);
  for (int k = 0; k < 200; ++k) often.predict(0.01, 0.7);
  EXPECT_LT((once.covariance - often.covariance).norm(), 1e-11);
}

/// The gain of the bias in x after `seconds` of fixes at 10 Hz that follow a ramp of 1 m/s which begins at 5 s.
struct Ramp {
  double error{0.0};
  double gain{0.0};
};
Ramp follow_ramp(double acceleration_density, double seconds) {
  BiasKalmanFilter filter;
  filter.covariance = Eigen::Vector4d(1.0, 9.0, 1.0, 9.0).asDiagonal();
  const Eigen::Matrix2d noise = Eigen::Matrix2d::Identity();
  Ramp result;
  for (int k = 1; k <= std::lround(10.0 * seconds); ++k) {
    const double bias = std::max(0.0, 0.1 * k - 5.0);
    filter.predict(0.1, acceleration_density);
    const double before = filter.position().x();
    const auto innovation = filter.innovation({bias, 0.0}, noise);
    filter.correct(innovation, noise);
    if (std::abs(innovation.value.x()) > 1e-12) result.gain = (filter.position().x() - before) / innovation.value.x();
    result.error = std::abs(filter.position().x() - bias);
  }
  return result;
}

TEST(BiasKalmanFilter, ProcessNoiseFollowsARampWhereThePrintedFilterDoesNot) {
  const Ramp with_noise = follow_ramp(1.0, 30.0);
  const Ramp printed_early = follow_ramp(0.0, 8.0);
  const Ramp printed = follow_ramp(0.0, 30.0);
  EXPECT_LT(with_noise.error, 0.01);  // a ramp is the filter's own model: no lag is left
  EXPECT_GT(printed.error, 0.5);
  // Least squares of a line through n fixes: the last one has a gain of 4 / n.
  EXPECT_NEAR(printed.gain, 4.0 / 300.0, 0.001);
  EXPECT_NEAR(printed_early.gain, 4.0 / 80.0, 0.005);
  EXPECT_GT(with_noise.gain, 0.1);
}

// Data drawn from the filter's own model: the sum of n NIS is chi-square with 2 n degrees of freedom.
TEST(BiasKalmanFilter, NisOfMatchedDataIsChiSquare) {
  RandomEngine engine = make_engine(2);
  const double dt = 0.2, density = 0.5, sigma = 2.0;
  constexpr int kFixes = 4000;
  const Eigen::Matrix2d noise = isotropic(sigma);
  // One step of the process noise: the Cholesky factor of q^2 (dt^3/3, dt^2/2; dt^2/2, dt).
  const double lxx = density * std::sqrt(dt * dt * dt / 3.0);
  const double lvx = density * density * dt * dt / 2.0 / lxx;
  const double lvv = std::sqrt(density * density * dt - lvx * lvx);
  BiasKalmanFilter filter;
  filter.covariance = Eigen::Vector4d(4.0, 1.0, 4.0, 1.0).asDiagonal();
  double position[2], velocity[2], nis_sum = 0.0;
  for (int axis = 0; axis < 2; ++axis) {
    position[axis] = 2.0 * draw_normal(engine);
    velocity[axis] = draw_normal(engine);
  }
  int above = 0;
  for (int k = 0; k < kFixes; ++k) {
    Eigen::Vector2d z;
    for (int axis = 0; axis < 2; ++axis) {
      const double n1 = draw_normal(engine), n2 = draw_normal(engine);
      position[axis] += dt * velocity[axis] + lxx * n1;
      velocity[axis] += lvx * n1 + lvv * n2;
      z(axis) = position[axis] + sigma * draw_normal(engine);
    }
    filter.predict(dt, density);
    const auto innovation = filter.innovation(z, noise);
    nis_sum += innovation.nis();
    above += innovation.nis() > chi_squared_quantile(0.99, 2);
    filter.correct(innovation, noise);
  }
  EXPECT_NEAR(nis_sum, 2.0 * kFixes, 4.5 * std::sqrt(4.0 * kFixes));
  EXPECT_NEAR(above, 0.01 * kFixes, 4.5 * std::sqrt(0.01 * 0.99 * kFixes));
}

LocalFix fix_at(double seconds, const Eigen::Vector2d& position) {
  return {from_seconds(seconds), position, isotropic(1.0)};
}

TEST(BiasTracker, RadiusIsTheLengthOfTheResidualOrAsPrintedOfThePosition) {
  const Eigen::Vector2d antenna(300.0, 400.0);
  for (const BiasInput input : {BiasInput::kResidual, BiasInput::kPosition}) {
    GpsBiasParameters parameters;
    parameters.bias_input = input;
    BiasTracker tracker(parameters);
    for (int k = 0; k < 600; ++k) tracker.process(fix_at(0.2 * k, antenna + Eigen::Vector2d(-3.0, 4.0)), antenna);
    const BiasEstimate& estimate = tracker.estimate();
    EXPECT_EQ(estimate.stamp, from_seconds(0.2 * 599));
    EXPECT_NEAR(estimate.radius_m, estimate.bias.norm(), 1e-12);
    // Without noise the filter converges to what it is fed.
    const bool residual = input == BiasInput::kResidual;
    EXPECT_NEAR(estimate.radius_m, residual ? 5.0 : std::hypot(297.0, 404.0), 1e-6);
    EXPECT_EQ(estimate.in_shadow, true);
  }
}

// Eq. (14) to (21), typed out from the text, with C in (19) in place of the printed transpose, which does not multiply.
TEST(BiasTracker, LiteralIsThePrintedFilter) {
  GpsBiasParameters parameters = with(GpsBiasParameters{}, "mode: literal");
  parameters.shadow_sigma = 2.0;
  BiasTracker tracker(parameters);
  Eigen::Vector4d eta(100.0, 0.0, 50.0, 0.0);
  Eigen::Matrix4d p = Eigen::Vector4d(4.0, 9.0, 4.0, 9.0).asDiagonal();  // nothing is printed: sigma_s, 3 m/s
  Eigen::Matrix4d a = Eigen::Matrix4d::Identity();
  a(0, 1) = a(2, 3) = 0.2;
  Eigen::Matrix<double, 2, 4> c = Eigen::Matrix<double, 2, 4>::Zero();
  c(0, 0) = c(1, 2) = 1.0;
  for (int k = 0; k < 200; ++k) {
    // No gate: from the 100th on a kilometre aside. Where the antenna is said to be does not matter.
    const Eigen::Vector2d z(100.0 + 0.5 * k + (k < 100 ? 0.0 : 1000.0), 50.0 - 0.1 * k);
    const BiasEstimate& estimate = tracker.process(fix_at(0.2 * k, z), {3.0 * k, -7.0});
    if (k > 0) {
      eta = a * eta;
      p = a * p * a.transpose();
    }
    const Eigen::Matrix2d s = c * p * c.transpose() + 4.0 * Eigen::Matrix2d::Identity();
    const Eigen::Matrix<double, 4, 2> gain = p * c.transpose() * s.inverse();
    eta += gain * (z - c * eta);
    p = (Eigen::Matrix4d::Identity() - gain * c) * p;
    ASSERT_FALSE(is_rejected(estimate.outcome.decision)) << k;
    ASSERT_NEAR(estimate.radius_m, std::hypot(eta(0), eta(2)), 1e-6) << k;
    ASSERT_NEAR(estimate.bias.x(), eta(0), 1e-6) << k;
  }
}

TEST(BiasTracker, ShadowIsSetWhileTheBiasIsSignificant) {
  RandomEngine engine = make_engine(3);
  GpsBiasParameters parameters;
  parameters.shadow_sigma = 1.0;
  BiasTracker tracker(parameters);
  int sun_alarms = 0, shadow_misses = 0;
  for (int k = 0; k < 1000; ++k) {
    const double time = 0.2 * k;
    // A trapezoid: 80 s none, up to 15 m in 20 s, held, back, none.
    const double bias = std::clamp(std::min(time - 80.0, 150.0 - time), 0.0, 15.0);
    const Eigen::Vector2d noise(draw_normal(engine), draw_normal(engine));
    const BiasEstimate& e = tracker.process(fix_at(time, Eigen::Vector2d(0.0, bias) + noise), {0.0, 0.0});
    EXPECT_EQ(e.in_shadow, e.shadow_statistic > e.shadow_threshold);
    EXPECT_EQ(e.outcome.decision == FixDecision::kBiasCompensated, e.in_shadow && !is_rejected(e.outcome.decision));
    if (time < 75.0 || time > 165.0) sun_alarms += e.in_shadow;
    if (time > 90.0 && time < 140.0) shadow_misses += !e.in_shadow;
  }
  EXPECT_NEAR(tracker.estimate().shadow_threshold, chi_squared_quantile(0.99, 2), 1e-12);
  // 550 fixes in the sun, 1 % each, in runs as the filter's estimates are correlated over some twenty fixes.
  EXPECT_LE(sun_alarms, 40);
  EXPECT_EQ(shadow_misses, 0);
}

TEST(BiasTracker, GateRejectsAJumpAndRecoversAfterItsTimeout) {
  GpsBiasParameters parameters;
  parameters.gate_timeout = 5.0;
  BiasTracker tracker(parameters);
  for (int k = 0; k <= 20; ++k) tracker.process(fix_at(k, {0.5, 0.0}), {0.0, 0.0});
  const BiasEstimate before = tracker.estimate();
  ASSERT_FALSE(before.in_shadow);

  for (int k = 21; k < 25; ++k) {
    const BiasEstimate& e = tracker.process(fix_at(k, {60.0, 0.0}), {0.0, 0.0});
    EXPECT_EQ(e.outcome.decision, FixDecision::kRejectedGate) << k;
    EXPECT_GT(e.outcome.nis, e.outcome.nis_threshold);
    EXPECT_NEAR(e.outcome.nis_threshold, chi_squared_quantile(0.99, 2), 1e-12);
    EXPECT_EQ(e.outcome.nis_dof, 2);
    EXPECT_EQ(e.stamp, from_seconds(k));
    EXPECT_EQ(e.bias, before.bias);
    EXPECT_EQ(e.covariance, before.covariance);
    EXPECT_EQ(e.in_shadow, before.in_shadow);
  }
  const BiasEstimate& recovered = tracker.process(fix_at(25, {60.0, 0.0}), {0.0, 0.0});
  EXPECT_EQ(recovered.outcome.decision, FixDecision::kBiasCompensated);
  EXPECT_NEAR(recovered.radius_m, 60.0, 1e-9);
  EXPECT_NE(recovered.outcome.reason, "");
  // The way back is gated in the same way, and ends in the same way.
  EXPECT_EQ(tracker.process(fix_at(26, {0.0, 0.0}), {0.0, 0.0}).outcome.decision, FixDecision::kRejectedGate);
  for (int k = 27; k <= 40; ++k) tracker.process(fix_at(k, {0.0, 0.0}), {0.0, 0.0});
  EXPECT_LT(tracker.estimate().radius_m, 0.5);
  EXPECT_FALSE(tracker.estimate().in_shadow);
}

TEST(BiasTracker, OneGoodFixStartsTheTimeoutAnew) {
  BiasTracker tracker({});
  for (int k = 0; k <= 100; ++k) {
    const bool jumps = k > 20 && k % 4 != 0;
    const BiasEstimate& e = tracker.process(fix_at(k, {jumps ? 60.0 : 0.0, 0.0}), {0.0, 0.0});
    EXPECT_EQ(is_rejected(e.outcome.decision), jumps) << k;
  }
}

TEST(BiasTracker, ValidationsDecisionIsPassedOn) {
  BiasTracker tracker({});
  FixOutcome inflated;
  inflated.decision = FixDecision::kInflated;
  inflated.covariance_clamped = true;
  const BiasEstimate& e = tracker.process(fix_at(1, {0.0, 0.0}), {0.0, 0.0}, inflated);
  EXPECT_EQ(e.outcome.decision, FixDecision::kInflated);
  EXPECT_TRUE(e.outcome.covariance_clamped);
  EXPECT_EQ(tracker.process(fix_at(2, {0.0, 0.0}), {0.0, 0.0}).outcome.decision, FixDecision::kAccepted);
}

TEST(BiasTracker, ResetForgetsEverything) {
  BiasTracker used({});
  for (int k = 0; k < 20; ++k) used.process(fix_at(100 + k, {3.0, 1.0}), {0.0, 0.0});
  used.reset();
  EXPECT_EQ(used.estimate().radius_m, 0.0);
  BiasTracker fresh({});
  for (int k = 0; k < 5; ++k) {  // older stamps than before
    const BiasEstimate a = used.process(fix_at(k, {1.0, 2.0}), {0.0, 0.0});
    const BiasEstimate b = fresh.process(fix_at(k, {1.0, 2.0}), {0.0, 0.0});
    EXPECT_EQ(a.bias, b.bias);
    EXPECT_EQ(a.covariance, b.covariance);
    EXPECT_EQ(a.outcome.nis, b.outcome.nis);
  }
}

TEST(BiasTracker, EveryParameterHasAnEffect) {
  const auto trace = [](const GpsBiasParameters& parameters) {
    BiasTracker tracker(parameters);
    std::vector<double> values;
    for (int k = 0; k < 40; ++k) {
      const double bias = k == 10 ? 14.0 : k < 20 ? 0.8 * k : 70.0;
      const BiasEstimate& e = tracker.process(fix_at(k, {bias, 2.0}), {1.0, 0.0});
      values.insert(values.end(), {e.radius_m, e.shadow_threshold, double(e.outcome.decision)});
    }
    return values;
  };
  const std::vector<std::string> changes = {
      "mode: literal",        "bias_input: position",  "shadow_sigma: 2.0", "bias_acceleration_density: 0.5",
      "bias_rate_sigma: 1.0", "gate_probability: 0.5", "gate_timeout: 2.0", "shadow_probability: 0.9"};
  for (const std::string& change : changes) EXPECT_NE(trace(with(GpsBiasParameters{}, change)), trace({})) << change;
  EXPECT_EQ(changes.size(), parameter_names(GpsBiasParameters{}).size());
}

}  // namespace
}  // namespace urban_gnss
