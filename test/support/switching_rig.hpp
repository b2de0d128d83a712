#pragma once

#include <Eigen/Dense>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "matchers.hpp"
#include "urban_gnss_localization/localizers/localizer.hpp"

namespace urban_gnss {

/// The filters for what the tests simulate: fixes whose errors are white, Gaussian and of the declared size but for a
/// bias that walks, and odometry without a noise of its own while it moves.
const char* const kTextbookNoise =
    "{fix_scale_rate: 0.0, fix_covariance_weight: 1.0, correlation_time: 0.0, correlation_distance: 0.0, "
    "wander_share: 0.0, student_dof: 1.0e+9, velocity_correlation_time: 0.0, "
    "common_error_share: 0.0, range_common_error_share: 0.0, common_error_min: 0.0, "
    "bias_fade_time: 0.0, position_walk: 0.0, heading_walk: 0.0, motion_noise_factor: 0.1, speed_scale_sigma: 0.03, "
    "yaw_rate_bias_walk: 3.0e-5, direct_time: 60.0, slow_bias_time: 20.0, fast_bias_time: 1.0, bias_end_time: 60.0, "
    "jump_share: 0.9, slow_bias_walk: 0.2, fast_bias_walk: 1.0, jump_sigma: 20.0, onset_sigma: 0.5, "
    "outlier_share: 0.01, outlier_radius: 200.0}";

/// A change of a parameter, and what else is set for it to have an effect: YAML over the textbook's values.
using ParameterChange = std::pair<std::string, std::string>;

/// Of the parameters that the filters of the switching model have alike, each with an effect on a drive with a bias.
inline std::vector<ParameterChange> switching_model_changes() {
  return {
      {"use_fix_covariance: false", "{}"},
      {"direct_sigma: 1.0", "{}"},
      {"shadow_sigma: 1.0", "{}"},
      {"direct_time: 20.0", "{}"},
      {"slow_bias_time: 5.0", "{}"},
      {"fast_bias_time: 3.0", "{}"},
      {"bias_end_time: 5.0", "{}"},
      {"jump_share: 0.5", "{}"},
      {"slow_bias_walk: 0.5", "{}"},
      {"fast_bias_walk: 3.0", "{}"},
      {"jump_sigma: 5.0", "{}"},
      {"onset_sigma: 1.0", "{}"},
      {"outlier_share: 0.1", "{}"},
      {"outlier_radius: 20.0", "{}"},
      {"motion_noise_factor: 1.0", "{}"},
      {"speed_scale_sigma: 0.01", "{}"},
      {"speed_scale_walk: 0.01", "{}"},
      {"yaw_rate_bias_sigma: 0.01", "{}"},
      {"yaw_rate_bias_walk: 0.001", "{}"},
      {"position_walk: 0.2", "{}"},
      {"heading_walk: 0.05", "{}"},
      {"bias_fade_time: 5.0", "{}"},
      {"student_dof: 2.0", "{}"},
      {"fix_scale_rate: 0.1", "{}"},
      {"correlation_time: 2.0", "{}"},
      {"correlation_distance: 5.0", "{}"},
      {"fix_scale_limit: 1.05", "fix_scale_rate: 0.1"},
      {"fix_scale_lag: 0.0", "fix_scale_rate: 0.1"},
      {"fix_scale_distance: 5.0", "fix_scale_rate: 0.1"},
      {"first_fix_scale: 3.0", "fix_scale_rate: 0.1"},
      {"yaw_rate_scale_sigma: 0.02", "{}"},
      {"wander_share: 0.5", "heading_walk: 0.002"},
      {"wander_factor: 3.0", "{wander_share: 0.5, heading_walk: 0.002}"},
      {"quality_time: 5.0", "{wander_share: 0.5, heading_walk: 0.002}"},
      {"quality_evidence: 1.0", "{wander_share: 0.5, heading_walk: 0.002}"},
  };
}

/// A robot on a loop with odometry that is wrong by scale and bias, and fixes with a bias of the test's choosing.
struct SwitchingDrive {
  double speed_mps{1.5};
  double yaw_rate_radps{0.05};
  double odometry_interval_s{0.1};
  int odometry_per_fix{5};
  double duration_s{120.0};
  double fix_sigma_m{0.5};
  OdometryErrors errors{0.01, 0.002};
  std::function<Eigen::Vector2d(double time_s)> bias{[](double) { return Eigen::Vector2d::Zero().eval(); }};
  std::uint64_t seed{101};
};

/// What a filter made of one fix.
struct SwitchingStep {
  double time_s;
  double error_m;
  double nees;  ///< of x, y and yaw
  FixOutcome outcome;
  PoseEstimate estimate;
};

inline FixMeasurement fix_of(const Eigen::Vector2d& position, double sigma_m, double time_s) {
  FixMeasurement fix;
  fix.position = position;
  fix.covariance = isotropic(sigma_m);
  fix.time_s = time_s;
  return fix;
}

/// Drives with the localizer started at the truth as uncertain as `start`.
inline std::vector<SwitchingStep> drive(Localizer& localizer, const SwitchingDrive& d, const Pose2& origin = {}) {
  RandomEngine engine = make_engine(d.seed);
  Pose2 truth = origin;
  PoseEstimate start = pose_with_sigma(truth, 0.3, 0.05);
  start.pose.x += 0.3 * draw_normal(engine);
  start.pose.y += 0.3 * draw_normal(engine);
  start.pose.yaw += 0.05 * draw_normal(engine);
  localizer.initialize(start);
  std::vector<SwitchingStep> steps;
  const auto count = static_cast<int>(d.duration_s / d.odometry_interval_s);
  for (int k = 1; k <= count; ++k) {
    const Twist2 measured{d.speed_mps, d.yaw_rate_radps};
    Twist2 actual = corrected(measured, d.errors);
    actual.speed_mps += 0.02 * draw_normal(engine);
    actual.yaw_rate_radps += 0.005 * draw_normal(engine);
    truth = move(truth, actual, d.odometry_interval_s);
    localizer.move(measured, d.odometry_interval_s);
    if (k % d.odometry_per_fix != 0) continue;
    const double time_s = k * d.odometry_interval_s;
    const double east = d.fix_sigma_m * draw_normal(engine);
    const double north = d.fix_sigma_m * draw_normal(engine);
    const Eigen::Vector2d position = truth.position() + d.bias(time_s) + Eigen::Vector2d(east, north);
    const FixOutcome outcome = localizer.correct(fix_of(position, d.fix_sigma_m, time_s));
    const PoseEstimate estimate = localizer.estimate();
    const Eigen::Vector3d error(estimate.pose.x - truth.x, estimate.pose.y - truth.y,
                                angle_difference(estimate.pose.yaw, truth.yaw));
    steps.push_back(
        {time_s, error.head<2>().norm(), error.dot(estimate.covariance.ldlt().solve(error)), outcome, estimate});
  }
  return steps;
}

/// Root mean square of the position's error (m) between two times.
inline double rmse_between(const std::vector<SwitchingStep>& steps, double from_s, double to_s) {
  double sum = 0.0;
  int count = 0;
  for (const SwitchingStep& step : steps) {
    if (step.time_s < from_s || step.time_s >= to_s) continue;
    sum += step.error_m * step.error_m;
    ++count;
  }
  return std::sqrt(sum / count);
}

inline std::function<Eigen::Vector2d(double)> bias_between(double from_s, double to_s, const Eigen::Vector2d& bias) {
  return [=](double time_s) { return time_s >= from_s && time_s < to_s ? bias : Eigen::Vector2d::Zero().eval(); };
}

/// A bias that grows steadily from `from_s` on to `end` at `to_s`, and stays.
inline std::function<Eigen::Vector2d(double)> ramp_between(double from_s, double to_s, const Eigen::Vector2d& end) {
  return
      [=](double time_s) { return Eigen::Vector2d(std::clamp((time_s - from_s) / (to_s - from_s), 0.0, 1.0) * end); };
}

}  // namespace urban_gnss
