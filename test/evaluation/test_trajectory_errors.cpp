#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <chrono>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>

#include "urban_gnss_localization/evaluation/report_json.hpp"
#include "urban_gnss_localization/evaluation/trajectory_errors.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/geometry/pose2.hpp"

namespace {

using namespace std::chrono_literals;
using urban_gnss::angle_difference;
using urban_gnss::errors_at_fixes;
using urban_gnss::errors_at_truth;
using urban_gnss::interpolate;
using urban_gnss::kPi;
using urban_gnss::Pose2;
using urban_gnss::Stamp;
using urban_gnss::TimedPose;
using urban_gnss::to_seconds;
using urban_gnss::Trajectory;
using urban_gnss::TrajectoryErrors;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TimedPose timed_pose(Stamp stamp, const Pose2& pose) {
  TimedPose timed;
  timed.stamp = stamp;
  timed.pose = pose;
  return timed;
}

/// A straight drive at 3 m/s east and 1 m/s south, one pose each step.
Trajectory drive(Stamp start, Stamp end, Stamp step, const Pose2& offset = {}) {
  Trajectory trajectory;
  for (Stamp stamp = start; stamp <= end; stamp += step) {
    const double t = to_seconds(stamp);
    trajectory.push_back(timed_pose(stamp, {3.0 * t + offset.x, -t + offset.y, offset.yaw}));
  }
  return trajectory;
}

TEST(Interpolation, IsLinearInPositionAndCovariance) {
  Trajectory trajectory{timed_pose(1s, {2.0, 10.0, 0.2}), timed_pose(2s, {6.0, 0.0, 0.4})};
  trajectory[0].covariance = Eigen::Matrix3d::Identity();
  trajectory[1].covariance = 5.0 * Eigen::Matrix3d::Identity();
  const auto middle = interpolate(trajectory, 1250ms, 1s);
  ASSERT_TRUE(middle.has_value());
  EXPECT_EQ(middle->stamp, Stamp(1250ms));
  EXPECT_NEAR(middle->pose.x, 3.0, 1e-12);
  EXPECT_NEAR(middle->pose.y, 7.5, 1e-12);
  EXPECT_NEAR(middle->pose.yaw, 0.25, 1e-12);
  EXPECT_TRUE(middle->covariance.isApprox(2.0 * Eigen::Matrix3d::Identity(), 1e-12));
}

TEST(Interpolation, TurnsTheShorterWay) {
  const Trajectory trajectory{timed_pose(0s, {0.0, 0.0, kPi - 0.1}), timed_pose(1s, {0.0, 0.0, -kPi + 0.3})};
  const auto quarter = interpolate(trajectory, 250ms, 1s);
  const auto late = interpolate(trajectory, 750ms, 1s);
  ASSERT_TRUE(quarter && late);
  EXPECT_NEAR(angle_difference(quarter->pose.yaw, kPi), 0.0, 1e-12);
  EXPECT_NEAR(late->pose.yaw, -kPi + 0.2, 1e-12);
}

TEST(Interpolation, DoesNotBridgeGapsNorLeaveTheSpan) {
  const Trajectory trajectory = {timed_pose(1s, {}), timed_pose(2s, {}), timed_pose(4s, {})};
  EXPECT_TRUE(interpolate(trajectory, 1500ms, 1s).has_value()) << "a gap of just max_gap";
  EXPECT_FALSE(interpolate(trajectory, 1500ms, 999ms).has_value());
  EXPECT_FALSE(interpolate(trajectory, 3s, 1s).has_value());
  EXPECT_TRUE(interpolate(trajectory, 3s, 2s).has_value());
  EXPECT_FALSE(interpolate(trajectory, 999999999ns, 1s).has_value());
  EXPECT_FALSE(interpolate(trajectory, 4000000001ns, 1s).has_value());
  EXPECT_FALSE(interpolate({}, 1s, 1s).has_value());
  for (const Stamp stamp : {Stamp(1s), Stamp(2s), Stamp(4s)}) {
    EXPECT_TRUE(interpolate(trajectory, stamp, 0s).has_value()) << "a pose of its own needs no neighbour";
  }
}

TEST(Interpolation, OfSeveralPosesWithOneStampTheLastCounts) {
  const Trajectory trajectory{timed_pose(1s, {1.0, 0.0, 0.0}), timed_pose(1s, {2.0, 0.0, 0.0}),
                              timed_pose(2s, {4.0, 0.0, 0.0})};
  EXPECT_EQ(interpolate(trajectory, 1s, 1s)->pose.x, 2.0);
  EXPECT_EQ(interpolate(trajectory, 1500ms, 1s)->pose.x, 3.0);
}

TEST(TrajectoryErrors, AnExactEstimateHasNoError) {
  const auto errors = errors_at_truth(drive(0s, 20s, 1s), drive(0s, 20s, 70ms));
  // 20 s is no multiple of 70 ms: the estimate ends before the truth's last stamp.
  EXPECT_EQ(errors.summary.samples, 20u);
  EXPECT_NEAR(errors.summary.coverage, 20.0 / 21.0, 1e-12);
  EXPECT_NEAR(errors.summary.position_m.max, 0.0, 1e-9);
  EXPECT_NEAR(errors.summary.heading_rad.max, 0.0, 1e-12);
}

TEST(TrajectoryErrors, AConstantOffsetIsFoundExactly) {
  const auto errors = errors_at_truth(drive(0s, 20s, 1s), drive(0s, 20s, 100ms, {3.0, -4.0, -0.25}));
  ASSERT_EQ(errors.samples.size(), 21u);
  for (const auto& sample : errors.samples) {
    EXPECT_NEAR(sample.position_error_m, 5.0, 1e-9);
    EXPECT_NEAR(sample.heading_error_rad, -0.25, 1e-12);
    EXPECT_NEAR(sample.estimate.x - sample.truth.x, 3.0, 1e-9);
    EXPECT_NEAR(sample.estimate.y - sample.truth.y, -4.0, 1e-9);
  }
  EXPECT_NEAR(errors.summary.position_m.median, 5.0, 1e-9);
  EXPECT_NEAR(errors.summary.position_m.rmse, 5.0, 1e-9);
  EXPECT_NEAR(errors.summary.position_m.sigma, 0.0, 1e-9);
  EXPECT_NEAR(errors.summary.heading_rad.mean, 0.25, 1e-12);
  EXPECT_EQ(errors.summary.coverage, 1.0);
}

TEST(TrajectoryErrors, HeadingErrorsWrap) {
  Trajectory truth;
  Trajectory estimate;
  for (int i = 0; i <= 10; ++i) {
    truth.push_back(timed_pose(std::chrono::seconds(i), {0.0, 0.0, kPi - 0.05}));
    estimate.push_back(timed_pose(std::chrono::seconds(i), {0.0, 0.0, -kPi + 0.05}));
  }
  const auto errors = errors_at_truth(truth, estimate);
  for (const auto& sample : errors.samples) EXPECT_NEAR(sample.heading_error_rad, 0.1, 1e-12);
  EXPECT_NEAR(errors.summary.heading_rad.max, 0.1, 1e-12);
}

TEST(TrajectoryErrors, DoNotChangeWithTheFrame) {
  std::mt19937_64 generator(5);
  std::normal_distribution<double> normal(0.0, 3.0);
  Trajectory truth;
  Trajectory estimate;
  for (int i = 0; i < 50; ++i) {
    truth.push_back(timed_pose(std::chrono::seconds(i), {normal(generator), normal(generator), normal(generator)}));
    estimate.push_back(timed_pose(std::chrono::seconds(i), {normal(generator), normal(generator), normal(generator)}));
    const Eigen::Matrix3d factor = Eigen::Matrix3d::NullaryExpr([&] { return normal(generator); });
    estimate.back().covariance = factor * factor.transpose() + Eigen::Matrix3d::Identity();
  }
  const Pose2 frame{120.0, -40.0, 2.1};
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  rotation.topLeftCorner<2, 2>() << std::cos(frame.yaw), -std::sin(frame.yaw), std::sin(frame.yaw), std::cos(frame.yaw);
  const auto before = errors_at_truth(truth, estimate);
  for (TimedPose& pose : truth) pose.pose = compose(frame, pose.pose);
  for (TimedPose& pose : estimate) {
    pose.pose = compose(frame, pose.pose);
    pose.covariance = rotation * pose.covariance * rotation.transpose();
  }
  const auto after = errors_at_truth(truth, estimate);
  ASSERT_EQ(before.samples.size(), after.samples.size());
  for (std::size_t i = 0; i < before.samples.size(); ++i) {
    EXPECT_NEAR(before.samples[i].position_error_m, after.samples[i].position_error_m, 1e-9);
    EXPECT_NEAR(angle_difference(before.samples[i].heading_error_rad, after.samples[i].heading_error_rad), 0.0, 1e-9);
    EXPECT_NEAR(before.samples[i].position_sigma_m, after.samples[i].position_sigma_m, 1e-9);
    EXPECT_NEAR(before.samples[i].nees, after.samples[i].nees, 1e-6);
  }
}

TEST(TrajectoryErrors, GapsLowerTheCoverage) {
  Trajectory estimate = drive(0s, 4s, 100ms);
  for (const TimedPose& pose : drive(7500ms, 10s, 100ms)) estimate.push_back(pose);
  const auto errors = errors_at_truth(drive(0s, 10s, 1s), estimate);
  EXPECT_EQ(errors.summary.samples, 8u) << "0 to 4 s and 8 to 10 s";
  EXPECT_NEAR(errors.summary.coverage, 8.0 / 11.0, 1e-12);
  EXPECT_NEAR(errors_at_truth(drive(0s, 10s, 1s), estimate, 4s).summary.coverage, 1.0, 1e-12);
}

TEST(TrajectoryErrors, AnEstimateThatIsNotFiniteIsNoEstimate) {
  Trajectory estimate = drive(0s, 10s, 1s);
  estimate[3].pose.x = kNan;
  const auto errors = errors_at_truth(drive(0s, 10s, 1s), estimate);
  EXPECT_EQ(errors.summary.samples, 10u);
  EXPECT_NEAR(errors.summary.coverage, 10.0 / 11.0, 1e-12);
  EXPECT_TRUE(std::isfinite(errors.summary.position_m.max));
}

TEST(TrajectoryErrors, SharesAreStrictlyBelowTheirLimits) {
  Trajectory truth;
  Trajectory estimate;
  int i = 0;
  for (const double error : {0.0, 4.999, 5.0, 9.999, 10.0, 100.0, 1.0, 2.0}) {
    truth.push_back(timed_pose(std::chrono::seconds(i), {}));
    estimate.push_back(timed_pose(std::chrono::seconds(i), {0.0, error, 0.0}));
    ++i;
  }
  const auto summary = errors_at_truth(truth, estimate).summary;
  EXPECT_EQ(summary.share_below_5m, 0.5);
  EXPECT_EQ(summary.share_below_10m, 0.75);
}

TEST(TrajectoryErrors, PositionSigmaIsTheLongerSemiAxis) {
  Trajectory estimate{timed_pose(0s, {})};
  const double c = std::cos(0.7);
  const double s = std::sin(0.7);
  Eigen::Matrix2d axes;
  axes << c, -s, s, c;
  estimate[0].covariance.setIdentity();
  estimate[0].covariance.topLeftCorner<2, 2>() = axes * Eigen::Vector2d(9.0, 4.0).asDiagonal() * axes.transpose();
  EXPECT_NEAR(errors_at_truth({timed_pose(0s, {})}, estimate).samples.at(0).position_sigma_m, 3.0, 1e-12);
}

TEST(TrajectoryErrors, WithoutACovarianceThereIsNoNees) {
  const auto errors = errors_at_truth(drive(0s, 5s, 1s), drive(0s, 5s, 1s));
  EXPECT_TRUE(std::isnan(errors.samples.at(0).nees));
  EXPECT_TRUE(std::isnan(errors.samples.at(0).position_sigma_m));
  EXPECT_TRUE(std::isnan(errors.summary.nees_mean));

  Trajectory indefinite{timed_pose(0s, {1.0, 0.0, 0.0})};
  indefinite[0].covariance = Eigen::Vector3d(1.0, -1.0, 1.0).asDiagonal();
  EXPECT_TRUE(std::isnan(errors_at_truth({timed_pose(0s, {})}, indefinite).samples.at(0).nees));
  indefinite[0].covariance = Eigen::Vector3d(1.0, 0.0, 1.0).asDiagonal();
  EXPECT_TRUE(std::isnan(errors_at_truth({timed_pose(0s, {})}, indefinite).samples.at(0).nees)) << "singular";
}

/// Errors drawn from the covariance that the estimate claims, times `scale`.
TrajectoryErrors gaussian_errors(int count, double scale) {
  Eigen::Matrix3d covariance;
  covariance << 4.0, 1.2, 0.05, 1.2, 2.0, -0.02, 0.05, -0.02, 0.01;
  const Eigen::Matrix3d factor = covariance.llt().matrixL();
  std::mt19937_64 generator(20210517);
  std::normal_distribution<double> normal;
  Trajectory truth;
  Trajectory estimate;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d error = factor * Eigen::Vector3d(normal(generator), normal(generator), normal(generator));
    truth.push_back(timed_pose(std::chrono::seconds(i), {3.0 * i, 0.0, kPi - 0.01}));
    estimate.push_back(timed_pose(std::chrono::seconds(i),
                                  {3.0 * i + error.x(), error.y(), urban_gnss::wrap_angle(kPi - 0.01 + error.z())}));
    estimate.back().covariance = scale * covariance;
  }
  return errors_at_truth(truth, estimate);
}

