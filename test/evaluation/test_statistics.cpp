#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "urban_gnss_localization/evaluation/statistics.hpp"

namespace {

using urban_gnss::percentile;
using urban_gnss::summarize;
using urban_gnss::Summary;

// Expected: numpy 1.24.2, x.mean(), x.std(ddof=1), sqrt((x**2).mean()), median(x), percentile(x, 95), x.max()
TEST(Statistics, AgreesWithNumpy) {
  const Summary summary = summarize({3.25, -1.5, 0.0, 7.75, 2.0, 2.0, 10.5});
  EXPECT_EQ(summary.count, 7u);
  EXPECT_NEAR(summary.mean, 3.4285714285714284, 1e-12);
  EXPECT_NEAR(summary.sigma, 4.2590939121344755, 1e-12);
  EXPECT_NEAR(summary.rmse, 5.225281947280111, 1e-12);
  EXPECT_NEAR(summary.median, 2.0, 1e-12);
  EXPECT_NEAR(summary.p95, 9.674999999999997, 1e-12);
  EXPECT_EQ(summary.max, 10.5);
}

TEST(Statistics, AgreesWithNumpyForAnEvenCount) {
  const Summary summary = summarize({8.0, 1.0, 4.0, 2.0});
  EXPECT_NEAR(summary.median, 3.0, 1e-12);
  EXPECT_NEAR(summary.p95, 7.399999999999999, 1e-12);
  EXPECT_NEAR(summary.sigma, 3.095695936834452, 1e-12);
  EXPECT_NEAR(summary.rmse, 4.6097722286464435, 1e-12);
  EXPECT_NEAR(percentile({1.0, 2.0, 4.0, 8.0}, 10.0), 1.3, 1e-12);
}

TEST(Statistics, PercentilesReachBothEnds) {
  const std::vector<double> ascending{1.0, 5.0, 9.0};
  EXPECT_EQ(percentile(ascending, 0.0), 1.0);
  EXPECT_EQ(percentile(ascending, 50.0), 5.0);
  EXPECT_EQ(percentile(ascending, 100.0), 9.0);
}

TEST(Statistics, AnEmptySampleHasNoNumbers) {
  const Summary summary = summarize({});
  EXPECT_EQ(summary.count, 0u);
  for (const double value :
       {summary.mean, summary.sigma, summary.rmse, summary.median, summary.p95, summary.max, percentile({}, 50.0)}) {
    EXPECT_TRUE(std::isnan(value));
  }
}

TEST(Statistics, OneValueHasNoSpread) {
  const Summary summary = summarize({-4.0});
  EXPECT_EQ(summary.count, 1u);
  EXPECT_EQ(summary.mean, -4.0);
  EXPECT_TRUE(std::isnan(summary.sigma));
  EXPECT_EQ(summary.rmse, 4.0);
  EXPECT_EQ(summary.median, -4.0);
  EXPECT_EQ(summary.p95, -4.0);
  EXPECT_EQ(summary.max, -4.0);
}

TEST(Statistics, ASmallSpreadAboutALargeMeanKeepsItsDigits) {
  const Summary summary = summarize({1e8, 1e8 + 1.0, 1e8 + 2.0});
  EXPECT_NEAR(summary.sigma, 1.0, 1e-9);
}

TEST(Statistics, TheOrderOfTheSampleDoesNotMatter) {
  std::mt19937_64 generator(7);
  std::uniform_real_distribution<double> uniform(-50.0, 50.0);
  std::vector<double> sample(101);
  for (double& value : sample) value = uniform(generator);
  const Summary first = summarize(sample);
  std::shuffle(sample.begin(), sample.end(), generator);
  const Summary second = summarize(sample);
  EXPECT_EQ(first.mean, second.mean);
  EXPECT_EQ(first.sigma, second.sigma);
  EXPECT_EQ(first.median, second.median);
  EXPECT_EQ(first.p95, second.p95);
  // rmse^2 = mean^2 + population variance
  const double n = static_cast<double>(sample.size());
  EXPECT_NEAR(first.rmse * first.rmse, first.mean * first.mean + first.sigma * first.sigma * (n - 1.0) / n, 1e-9);
}

}  // namespace
