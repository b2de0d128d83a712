#include <gtest/gtest.h>

#include "city_rig.hpp"
#include "matchers.hpp"
#include "urban_gnss_localization/evaluation/trajectory_errors.hpp"
#include "urban_gnss_localization/experiments/bias_experiment.hpp"

namespace urban_gnss {
namespace {

Stamp at(double seconds) { return from_seconds(seconds); }

/// One fix a second from `from` to `to`, with a significant bias where `is_significant` says so.
template <class F>
std::vector<BiasEstimate> biases(int from, int to, F is_significant) {
  std::vector<BiasEstimate> result;
  for (int k = from; k <= to; ++k) {
    BiasEstimate bias;
    bias.stamp = at(k);
    bias.in_shadow = is_significant(k);
    result.push_back(bias);
  }
  return result;
}

BiasRun between(double from_s, double to_s) {
  BiasRun run;
  run.between = std::make_pair(at(from_s), at(to_s));
  return run;
}

TEST(BiasExperiment, Phases) {
  const BiasRun run = between(10.0, 20.0);
  EXPECT_EQ(phase_of(run, at(9.9)), 0u);
  EXPECT_EQ(phase_of(run, at(10.0)), 1u);
  EXPECT_EQ(phase_of(run, at(20.0)), 1u);
  EXPECT_EQ(phase_of(run, at(20.1)), 2u);
  EXPECT_EQ(phase_of(BiasRun(), at(15.0)), 0u) << "no buildings";
}

TEST(BiasExperiment, SettlingTime) {
  const BiasRun run = between(10.0, 20.0);
  EXPECT_EQ(settling_time_s(run, biases(0, 60, [](int k) { return k >= 12 && k <= 27; })), 7.0);
  EXPECT_EQ(settling_time_s(run, biases(0, 60, [](int k) { return k >= 12 && k < 20; })), 0.0);
  EXPECT_EQ(settling_time_s(run, biases(0, 60, [](int k) { return k <= 22 || k == 30; })), 10.0)
      << "insignificant for 7 s in between is not over";
  EXPECT_EQ(settling_time_s(run, biases(0, 60, [](int k) { return k <= 22 || k == 50; })), 2.0)
      << "one that comes later is another";
  EXPECT_FALSE(settling_time_s(run, biases(0, 60, [](int k) { return k >= 12; })));
  EXPECT_FALSE(settling_time_s(run, biases(0, 25, [](int) { return false; }))) << "seen for 5 s only";
  EXPECT_FALSE(settling_time_s(run, {}));
  EXPECT_FALSE(settling_time_s(BiasRun(), biases(0, 60, [](int) { return false; })));
}

double mean_error_m(const BiasRun& run, std::size_t contestant) {
  double sum = 0.0;
  const auto samples = errors_at_truth(run.truth, run.contestants[contestant].estimate).samples;
  for (const ErrorSample& sample : samples) sum += sample.position_error_m;
  return sum / static_cast<double>(samples.size());
}

TEST(BiasExperiment, EveryFilterGetsTheSameDrive) {
  const Scenario drive = scenario("building_pass", {"seed=101", "lidar.type=none", "duration=130"});
  const BiasRun run = run_bias_experiment(drive, {});
  ASSERT_TRUE(run.between);
  const double entered_s = to_seconds(run.between->first - run.truth.front().stamp);
  EXPECT_NEAR(entered_s, 98.0, 8.0) << "the round on the car park is 290 m at 3 m/s, slower in its bends";
  EXPECT_EQ(run.between->second, run.truth.back().stamp) << "cut off between the buildings";
  EXPECT_GT(run.fix_errors.size(), 50u);
  for (std::size_t i = 0; i < kBiasContestants.size(); ++i) {
    const BiasContestantRun& contestant = run.contestants[i];
    ASSERT_FALSE(contestant.estimate.empty());
    EXPECT_LT(mean_error_m(run, i), 10.0) << kBiasContestants[i].name;
    for (const BiasEstimate& bias : contestant.biases) {
      const FixDecision decision = bias.outcome.decision;
      if (std::string(kBiasContestants[i].name).find("compensated") == std::string::npos) {
        EXPECT_EQ(bias.bias.norm(), 0.0);
      }
      if (std::string(kBiasContestants[i].name).find("standard") == 0) {
        EXPECT_FALSE(is_rejected(decision));
      }
      if (kBiasContestants[i].is_withheld) {
        EXPECT_LT(bias.stamp, run.between->first);
      }
    }
  }
  EXPECT_LT(run.contestants.back().biases.size() + 10, run.contestants[0].biases.size()) << "withheld";
}

TEST(BiasExperiment, TheSameSeedGivesTheSameRun) {
  const Scenario drive = scenario("open_sky", {"seed=101", "duration=20"});
  const BiasRun first = run_bias_experiment(drive, {});
  const BiasRun second = run_bias_experiment(drive, {});
  EXPECT_FALSE(first.between) << "no buildings";
  for (std::size_t i = 0; i < kBiasContestants.size(); ++i) {
    ASSERT_EQ(first.contestants[i].estimate.size(), second.contestants[i].estimate.size());
    ASSERT_FALSE(first.contestants[i].estimate.empty());
    EXPECT_TRUE(near(first.contestants[i].estimate.back().pose, second.contestants[i].estimate.back().pose, 0.0));
    EXPECT_EQ(first.contestants[i].biases.size(), first.contestants[0].biases.size()) << "nothing is withheld";
  }
}

}  // namespace
}  // namespace urban_gnss