TEST(TrajectoryErrors, NeesOfAKnownGaussianIsWithinItsBand) {
  constexpr int kCount = 4000;
  // A chi-square with 3 degrees of freedom has variance 6; the band holds the mean of 4000 with probability 0.999.
  const double band = 3.29 * std::sqrt(6.0 / kCount);
  EXPECT_NEAR(gaussian_errors(kCount, 1.0).summary.nees_mean, 3.0, band);
  EXPECT_GT(gaussian_errors(kCount, 0.9).summary.nees_mean, 3.0 + band) << "10 % too confident must show";
  EXPECT_LT(gaussian_errors(kCount, 1.1).summary.nees_mean, 3.0 - band) << "10 % too humble must show";
}

TEST(TrajectoryErrors, PositionNeesHasTwoDegreesOfFreedom) {
  constexpr int kCount = 4000;
  double sum = 0.0;
  for (const auto& sample : gaussian_errors(kCount, 1.0).samples) sum += sample.position_nees;
  EXPECT_NEAR(sum / kCount, 2.0, 3.29 * std::sqrt(4.0 / kCount));  // variance 4; with probability 0.999
}

TEST(FixErrors, AreTakenAtTheFixesOwnStamps) {
  // Neighbouring fixes err to opposite sides: interpolated, they would seem better than they are.
  Trajectory fixes;
  for (int i = 0; i < 10; ++i) {
    const Stamp stamp = std::chrono::seconds(i) + 300ms;
    const double t = to_seconds(stamp);
    fixes.push_back(timed_pose(stamp, {3.0 * t, -t + (i % 2 == 0 ? 6.0 : -6.0), kNan}));
  }
  const auto errors = errors_at_fixes(drive(0s, 10s, 1s), fixes);
  ASSERT_EQ(errors.samples.size(), 10u);
  for (const auto& sample : errors.samples) EXPECT_NEAR(sample.position_error_m, 6.0, 1e-9);
  EXPECT_EQ(errors.summary.heading_rad.count, 0u);
  EXPECT_EQ(errors.summary.share_below_5m, 0.0);
  EXPECT_NEAR(errors.summary.coverage, 10.0 / 11.0, 1e-12) << "10 s is 0.7 s after the last fix";
}

