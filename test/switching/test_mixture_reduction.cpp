#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "matchers.hpp"
#include "urban_gnss_localization/localizers/switching/mixture_reduction.hpp"

namespace urban_gnss {
namespace {

BiasHypothesis hypothesis(double x, double weight, double sigma = 1.0, BiasMode mode = BiasMode::kSlow) {
  BiasHypothesis one;
  one.state.mean[0] = x;
  one.state.covariance.diagonal().setConstant(sigma * sigma);
  one.mode = mode;
  one.weight = weight;
  return one;
}

BiasGaussian together(const std::vector<BiasHypothesis>& all) {
  return match_moments(
      all.size(), [&](std::size_t i) -> const BiasGaussian& { return all[i].state; },
      [&](std::size_t i) { return all[i].weight; });
}

double weight_of(const std::vector<BiasHypothesis>& all) {
  return std::accumulate(all.begin(), all.end(), 0.0, [](double sum, const auto& each) { return sum + each.weight; });
}

/// Of one dimension, against numerical integration.
TEST(MixtureReduction, DistanceIsBhattacharyyas) {
  BiasGaussian a, b;
  a.covariance(3, 3) = 4.0;
  b.covariance(3, 3) = 1.0;
  b.mean[3] = 1.5;
  double overlap = 0.0;
  for (double x = -30.0; x < 30.0; x += 1e-3) {
    const double of_a = std::exp(-0.5 * x * x / 4.0) / std::sqrt(8.0 * kPi);
    const double of_b = std::exp(-0.5 * (x - 1.5) * (x - 1.5)) / std::sqrt(2.0 * kPi);
    overlap += 1e-3 * std::sqrt(of_a * of_b);
  }
  EXPECT_NEAR(marginal_distance(a, b), -std::log(overlap), 1e-6);
  EXPECT_EQ(marginal_distance(a, a), 0.0);
  b = a;
  a.mean[2] = kPi - 0.01;
  b.mean[2] = -kPi + 0.01;  // 0.02 rad apart
  a.covariance(2, 2) = b.covariance(2, 2) = 0.01;
  EXPECT_NEAR(marginal_distance(a, b), 0.125 * 0.02 * 0.02 / 0.01, 1e-9);
  a.covariance(7, 7) = 1.0;  // known in one, not in the other: nothing alike
  EXPECT_GT(marginal_distance(a, b), 1e3);
}

TEST(MixtureReduction, ThresholdLeavesAsManyAsAskedFor) {
  RandomEngine engine = make_engine(1);
  for (const double skew : {0.0, 1.0, 5.0}) {
    std::vector<double> weights(200);
    for (double& w : weights) w = std::exp(skew * draw_normal(engine));
    const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
    for (double& w : weights) w /= sum;
    std::sort(weights.rbegin(), weights.rend());
    for (const std::size_t most : {1U, 7U, 150U}) {
      const double c = selection_threshold(weights, most);
      double left = 0.0;
      for (const double w : weights) left += std::min(1.0, w / c);
      EXPECT_NEAR(left, static_cast<double>(most), 1e-6) << skew;
    }
    EXPECT_EQ(selection_threshold(weights, 200), 0.0);
  }
}

TEST(MixtureReduction, MergesWhatIsNearlyTheSameWithItsMoments) {
  std::vector<BiasHypothesis> all = {hypothesis(0.0, 0.3), hypothesis(0.2, 0.25), hypothesis(0.1, 0.05),
                                     hypothesis(3.0, 0.2), hypothesis(0.0, 0.2, 1.0, BiasMode::kDirect)};
  all.push_back(all[0]);
  all.back().state.mean[2] = 0.3;  // another heading, however uncertain
  all[0].weight -= all.back().weight = 0.1;
  const BiasGaussian before = together(all);
  MixtureReducer reducer(6);
  reducer.merge(all, 0.5);
  ASSERT_EQ(all.size(), 4u);  // the far ones and that of another mode stay
  EXPECT_NEAR(all[0].weight, 0.5, 1e-12);
  EXPECT_TRUE(together(all).mean.isApprox(before.mean, 1e-12));
  EXPECT_TRUE(together(all).covariance.isApprox(before.covariance, 1e-12));
}

/// Heavy ones always survive; on average every one keeps its weight.
TEST(MixtureReduction, SelectionIsUnbiased) {
  constexpr int kCount = 40;
  std::vector<BiasHypothesis> all;
  for (int k = 0; k < kCount; ++k) all.push_back(hypothesis(100.0 * k, std::exp(-0.3 * k)));
  const double sum = weight_of(all);
  for (auto& each : all) each.weight /= sum;
  RandomEngine engine = make_engine(2);
  MixtureReducer reducer(kCount);
  std::vector<double> mean(kCount);
  constexpr int kTrials = 4000;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<BiasHypothesis> some = all;
    reducer.select(some, 8, engine);
    ASSERT_LE(some.size(), 9u);
    ASSERT_GE(some.size(), 7u);
    ASSERT_NEAR(weight_of(some), 1.0, 1e-12);
    for (const auto& each : some)
      mean[static_cast<std::size_t>(std::lround(each.state.mean[0] / 100.0))] += each.weight;
    ASSERT_EQ(some[0].state.mean[0], 0.0);
  }
  for (int k = 0; k < kCount; ++k) {
    const double expected = all[static_cast<std::size_t>(k)].weight;
    EXPECT_NEAR(mean[static_cast<std::size_t>(k)] / kTrials, expected, 0.05 * expected + 0.002) << k;
  }
}

TEST(MixtureReduction, FewAreLeftWhereFewArePlausible) {
  std::vector<BiasHypothesis> all = {hypothesis(0.0, 1.0 - 99e-7)};
  for (int k = 1; k < 100; ++k) all.push_back(hypothesis(100.0 * k, 1e-7));
  MixtureReducer reducer(100);
  RandomEngine engine = make_engine(3);
  reducer.select(all, 100, engine);
  EXPECT_LE(all.size(), 2u);
  EXPECT_NEAR(weight_of(all), 1.0, 1e-12);
}

}  // namespace
}  // namespace urban_gnss
