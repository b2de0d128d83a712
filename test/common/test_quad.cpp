#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "urban_gnss_localization/common/quad.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"

namespace urban_gnss {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Numbers from `first` to `last`, at odd places between round ones.
std::vector<double> numbers_between(double first, double last, int steps = 100000) {
  std::vector<double> values;
  for (int k = 0; k <= steps; ++k) values.push_back(first + (last - first) * (k / (steps * 1.0000001)));
  return values;
}

TEST(Quad, ExponentialIsRightTo3e16) {
  for (const double x : numbers_between(-708.0, 709.0)) {
    ASSERT_NEAR(quad_exp(quad(x))[0], std::exp(x), 3e-16 * std::exp(x)) << x;
  }
  const Quad ends = quad_exp(Quad{0.0, -kInfinity, kInfinity, kNaN});
  EXPECT_EQ(ends[0], 1.0);
  EXPECT_EQ(ends[1], 0.0);
  EXPECT_TRUE(std::isfinite(ends[2]));
  EXPECT_TRUE(std::isnan(ends[3]));
}

TEST(Quad, LogarithmIsRightTo3e16) {
  for (const auto& values : {numbers_between(1e-9, 4.0), numbers_between(0.5, 2.0), numbers_between(1.0, 1e300)}) {
    for (const double x : values) {
      ASSERT_NEAR(quad_log(quad(x))[1], std::log(x), 3e-16 * std::abs(std::log(x)) + 1e-300) << x;
      ASSERT_NEAR(quad_log1p(quad(x))[2], std::log1p(x), 4e-16 * std::log1p(x)) << x;
    }
  }
  EXPECT_NEAR(quad_log1p(quad(1e-12))[0], std::log1p(1e-12), 3e-28);
  EXPECT_TRUE(std::isnan(quad_log(quad(kNaN))[3]));
}

TEST(Quad, SineAndCosineAreRightTo2e16) {
  for (const auto& values : {numbers_between(-7.0, 7.0), numbers_between(-1e5, 1e5)}) {
    for (const double x : values) {
      const QuadSineCosine both = quad_sincos(Quad{0.0, x, 0.0, 0.0});
      ASSERT_NEAR(both.sine[1], std::sin(x), 2e-16) << x;
      ASSERT_NEAR(both.cosine[1], std::cos(x), 2e-16) << x;
    }
  }
  EXPECT_LE(std::abs(quad_sincos(quad(1e300)).sine[0]), 1.0);
  EXPECT_TRUE(std::isnan(quad_sincos(quad(kNaN)).sine[0]));
  for (const double x : numbers_between(1e-5, 0.785)) {
    ASSERT_NEAR(quad_sinc(quad(x))[0], std::sin(x) / x, 3e-16) << x;
  }
  EXPECT_EQ(quad_sinc(quad(0.0))[0], 1.0);
}

TEST(Quad, WrapsAnglesAsOne) {
  for (const double x : numbers_between(-40.0, 40.0, 1000)) {
    EXPECT_NEAR(quad_wrap(quad(x))[0], wrap_angle(x), 1e-14) << x;
  }
  for (const double x : {-kPi, kPi, 3.0 * kPi, -3.0 * kPi}) {
    EXPECT_GE(quad_wrap(quad(x))[0], -kPi);
    EXPECT_LT(quad_wrap(quad(x))[0], kPi);
  }
  EXPECT_TRUE(std::isnan(quad_wrap(quad(kNaN))[0]));
}

}  // namespace
}  // namespace urban_gnss
