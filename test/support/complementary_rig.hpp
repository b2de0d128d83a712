#pragma once

#include <cmath>
#include <functional>
#include <string>

#include "matchers.hpp"
#include "urban_gnss_localization/gnss/chi_squared.hpp"
#include "urban_gnss_localization/localizers/kim/complementary_ekf.hpp"

namespace urban_gnss {

/// A robot that winds its way at 1.5 m/s, with odometry whose noise is the filter's own model and fixes at 1 Hz whose
/// errors are white, as declared, plus a bias.
struct Drive {
  static constexpr double kFixSigma_m = 1.5;

  ComplementaryEkfParameters parameters;
  ComplementaryEkf filter;
  RandomEngine engine;
  double rate_hz;
  double speed_mps{1.5};
  Pose2 truth;
  OdometryErrors errors;                              ///< of the odometry, constant
  std::function<Eigen::Vector2d(double since)> bias;  ///< m, by the time since run() was called; none where empty
  double time_s{0.0};
  FixOutcome last;

  explicit Drive(std::uint64_t seed, const std::string& yaml = "{}", double odometry_rate_hz = 10.0)
      : parameters(with(published_complementary_ekf(), yaml)),
        filter(parameters),
        engine(make_engine(seed)),
        rate_hz(odometry_rate_hz) {
    filter.initialize(pose_with_sigma(truth, 1.0, 0.1));
  }

  /// Truth and odometry errors as uncertain as the filter takes them for.
  void start_with_errors() {
    truth.x = draw_normal(engine);
    truth.y = draw_normal(engine);
    truth.yaw = 0.1 * draw_normal(engine);
    errors.speed_scale = parameters.odometry.speed_scale_sigma * draw_normal(engine);
    errors.yaw_rate_bias_radps = parameters.odometry.yaw_rate_bias_sigma * draw_normal(engine);
  }

  FixMeasurement make_fix(double since = 0.0) {
    FixMeasurement fix;
    fix.position = truth.position();
    fix.position.x() += kFixSigma_m * draw_normal(engine);
    fix.position.y() += kFixSigma_m * draw_normal(engine);
    if (bias) fix.position += bias(since);
    fix.covariance = isotropic(kFixSigma_m);
    fix.time_s = time_s;
    fix.stamp = from_seconds(time_s);
    return fix;
  }

  void step() {
    const double dt = 1.0 / rate_hz;
    const OdometryErrorParameters& p = parameters.odometry;
    time_s += dt;
    const Twist2 measured{speed_mps, speed_mps > 0.0 ? 0.2 * std::sin(0.1 * time_s) : 0.0};
    filter.move(measured, dt);
    if (is_standstill(measured, 1e-4)) return;
    MotionNoise noise;
    noise.speed = draw_normal(engine);
    // A share of the yaw rate, with its sign.
    noise.input = std::copysign(1.0, measured.yaw_rate_radps) * draw_normal(engine);
    truth = move_noisily(truth, make_motion_step(measured, dt, parameters.motion, p), noise, errors);
    truth.x += p.position_walk * std::sqrt(dt) * draw_normal(engine);
    truth.y += p.position_walk * std::sqrt(dt) * draw_normal(engine);
    truth.yaw = wrap_angle(truth.yaw + p.heading_walk * std::sqrt(dt) * draw_normal(engine));
    if (parameters.estimate_odometry_errors) {
      errors.speed_scale += p.speed_scale_walk * std::sqrt(dt) * draw_normal(engine);
      errors.yaw_rate_bias_radps += p.yaw_rate_bias_walk * std::sqrt(dt) * draw_normal(engine);
    }
  }

  /// A fix each second; `after_fix` sees it.
  void run(double duration_s, const std::function<void(const FixMeasurement&)>& after_fix = {}) {
    const auto steps = std::lround(duration_s * rate_hz);
    const auto per_fix = std::lround(rate_hz);
    for (long k = 1; k <= steps; ++k) {
      step();
      if (k % per_fix != 0) continue;
      const FixMeasurement fix = make_fix(static_cast<double>(k) / rate_hz);
      last = filter.correct(fix);
      if (after_fix) after_fix(fix);
    }
  }
  void run_without_fixes(double duration_s) {
    for (long k = 1; k <= std::lround(duration_s * rate_hz); ++k) step();
  }

  double error_m() const { return (filter.pose().position() - truth.position()).norm(); }
};

}  // namespace urban_gnss
