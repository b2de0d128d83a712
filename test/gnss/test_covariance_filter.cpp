#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "matchers.hpp"
#include "urban_gnss_localization/gnss/covariance_filter.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Series = std::vector<std::optional<Eigen::Matrix2d>>;

Eigen::Matrix2d with_sigma(double sigma_p) { return 0.5 * sigma_p * sigma_p * Eigen::Matrix2d::Identity(); }

Series series_of(const std::vector<double>& sigmas) {
  Series series;
  for (const double sigma : sigmas) series.push_back(with_sigma(sigma));
  return series;
}

/// Algorithm 3 as printed, on a whole recording, line by line. Line 7's range i : i + len is the whole numbers k with
/// i <= k < i + len.
std::vector<bool> bad_by_batch(const Series& series, const CovarianceFilterParameters& p) {
  const auto count = static_cast<long>(series.size());
  std::vector<double> sigma;
  for (const auto& r : series) {
    const bool is_usable = r && std::isfinite((*r)(0, 0) + (*r)(1, 1)) && (*r)(0, 0) > 0.0 && (*r)(1, 1) > 0.0;
    sigma.push_back(is_usable ? std::sqrt((*r)(0, 0) + (*r)(1, 1)) : kInfinity);
  }
  std::vector<bool> bad(series.size(), false);
  for (long i = 0; i < count; ++i) bad[i] = sigma[i] > p.sigma_threshold;
  for (long start = 0; start < count;) {
    if (!(sigma[start] > p.sigma_smooth)) {
      ++start;
      continue;
    }
    long end = start;
    while (end + 1 < count && sigma[end + 1] > p.sigma_smooth) ++end;
    const double len = std::min(static_cast<double>(end - start + 1) * p.smooth_length_scale, p.smooth_length_max);
    const long i = end + 1;
    for (long k = i; k < count && static_cast<double>(k - i) < len - 1e-9; ++k) bad[k] = true;
    start = end + 1;
  }
  return bad;
}

std::vector<bool> bad_online(const Series& series, const CovarianceFilterParameters& p) {
  CovarianceFilter filter(p);
  std::vector<bool> bad;
  for (const auto& r : series) {
    const auto result = filter.add(r);
    EXPECT_EQ(result.covariance, result.is_good ? *r : p.infinite());
    bad.push_back(!result.is_good);
  }
  return bad;
}

/// 'b' and '.' for bad and good, for messages.
std::string text(const std::vector<bool>& bad) {
  std::string result;
  for (const bool b : bad) result += b ? 'b' : '.';
  return result;
}

TEST(CovarianceFilter, AgreesWithTheBatchFormOnRandomSeries) {
  RandomEngine engine = make_engine(1);
  int recoveries_that_changed_something = 0;
  for (int trial = 0; trial < 5000; ++trial) {
    CovarianceFilterParameters p;
    if (trial % 3 == 1) {
      p.sigma_threshold = uniform_between(1.0, 12.0, engine);
      p.sigma_smooth = uniform_between(1.0, 12.0, engine);
      p.smooth_length_scale = uniform_between(0.0, 3.0, engine);
      p.smooth_length_max = uniform_between(0.0, 20.0, engine);
    }
    // A mean that wanders gives runs of every length.
    Series series;
    double level = uniform_between(3.0, 12.0, engine);
    const int length = static_cast<int>(uniform_between(0.0, 150.0, engine));
    for (int i = 0; i < length; ++i) {
      if (draw_uniform(engine) < 0.1) level = uniform_between(3.0, 12.0, engine);
      const double kind = draw_uniform(engine);
      if (kind < 0.02) {
        series.push_back(std::nullopt);
      } else if (kind < 0.04) {
        series.push_back(with_sigma(kNaN));
      } else {
        series.push_back(with_sigma(level + draw_normal(engine)));
      }
    }
    const auto expected = bad_by_batch(series, p);
    const auto actual = bad_online(series, p);
    ASSERT_EQ(actual, expected) << "trial " << trial << '\n' << text(actual) << '\n' << text(expected);
    for (std::size_t i = 0; i < series.size(); ++i) {
      const bool is_small = series[i] && position_sigma(*series[i]) <= p.sigma_threshold;
      if (is_small && actual[i]) ++recoveries_that_changed_something;
    }
  }
  EXPECT_GT(recoveries_that_changed_something, 1000);
}

TEST(CovarianceFilter, RecoveryIsAFifthOfTheRunAndAtMostTwelve) {
  // Run of the first number; that many fixes of recovery after it.
  const std::vector<std::pair<int, long>> expected{{1, 1},  {4, 1},   {5, 1},   {6, 2},   {10, 2},  {15, 3},
                                                   {35, 7}, {55, 11}, {59, 12}, {60, 12}, {61, 12}, {1000, 12}};
  for (const auto& [run, recovery] : expected) {
    std::vector<double> sigmas(static_cast<std::size_t>(run), 9.1);
    sigmas.resize(sigmas.size() + 30, 2.0);
    const auto bad = bad_online(series_of(sigmas), {});
    EXPECT_EQ(std::count(bad.begin(), bad.end(), true), run + recovery) << run;
    EXPECT_TRUE(bad[static_cast<std::size_t>(run + recovery) - 1]);
    EXPECT_FALSE(bad[static_cast<std::size_t>(run + recovery)]);
  }
}