TEST(FixErrors, AreNotTakenWhereTheTruthIsMissing) {
  Trajectory truth = drive(0s, 4s, 1s);
  for (const TimedPose& pose : drive(8s, 10s, 1s)) truth.push_back(pose);
  Trajectory fixes = drive(0s, 10s, 1s, {1.0, 0.0, kNan});
  EXPECT_EQ(errors_at_fixes(truth, fixes).summary.samples, 8u);
  fixes[9].pose.x = kNan;
  EXPECT_EQ(errors_at_fixes(truth, fixes).summary.samples, 7u);
  EXPECT_EQ(errors_at_fixes(truth, fixes).summary.coverage, 7.0 / 8.0);
}

TEST(ErrorReport, HasNullWhereThereIsNoNumber) {
  const auto filled = to_json(errors_at_truth(drive(0s, 4s, 1s), drive(0s, 4s, 1s, {3.0, 4.0, 0.5})).summary);
  EXPECT_EQ(filled.at("samples"), 5);
  EXPECT_EQ(filled.at("coverage"), 1.0);
  EXPECT_NEAR(filled.at("position_m").at("median").get<double>(), 5.0, 1e-9);
  EXPECT_NEAR(filled.at("heading_rad").at("p95").get<double>(), 0.5, 1e-9);
  EXPECT_TRUE(filled.at("nees_mean").is_null());

  const auto empty = to_json(errors_at_truth({}, {}).summary);
  EXPECT_EQ(empty.at("samples"), 0);
  EXPECT_TRUE(empty.at("coverage").is_null());
  EXPECT_TRUE(empty.at("share_below_5m").is_null());
  for (const char* sample : {"position_m", "heading_rad"}) {
    for (const char* statistic : {"mean", "sigma", "rmse", "median", "p95", "max"}) {
      EXPECT_TRUE(empty.at(sample).at(statistic).is_null()) << sample << '.' << statistic;
    }
  }
}

}  // namespace
