#include <gtest/gtest.h>

#include <cmath>

#include "package_directory.hpp"
#include "urban_gnss_localization/experiments/localizer_experiment.hpp"
#include "urban_gnss_localization/localizers/kim/complementary_ekf.hpp"
#include "urban_gnss_localization/localizers/maier/ukf.hpp"
#include "urban_gnss_localization/localizers/nishida/particle_filter.hpp"

namespace urban_gnss {
namespace {

Stamp at(double time_s) { return from_seconds(100.0 + time_s); }

TimedPose pose_at(double time_s, double x, double sigma = 0.0) {
  TimedPose pose;
  pose.stamp = at(time_s);
  pose.pose.x = x;
  pose.covariance = sigma * sigma * Eigen::Matrix3d::Identity();
  return pose;
}

/// A robot that stands at the origin for `seconds`, with an estimate that is off by what `error` says, in m.
template <class Error>
LocalizerRun parked_run(int seconds, Error error) {
  LocalizerRun run;
  run.estimates.resize(1);
  for (int k = 0; k <= seconds; ++k) {
    run.truth.push_back(pose_at(k, 0.0));
    run.estimates[0].push_back(pose_at(k, error(k), 1.0));
  }
  return run;
}

TEST(LocalizerExperiment, PoolsTheDrivesAndKeepsEachOnesError) {
  std::vector<LocalizerRun> runs{parked_run(9, [](int) { return 3.0; }), parked_run(9, [](int) { return -4.0; })};
  const ContenderSummary summary = summarize_contender(runs, 0);
  ASSERT_EQ(summary.rmse_m.size(), 2u);
  EXPECT_NEAR(summary.rmse_m[0], 3.0, 1e-12);
  EXPECT_NEAR(summary.rmse_m[1], 4.0, 1e-12);
  EXPECT_NEAR(summary.position_m.rmse, std::sqrt(12.5), 1e-12);
  EXPECT_NEAR(summary.nees_mean, 12.5, 1e-9);
  EXPECT_NEAR(summary.coverage, 1.0, 1e-12);
  EXPECT_EQ(summary.diverged, 0u);
  EXPECT_TRUE(std::isnan(summary.reacquisition_s));  // there was no outage
}

TEST(LocalizerExperiment, ADriveDivergesWithOneErrorBeyondTheLimit) {
  const auto spike = [](double height) { return parked_run(9, [=](int k) { return k == 5 ? height : 0.0; }); };
  EXPECT_EQ(summarize_contender({spike(kDiverged_m - 0.1)}, 0).diverged, 0u);
  EXPECT_EQ(summarize_contender({spike(kDiverged_m + 0.1), spike(0.0)}, 0).diverged, 1u);
}

TEST(LocalizerExperiment, AMissingEstimateLowersTheCoverage) {
  LocalizerRun run = parked_run(9, [](int) { return 1.0; });
  run.estimates[0].resize(5);
  EXPECT_NEAR(summarize_contender({run}, 0).coverage, 0.5, 1e-12);
  run.estimates[0].clear();
  const ContenderSummary none = summarize_contender({run}, 0);
  EXPECT_EQ(none.coverage, 0.0);
  EXPECT_TRUE(std::isnan(none.position_m.rmse));
  EXPECT_TRUE(std::isnan(none.nees_mean));
}

TEST(LocalizerExperiment, TellsHowLongTheErrorOutlastsAnOutage) {
  LocalizerRun run = parked_run(60, [](int k) { return k < 14 || k == 16 ? 20.0 : 1.0; });
  run.outages.push_back({at(0.0), at(10.0)});
  EXPECT_NEAR(summarize_contender({run}, 0).reacquisition_s, 6.0, 1e-9);
  // Of several, the worst.
  run.outages.push_back({at(20.0), at(40.0)});
  EXPECT_NEAR(summarize_contender({run}, 0).reacquisition_s, 6.0, 1e-9);
  LocalizerRun never = parked_run(60, [](int) { return 2.0 * kGoodFix_m; });
  never.outages.push_back({at(0.0), at(10.0)});
  EXPECT_TRUE(std::isinf(summarize_contender({run, never}, 0).reacquisition_s));
}

Scenario airfield(double duration_s) {
  return load_scenario(package_directory() + "/scenarios/open_sky.yaml",
                       {"seed=7", "duration=" + std::to_string(duration_s)});
}

TEST(LocalizerExperiment, ContendersHaveTheSameDriveAndDoNotDisturbEachOther) {
  const Contender ukf{"ukf", [] { return std::make_unique<Ukf>(UkfParameters{}, MotionParameters{}); }, false};
  const Contender ekf{"ekf", [] { return std::make_unique<ComplementaryEkf>(ComplementaryEkfParameters{}); }, false};
  const LocalizerExperimentConditions conditions;
  const auto quiet = [](double) {};
  const LocalizerRun both = run_localizer_experiment(airfield(40.0), {ukf, ekf}, conditions, quiet);
  const LocalizerRun alone = run_localizer_experiment(airfield(40.0), {ekf}, conditions, quiet);
  ASSERT_EQ(both.estimates.size(), 2u);
  ASSERT_FALSE(alone.estimates[0].empty());
  ASSERT_EQ(both.estimates[1].size(), alone.estimates[0].size());
  EXPECT_EQ(both.estimates[1].back().pose.x, alone.estimates[0].back().pose.x);
  ASSERT_EQ(both.truth.size(), alone.truth.size());
  const ContenderSummary summary = summarize_contender({both}, 0);
  EXPECT_LT(summary.position_m.rmse, 5.0);
  EXPECT_GT(summary.coverage, 0.5);
  EXPECT_TRUE(both.outages.empty());
}

TEST(LocalizerExperiment, TheBiasFilterIsAsPrintedWhereTheLocalizerIs) {
  const auto last_x = [](ParticleFilterMode of_filter, ParticleFilterMode of_bias) {
    ParticleFilterParameters parameters;
    parameters.mode = of_filter;
    parameters.particle_count = 200;
    const Contender contender{"contender",
                              [&] { return std::make_unique<ParticleFilter>(parameters, MotionParameters{}); }};
    LocalizerExperimentConditions conditions;
    conditions.bias.mode = of_bias;
    return run_localizer_experiment(airfield(30.0), {contender}, conditions, [](double) {}).estimates[0].back().pose.x;
  };
  using Mode = ParticleFilterMode;
  EXPECT_EQ(last_x(Mode::kLiteral, Mode::kPaper), last_x(Mode::kLiteral, Mode::kLiteral));
  EXPECT_NE(last_x(Mode::kPaper, Mode::kPaper), last_x(Mode::kPaper, Mode::kLiteral));
}

TEST(LocalizerExperiment, AReceiverThatDeclaresNoCovarianceIsGivenTheDefault) {
  const Contender ukf{"ukf", [] { return std::make_unique<Ukf>(UkfParameters{}, MotionParameters{}); }, false};
  const auto last_x = [&](bool declares_covariance, double fix_sigma_default) {
    Scenario scenario = airfield(30.0);
    scenario.receiver.declares_covariance = declares_covariance;
    LocalizerExperimentConditions conditions;
    conditions.localization.input.fix_validation.fix_sigma_default = fix_sigma_default;
    return run_localizer_experiment(scenario, {ukf}, conditions, [](double) {}).estimates[0].back().pose.x;
  };
  EXPECT_NE(last_x(false, 3.0), last_x(false, 9.0));
  EXPECT_EQ(last_x(true, 3.0), last_x(true, 9.0));
}

}  // namespace
}  // namespace urban_gnss