TEST(CovarianceFilter, BetweenTheThresholdsIsBadWithoutRecovery) {
  EXPECT_EQ(text(bad_online(series_of({5.9, 6.1, 8.9, 8.9, 8.9, 8.9, 8.9, 5.9}), {})), ".bbbbbb.");
}

TEST(CovarianceFilter, ThresholdsThemselvesAreNotExceeded) {
  // 8 + 8 and 32 + 49 have exact roots, so that sigma is 4 and 9 to the last bit.
  CovarianceFilterParameters p;
  p.sigma_threshold = 4.0;
  CovarianceFilter filter(p);
  EXPECT_TRUE(filter.add(Eigen::Matrix2d(Eigen::Vector2d(8.0, 8.0).asDiagonal())).is_good);
  EXPECT_FALSE(filter.add(Eigen::Matrix2d(Eigen::Vector2d(32.0, 49.0).asDiagonal())).is_good);
  EXPECT_TRUE(filter.add(with_sigma(1.0)).is_good) << "9 m is no run above 9 m";
}

TEST(CovarianceFilter, RunAtTheEndOfTheSeriesInflatesNothingElse) {
  EXPECT_EQ(text(bad_online(series_of({2, 2, 20, 20, 20}), {})), "..bbb");
  EXPECT_EQ(text(bad_online(series_of({20}), {})), "b");
  EXPECT_EQ(text(bad_online({}, {})), "");
}

TEST(CovarianceFilter, OverlappingRecoveriesAreUnited) {
  CovarianceFilterParameters p;
  p.smooth_length_scale = 1.0;
  // A run of 6, one good fix, a run of 1: the first recovery reaches over the second run, and beyond its recovery.
  EXPECT_EQ(text(bad_online(series_of({20, 20, 20, 20, 20, 20, 2, 20, 2, 2, 2, 2, 2, 2}), p)), "bbbbbbbbbbbb..");
}

TEST(CovarianceFilter, UnusableCovarianceCountsAsInfinite) {
  const std::vector<std::optional<Eigen::Matrix2d>> unusable{std::nullopt, with_sigma(kNaN), with_sigma(kInfinity),
                                                             Eigen::Matrix2d(Eigen::Matrix2d::Zero()),
                                                             Eigen::Matrix2d(Eigen::Vector2d(-1.0, 5.0).asDiagonal())};
  for (const auto& r : unusable) {
    CovarianceFilter filter({});
    const auto result = filter.add(r);
    EXPECT_FALSE(result.is_good);
    EXPECT_EQ(result.covariance, CovarianceFilterParameters().infinite());
    EXPECT_TRUE(filter.add(with_sigma(1.0)).is_recovering);
    EXPECT_TRUE(filter.add(with_sigma(1.0)).is_good);
  }
}

TEST(CovarianceFilter, ResetForgetsTheRun) {
  CovarianceFilter filter({});
  for (int i = 0; i < 20; ++i) filter.add(with_sigma(30.0));
  filter.reset();
  EXPECT_TRUE(filter.add(with_sigma(2.0)).is_good);
}

TEST(CovarianceFilter, EveryParameterHasAnEffect) {
  const std::vector<double> sigmas{2, 5, 2, 8, 8, 2, 2, 10, 10, 10, 10, 10, 10, 2, 2, 2, 2, 2};
  const auto outcome = [&](const CovarianceFilterParameters& p) {
    std::vector<double> values;
    CovarianceFilter filter(p);
    for (const auto& r : series_of(sigmas)) values.push_back(filter.add(r).covariance(0, 0));
    return values;
  };
  const auto standard = outcome({});
  for (const char* change : {"sigma_infinite: 100.0", "sigma_threshold: 4.0", "sigma_smooth: 7.0",
                             "smooth_length_scale: 0.7", "smooth_length_max: 1.0"}) {
    EXPECT_NE(outcome(with(CovarianceFilterParameters(), change)), standard) << change;
  }
  EXPECT_EQ(parameter_names(CovarianceFilterParameters()).size(), 5u);
}

TEST(CovarianceFilter, ThresholdMustBeBelowInfinity) {
  CovarianceFilterParameters p;
  p.sigma_threshold = 700.0;
  std::vector<std::string> faults;
  faults = faults_of(p);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_NE(faults[0].find("sigma_threshold"), std::string::npos);
}

}  // namespace
}  // namespace urban_gnss
