#include <gtest/gtest.h>

#include <cmath>

#include "package_directory.hpp"
#include "urban_gnss_localization/experiments/fault_experiment.hpp"
#include "urban_gnss_localization/localizers/maier/ukf.hpp"

namespace urban_gnss {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Stamp at(double time_s) { return from_seconds(100.0 + time_s); }

/// A robot that stands at the origin for 100 s, with an estimate that has the error (m) and the health that functions
/// of the time (s) say; its standard deviation is 2 m. The fault begins at 20 s and ends at 30 s; 5 m are good.
template <class Error, class Health>
FaultScore score(Error error_m, Health healthy, FaultWindow window = {at(20.0), at(30.0), 5.0}) {
  Trajectory truth;
  Trajectory estimate;
  std::vector<HealthSample> health;
  for (int k = 0; k <= 100; ++k) {
    TimedPose pose;
    pose.stamp = at(k);
    truth.push_back(pose);
    pose.pose.x = error_m(k);
    pose.covariance = 4.0 * Eigen::Matrix3d::Identity();
    estimate.push_back(pose);
    health.push_back({at(k), healthy(k)});
  }
  return score_fault(truth, estimate, health, window);
}

bool always(int) { return true; }

TEST(FaultScore, ADriveWithoutHarm) {
  const FaultScore calm = score([](int) { return 1.0; }, always);
  EXPECT_EQ(calm.unhealthy_after_s, kInfinity);
  EXPECT_NEAR(calm.worst_while_healthy_m, 1.0, 1e-12);
  EXPECT_EQ(calm.recovery_s, 0.0);
  EXPECT_EQ(calm.inside_95, 1.0);
  EXPECT_NEAR(calm.worst_m, 1.0, 1e-12);
}

TEST(FaultScore, WhatWasBeforeTheOnsetDoesNotCount) {
  const FaultScore calm = score([](int k) { return k < 20 ? 90.0 : 1.0; }, [](int k) { return k >= 20; });
  EXPECT_EQ(calm.unhealthy_after_s, kInfinity);
  EXPECT_NEAR(calm.worst_m, 1.0, 1e-12);
  EXPECT_EQ(calm.inside_95, 1.0);
}

TEST(FaultScore, ErrorsCountWhileTheStatusSaysHealthy) {
  // It grows by 1 m/s from the onset on, is noticed at 27 s, and is gone at 40 s.
  const auto ramp = [](int k) { return k < 20 || k >= 40 ? 0.0 : k - 20.0; };
  const FaultScore noticed = score(ramp, [](int k) { return k < 27 || k >= 40; });
  EXPECT_NEAR(noticed.unhealthy_after_s, 7.0, 1e-9);
  EXPECT_NEAR(noticed.worst_while_healthy_m, 6.0, 1e-12);
  EXPECT_NEAR(noticed.worst_m, 19.0, 1e-12);
  EXPECT_NEAR(noticed.recovery_s, 10.0, 1e-9);
  // 2 m times the root of the quantile 5.99 are 4.9 m: 15 of the 81 s are farther off.
  EXPECT_NEAR(noticed.inside_95, 66.0 / 81.0, 1e-12);
}

TEST(FaultScore, RecoveryLastsAndNeedsBothErrorAndHealth) {
  const auto bad_until = [](int until) { return [=](int k) { return k >= 20 && k < until ? 20.0 : 1.0; }; };
  EXPECT_NEAR(score(bad_until(50), always).recovery_s, 20.0, 1e-9);
  EXPECT_NEAR(score(bad_until(50), [](int k) { return k >= 60; }).recovery_s, 30.0, 1e-9);
  // Good for 9 s is not yet good.
  const auto relapse = [&](int k) { return k == 60 ? 5.0 : bad_until(51)(k); };
  EXPECT_NEAR(score(relapse, always).recovery_s, 31.0, 1e-9);
  EXPECT_EQ(score(bad_until(100), always).recovery_s, kInfinity);
  EXPECT_EQ(score(bad_until(91), always).recovery_s, kInfinity);
  // What turns bad 20 s after the end was not good before; what does after 40 s is another matter.
  const auto bad_between = [](int from, int until) {
    return [=](int k) { return k >= from && k < until ? 9.0 : 1.0; };
  };
  EXPECT_NEAR(score(bad_between(50, 60), always).recovery_s, 30.0, 1e-9);
  EXPECT_EQ(score(bad_between(70, 80), always).recovery_s, 0.0);
  // A wider limit.
  EXPECT_EQ(score(bad_until(50), always, {at(20.0), at(30.0), 21.0}).recovery_s, 0.0);
  // A fault that does not end.
  EXPECT_TRUE(std::isnan(score(bad_until(50), always, {at(20.0), std::nullopt, 5.0}).recovery_s));
}

TEST(FaultScore, ATruthWithoutAnEstimateIsOutside) {
  const FaultScore gap =
      score([](int k) { return k >= 30 && k < 40 ? std::nan("") : 0.0; }, [](int k) { return k < 30 || k >= 40; });
  EXPECT_NEAR(gap.inside_95, 71.0 / 81.0, 1e-12);
  EXPECT_EQ(gap.worst_m, 0.0);
  EXPECT_NEAR(gap.recovery_s, 10.0, 1e-9);
}

TEST(FaultScore, OfSeveralDrivesTheWorst) {
  const FaultScore worst =
      worst_of({{3.0, 1.0, 5.0, 0.8, 9.0}, {kInfinity, 2.0, 4.0, 0.6, 8.0}, {1.0, 0.5, kInfinity, 0.7, 1.0}});
  EXPECT_EQ(worst.unhealthy_after_s, kInfinity);
  EXPECT_EQ(worst.worst_while_healthy_m, 2.0);
  EXPECT_EQ(worst.recovery_s, kInfinity);
  EXPECT_NEAR(worst.inside_95, 0.7, 1e-12);
  EXPECT_EQ(worst.worst_m, 9.0);
  // A drive that tells nothing, as it had no turn, does not count.
  EXPECT_EQ(worst_of({{3.0, 1.0, 5.0, 0.8, 9.0}, FaultScore{}}).inside_95, 0.8);
}

TEST(FaultExperiment, FaultsAreSeenInTheEstimate) {
  const Scenario scenario = load_scenario(package_directory() + "/scenarios/open_sky.yaml", {"seed=7", "duration=50"});
  const Contender ukf{"ukf", [] { return std::make_unique<Ukf>(UkfParameters{}, MotionParameters{}); }, false};
  LocalizerExperimentConditions conditions;
  conditions.fault_onset_s = 35.0;
  const std::vector<FaultResult> results = run_fault_experiment(scenario, {ukf}, conditions, [](double) {});
  ASSERT_EQ(results.size(), input_faults(scenario).size());
  const auto score_of = [&](const std::string& fault) {
    for (const FaultResult& result : results) {
      if (result.fault == fault) return result.scores.at(0);
    }
    return FaultScore{};
  };
  EXPECT_LT(score_of("none").worst_m, 5.0);
  EXPECT_GT(score_of("none").inside_95, 0.85);
  EXPECT_EQ(score_of("none").unhealthy_after_s, kInfinity);
  EXPECT_GT(score_of("pose_30m_off").worst_m, 25.0);
  EXPECT_LT(score_of("speed_plus_20mps").worst_m, 5.0) << "left out, as no acceleration explains it";
  EXPECT_GT(score_of("dead_encoder").worst_m, 5.0);
  EXPECT_GT(score_of("fixes_1.5s_late").worst_m, 5.0);  // at 10 m/s
}

}  // namespace
}  // namespace urban_gnss
