// The UKF as Maier and Kleiner print it, against the textbook's transform written out plainly.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "ukf_rig.hpp"
#include "urban_gnss_localization/common/positive_definite.hpp"
#include "urban_gnss_localization/localizers/registry.hpp"
#include "urban_gnss_localization/parameters/parameter_list.hpp"

namespace urban_gnss {
namespace {

UkfParameters printed(const std::string& yaml = "") { return with(UkfParameters(), "{mode: as_printed" + yaml + "}"); }

/// Section III-A with three states: eq. (1) and (2) by the scaled unscented transform (Wan and van der Merwe 2000).
struct PrintedFilter {
  MotionParameters motion;
  double alpha{0.5}, beta{2.0}, kappa{0.0};
  Eigen::Vector3d x{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d p{Eigen::Vector3d(1.0, 1.0, 0.01).asDiagonal()};

  template <int N>
  Eigen::Matrix<double, N, 2 * N + 1> points(const Eigen::Matrix<double, N, 1>& mean,
                                             const Eigen::Matrix<double, N, N>& covariance) const {
    const Eigen::Matrix<double, N, N> scaled = alpha * alpha * (N + kappa) * covariance;
    const Eigen::Matrix<double, N, N> root = scaled.llt().matrixL();
    Eigen::Matrix<double, N, 2 * N + 1> all;
    all.col(0) = mean;
    for (int i = 0; i < N; ++i) {
      all.col(1 + i) = mean + root.col(i);
      all.col(1 + N + i) = mean - root.col(i);
    }
    return all;
  }
  /// Of point i of n dimensions, in the mean or in a covariance.
  double weight(int i, int n, bool is_of_mean) const {
    const double spread = alpha * alpha * (n + kappa);  // n + lambda
    if (i > 0) return 0.5 / spread;
    return (spread - n) / spread + (is_of_mean ? 0.0 : 1.0 - alpha * alpha + beta);
  }

  void predict(const Twist2& twist, double dt) {
    using Vector6 = Eigen::Matrix<double, 6, 1>;
    using Matrix6 = Eigen::Matrix<double, 6, 6>;
    Vector6 mean = Vector6::Zero();
    mean.head<3>() = x;
    Matrix6 covariance = Matrix6::Identity();
    covariance.topLeftCorner<3, 3>() = p;
    const auto before = points<6>(mean, covariance);
    const MotionStep step = make_motion_step(twist, dt, motion);
    Eigen::Matrix<double, 3, 13> after;
    for (int i = 0; i < 13; ++i) {
      MotionNoise noise;
      noise.speed = before(3, i);
      noise.input = before(4, i);
      noise.yaw_rate = before(5, i);
      const Pose2 pose = move_noisily({before(0, i), before(1, i), before(2, i)}, step, noise);
      after.col(i) << pose.x, pose.y, pose.yaw;
    }
    x.setZero();
    for (int i = 0; i < 13; ++i) x += weight(i, 6, true) * after.col(i);
    p.setZero();
    for (int i = 0; i < 13; ++i) p += weight(i, 6, false) * (after.col(i) - x) * (after.col(i) - x).transpose();
  }

  /// The NIS.
  double correct(const FixMeasurement& fix) {
    const auto states = points<3>(x, p);
    Eigen::Matrix<double, 2, 7> antennas;
    Eigen::Vector2d expected = Eigen::Vector2d::Zero();
    for (int i = 0; i < 7; ++i) {
      antennas.col(i) = transform_point({states(0, i), states(1, i), states(2, i)}, fix.antenna_in_body);
      expected += weight(i, 3, true) * antennas.col(i);
    }
    Eigen::Matrix2d s = fix.covariance;
    Eigen::Matrix<double, 3, 2> cross = Eigen::Matrix<double, 3, 2>::Zero();
    for (int i = 0; i < 7; ++i) {
      s += weight(i, 3, false) * (antennas.col(i) - expected) * (antennas.col(i) - expected).transpose();
      cross += weight(i, 3, false) * (states.col(i) - x) * (antennas.col(i) - expected).transpose();
    }
    const Eigen::Vector2d innovation = fix.position - expected;
    const Eigen::Matrix<double, 3, 2> gain = cross * s.inverse();
    x += gain * innovation;
    p -= gain * s * gain.transpose();
    return innovation.dot(s.inverse() * innovation);
  }
};

TEST(UkfAsPrinted, IsTheTextbooksTransformOfThePose) {
  for (const double alpha : {0.5, 1.0}) {
    PrintedFilter plain;
    plain.alpha = alpha;
    Ukf ukf(printed(", ukf_alpha: " + std::to_string(alpha)), plain.motion);
    ukf.initialize(pose_with_sigma({}, 1.0, 0.1));
    RandomEngine engine = make_engine(31);
    Pose2 truth;
    double largest_nis = 0.0;
    for (int i = 1; i <= 1500; ++i) {
      const Twist2 twist = i > 1300 ? Twist2{} : Twist2{1.5, 0.2 * std::sin(0.02 * i)};
      truth = move(truth, {1.02 * twist.speed_mps, twist.yaw_rate_radps}, 0.1);
      ukf.move(twist, 0.1);
      plain.predict(twist, 0.1);
      if (i % 5 == 0) {
        FixMeasurement fix = fix_at(truth.position(), i % 50 == 0 ? 600.0 : 2.0, 0.1 * i);
        fix.antenna_in_body = {0.5, 0.2};
        fix.position += (i % 100 == 0 ? 40.0 : 2.0) * Eigen::Vector2d(draw_normal(engine), draw_normal(engine));
        fix.covariance(0, 1) = fix.covariance(1, 0) = 1.0;
        const double nis = plain.correct(fix);
        largest_nis = std::max(largest_nis, nis);
        const FixOutcome outcome = ukf.correct(fix);
        ASSERT_EQ(outcome.decision, FixDecision::kAccepted) << i;
        ASSERT_NEAR(outcome.nis, nis, 1e-6 * (1.0 + nis)) << i;
      }
      ASSERT_TRUE(near(ukf.pose(), {plain.x(0), plain.x(1), plain.x(2)}, 1e-6)) << i;
      ASSERT_TRUE(ukf.estimate().covariance.isApprox(plain.p, 1e-6)) << i << '\n'
                                                                     << ukf.covariance() << "\n\n"
                                                                     << plain.p;
    }
    EXPECT_GT(largest_nis, 9.2) << "beyond what a gate would have let pass";
    EXPECT_EQ(ukf.covariance().bottomRows<2>().norm(), 0.0) << "three states";
    EXPECT_EQ(ukf.speed_scale(), 0.0);
    EXPECT_EQ(ukf.yaw_rate_bias_radps(), 0.0);
  }
}

/// What is ours is in these parameters.
const char* const kOurs =
    ", outliers: gate, student_dof: 5.0, gate_probability: 0.6, gate_timeout: 1.0, fix_scale_rate: 0.2, "
    "first_fix_scale: 9.0, fix_covariance_weight: 0.1, fix_scale_limit: 3.0, correlation_distance: 100.0, "
    "correlation_time: 100.0, fix_scale_lag: 5.0, fix_scale_distance: 5.0, reacquisition_gap: 0.5, "
    "reacquisition_sigma: 50.0, reacquisition_time: 9.0, common_error_share: 1.0, common_error_min: 3.0, "
    "common_error_max: 9.0, motion_noise_factor: 2.0, speed_scale_sigma: 0.3, speed_scale_walk: 0.01, "
    "yaw_rate_bias_sigma: 0.1, yaw_rate_bias_walk: 0.01, position_walk: 0.5, heading_walk: 0.05, parked_walk: 1.0";

/// Pose, its covariance and the decisions of a drive with spikes, an outage and a stop.
std::vector<double> trace_of(const UkfParameters& parameters, const MotionParameters& motion = {}) {
  Ukf ukf(parameters, motion);
  ukf.initialize(pose_with_sigma({}, 1.0, 0.1));
  RandomEngine engine = make_engine(32);
  Pose2 truth;
  std::vector<double> trace;
  for (int i = 1; i <= 1500; ++i) {
    const Twist2 twist = i > 1200 ? Twist2{} : Twist2{1.5, 0.2 * std::sin(0.01 * i)};
    truth = move(truth, twist, 0.1);
    ukf.move(twist, 0.1);
    if (i % 10 != 0 || (i > 600 && i < 800)) continue;
    FixMeasurement fix = fix_at(truth.position(), 2.0 + 0.01 * (i % 300), 0.1 * i);
    fix.antenna_in_body = {0.5, 0.2};
    fix.position += (i % 100 == 0 ? 40.0 : 2.0) * Eigen::Vector2d(draw_normal(engine), draw_normal(engine));
    const FixOutcome outcome = ukf.correct(fix);
    const PoseEstimate estimate = ukf.estimate();
    trace.insert(trace.end(), {estimate.pose.x, estimate.pose.y, estimate.pose.yaw, estimate.covariance(0, 0),
                               estimate.covariance(2, 2), outcome.nis, static_cast<double>(outcome.decision)});
  }
  return trace;
}

TEST(UkfAsPrinted, NothingOfOursHasAnEffect) {
  ParameterList list;
  list.add(UkfParameters());
  for (const ListedParameter& listed : list.parameters()) {
    const bool is_ours = std::string(kOurs).find(" " + listed.name + ":") != std::string::npos;
    const bool is_open = listed.name == "mode" || listed.name.rfind("ukf_", 0) == 0;
    EXPECT_TRUE(is_ours || is_open) << listed.name << ": neither the paper's nor left out as printed";
  }
  EXPECT_EQ(trace_of(printed()), trace_of(printed(kOurs)));
  EXPECT_NE(trace_of({}), trace_of(with(UkfParameters(), std::string("{mode: standard") + kOurs + "}")));
}

TEST(UkfAsPrinted, WhatThePaperLeavesOpenHasAnEffect) {
  for (const char* yaml : {", ukf_alpha: 1.0", ", ukf_beta: 0.0", ", ukf_kappa: 2.0"}) {
    EXPECT_NE(trace_of(printed()), trace_of(printed(yaml))) << yaml;
  }
  EXPECT_NE(trace_of(printed()), trace_of(printed(), with(MotionParameters(), "odom_alpha1: 0.01"))) << "Q_t";
}

TEST(UkfAsPrinted, ParkedItDoesNotMoveOfItself) {
  Ukf ukf(printed(), {});
  ukf.initialize(pose_with_sigma({1.0, 2.0, 0.5}, 1.0, 0.1));
  const Eigen::Matrix3d before = ukf.estimate().covariance;
  for (int i = 0; i < 100; ++i) ukf.move({}, 0.1);
  EXPECT_TRUE(near(ukf.pose(), {1.0, 2.0, 0.5}, 1e-12));
  EXPECT_TRUE(ukf.estimate().covariance.isApprox(before, 1e-9));
}

TEST(UkfAsPrinted, AnyCovarianceToStartFromBecomesPositiveDefinite) {
  Ukf ukf(printed(), {});
  PoseEstimate start;
  for (const double off : {0.0, 5.0, -1e6}) {
    start.covariance = Eigen::Vector3d(1.0, 0.0, off < 0.0 ? -1.0 : 1e-9).asDiagonal();
    start.covariance(0, 1) = off;
    ukf.initialize(start);
    ukf.move({1.0, 0.1}, 0.1);
    EXPECT_EQ(ukf.correct(fix_at({1.0, 1.0}, 1.0)).decision, FixDecision::kAccepted);
    EXPECT_TRUE(is_positive_definite<3>(ukf.estimate().covariance)) << off;
  }
}

TEST(UkfAsPrinted, HasANameInComparisons) {
  const LocalizerRegistry registry = standard_localizers();
  const LocalizerChoice choice = registry.choose("ukf_as_printed");
  EXPECT_EQ(choice.entry->name, "ukf");
  EXPECT_EQ(choice.assignments, std::vector<std::string>{"mode=as_printed"});
  for (const LocalizerVariant& variant : registry.variants()) EXPECT_NE(variant.name, "ukf_as_printed");
  EXPECT_EQ(Ukf(printed(), {}).mode(), "as_printed");
  EXPECT_TRUE(Ukf(printed(), {}).is_as_printed());
  EXPECT_EQ(Ukf({}, {}).mode(), "student_t");
  EXPECT_FALSE(Ukf({}, {}).is_as_printed());
}

}  // namespace
}  // namespace urban_gnss
