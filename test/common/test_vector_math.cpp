#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "urban_gnss_localization/common/vector_math.hpp"

namespace urban_gnss {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr double kPi64 = 3.14159265358979323846;
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

/// Floats from `first` to `last`, each a part in `steps` of the way on, at odd places between round numbers.
std::vector<float> floats_between(float first, float last, int steps = 200000) {
  std::vector<float> values;
  for (int k = 0; k <= steps; ++k) values.push_back(first + (last - first) * (static_cast<float>(k) / steps));
  return values;
}

TEST(VectorMath, ExponentialIsRightTo2e7) {
  for (const float x : floats_between(-87.0F, 88.0F)) {
    const double expected = std::exp(static_cast<double>(x));
    ASSERT_NEAR(vector_exp(x), expected, 2e-7 * expected) << x;
  }
  EXPECT_EQ(vector_exp(0.0F), 1.0F);
  EXPECT_EQ(vector_exp(-87.5F), 0.0F);
  EXPECT_EQ(vector_exp(-kInfinity), 0.0F);
  EXPECT_TRUE(std::isfinite(vector_exp(kInfinity)));
  EXPECT_TRUE(std::isnan(vector_exp(kNaN)));
}

TEST(VectorMath, LogarithmIsRightTo1e7) {
  for (const auto& values : {floats_between(1e-6F, 4.0F), floats_between(0.5F, 2.0F), floats_between(1.0F, 1e30F)}) {
    for (const float x : values) {
      const double expected = std::log(static_cast<double>(x));
      ASSERT_NEAR(vector_log(x), expected, 1e-7 * std::max(1.0, std::abs(expected))) << x;
    }
  }
  EXPECT_EQ(vector_log(1.0F), 0.0F);
  EXPECT_NEAR(vector_log(0x1p-32F), -32.0 * std::log(2.0), 2e-6);
}

TEST(VectorMath, SineAndCosineAreRightTo1e7) {
  for (const auto& values : {floats_between(-100.0F, 100.0F), floats_between(-0.01F, 0.01F)}) {
    for (const float x : values) {
      const SineCosine both = vector_sincos(x);
      ASSERT_NEAR(both.sine, std::sin(static_cast<double>(x)), 1e-7) << x;
      ASSERT_NEAR(both.cosine, std::cos(static_cast<double>(x)), 1e-7) << x;
    }
  }
  // A small angle keeps its digits, so that sin(x) / x needs no series.
  for (const float x : floats_between(1e-5F, 0.5F)) {
    const double expected = std::sin(static_cast<double>(x));
    ASSERT_NEAR(vector_sincos(x).sine, expected, 1.5e-7 * expected) << x;
  }
  for (const float far : {1e6F, -1e30F, kInfinity, -kInfinity}) {
    EXPECT_LE(std::abs(vector_sincos(far).sine), 1.0F) << far;
    EXPECT_LE(std::abs(vector_sincos(far).cosine), 1.0F) << far;
  }
  EXPECT_TRUE(std::isnan(vector_sincos(kNaN).sine));
}

TEST(VectorMath, WrapsIntoHalfATurnOnEitherSide) {
  for (const float x : floats_between(-40.0F, 40.0F)) {
    const double expected = std::remainder(static_cast<double>(x), 2.0 * kPi64);
    const double error = std::remainder(vector_wrap(x) - expected, 2.0 * kPi64);
    ASSERT_NEAR(error, 0.0, 4e-7) << x;  // a rounding of up to pi and a part of 3e-7 for each of six turns
    ASSERT_LE(std::abs(vector_wrap(x)), kPi64 + 4e-6) << x;
  }
}

TEST(VectorMath, SumsAreThoseOfAPlainLoop) {
  for (const std::size_t count : {0U, 1U, 15U, 16U, 17U, 1000U}) {
    const auto sums = vector_sums<2>(count, [](std::size_t i) URBAN_GNSS_INLINE_LAMBDA {
      return std::array<double, 2>{1.0, static_cast<double>(i)};
    });
    EXPECT_EQ(sums[0], static_cast<double>(count));
    EXPECT_EQ(sums[1], 0.5 * static_cast<double>(count) * (static_cast<double>(count) - 1.0));  // whole numbers: exact
  }
}

}  // namespace
}  // namespace urban_gnss
