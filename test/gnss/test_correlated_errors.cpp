#include <gtest/gtest.h>

#include <cmath>

#include "urban_gnss_localization/gnss/correlated_errors.hpp"

namespace urban_gnss {
namespace {

/// coth(x / 2), by the correlation exp(-x).
double coth_law(double exponent) { return (1.0 + std::exp(-exponent)) / (1.0 - std::exp(-exponent)); }

TEST(ErrorCorrelation, InflatesByDistance) {
  const ErrorCorrelation errors{15.0, 0.0};
  for (const double moved : {0.1, 3.0, 15.0, 100.0}) {
    EXPECT_NEAR(errors.inflation(moved, 0.2), coth_law(moved / 15.0), 1e-9 * coth_law(moved / 15.0)) << moved;
    EXPECT_EQ(errors.inflation(moved, 0.2), errors.inflation(moved, 1000.0)) << "time does not matter";
  }
}

TEST(ErrorCorrelation, InflatesByTime) {
  const ErrorCorrelation errors{0.0, 40.0};
  for (const double interval : {0.05, 1.0, 40.0, 500.0}) {
    const double expected = coth_law(interval / 40.0);
    EXPECT_NEAR(errors.inflation(7.0, interval), expected, 1e-9 * expected) << interval;
    EXPECT_EQ(errors.inflation(0.0, interval), errors.inflation(1000.0, interval)) << "the way does not matter";
    EXPECT_EQ(markov_inflation(interval, 40.0), errors.inflation(0.0, interval));
  }
}

TEST(ErrorCorrelation, InflatesByBoth) {
  const ErrorCorrelation errors{15.0, 40.0};
  EXPECT_NEAR(errors.inflation(3.0, 10.0), coth_law(3.0 / 15.0 + 10.0 / 40.0), 1e-9);
  EXPECT_NEAR(errors.inflation(0.0, 10.0), coth_law(0.25), 1e-9) << "at a standstill";
  EXPECT_LT(errors.inflation(3.0, 10.0), (ErrorCorrelation{15.0, 0.0}.inflation(3.0, 10.0)));
  EXPECT_LT(errors.inflation(3.0, 10.0), (ErrorCorrelation{0.0, 40.0}.inflation(3.0, 10.0)));
}

// The variance of the mean of n errors is that of one, by n, times the sum of all correlations: of the law in the
// header, over all pairs.
TEST(ErrorCorrelation, FixesAreTogetherWorthAsMuchAsIndependentOnes) {
  const ErrorCorrelation errors{15.0, 40.0};
  constexpr double kMoved_m = 1.2;
  constexpr double kInterval_s = 0.5;
  double sum = 1.0;
  for (int k = 1; k < 2000; ++k) sum += 2.0 * std::exp(-k * kMoved_m / 15.0 - k * kInterval_s / 40.0);
  EXPECT_NEAR(errors.inflation(kMoved_m, kInterval_s), sum, 1e-9 * sum);
}

TEST(ErrorCorrelation, IsOneWhereNothingIsCorrelated) {
  for (const double value : {0.0, 1.0, 1e9, -1.0}) {
    EXPECT_EQ((ErrorCorrelation{}.inflation(value, value)), 1.0) << value;
    EXPECT_EQ(markov_inflation(value, 0.0), 1.0) << value;
    EXPECT_EQ(markov_inflation(value, -3.0), 1.0) << value;
  }
  EXPECT_EQ((ErrorCorrelation{15.0, 40.0}.inflation(1e6, 0.0)), 1.0) << "far away";
  EXPECT_EQ((ErrorCorrelation{15.0, 40.0}.inflation(0.0, 1e6)), 1.0) << "long after";
}

TEST(ErrorCorrelation, IsBounded) {
  EXPECT_EQ((ErrorCorrelation{15.0, 40.0}.inflation(0.0, 0.0)), 1e6);
  EXPECT_EQ((ErrorCorrelation{15.0, 0.0}.inflation(0.0, 1000.0)), 1e6) << "stands where only the way matters";
  EXPECT_EQ((ErrorCorrelation{0.0, 40.0}.inflation(1000.0, 0.0)), 1e6);
  EXPECT_EQ((ErrorCorrelation{15.0, 0.0}.inflation(1e-6, 0.0)), 1e6);
  EXPECT_LT((ErrorCorrelation{15.0, 0.0}.inflation(1e-4, 0.0)), 1e6);
}

TEST(ErrorCorrelation, NegativeInputsCountAsNone) {
  const ErrorCorrelation errors{15.0, 40.0};
  EXPECT_EQ(errors.inflation(-3.0, 10.0), errors.inflation(0.0, 10.0));
  EXPECT_EQ(errors.inflation(3.0, -10.0), errors.inflation(3.0, 0.0));
  EXPECT_EQ(errors.inflation(-3.0, -10.0), 1e6);
  EXPECT_EQ(markov_inflation(-10.0, 40.0), 1e6);
}

}  // namespace
}  // namespace urban_gnss
