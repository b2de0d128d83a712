#include <gtest/gtest.h>

#include <cmath>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/geometry/protection_level.hpp"

namespace urban_gnss {
namespace {

constexpr int kDraws = 200000;

/// 4.5 standard deviations of a share of kDraws that is expected to be `p`.
double tolerance(double p) { return 4.5 * std::sqrt(p * (1.0 - p) / kDraws); }

/// The share of Gaussian errors with these sigmas along the axes of their ellipse that are beyond the level.
double share_beyond(double major_m, double minor_m) {
  RandomEngine engine = make_engine(31);
  const double level = protection_level_m(major_m);
  int beyond = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double along = major_m * draw_normal(engine);
    const double across = minor_m * draw_normal(engine);
    beyond += std::hypot(along, across) > level;
  }
  return beyond / static_cast<double>(kDraws);
}

TEST(ProtectionLevel, OneOfAThousandIsBeyondItOfACircle) {
  EXPECT_NEAR(share_beyond(1.0, 1.0), 1e-3, tolerance(1e-3));
  EXPECT_NEAR(share_beyond(7.5, 7.5), 1e-3, tolerance(1e-3));
}

TEST(ProtectionLevel, FewerAreBeyondItOfAnEllipse) {
  for (const double ratio : {0.8, 0.5, 0.1}) {
    EXPECT_LT(share_beyond(3.0, 3.0 * ratio), 1e-3) << ratio;
  }
  // Errors along a line: the two tails of a normal distribution.
  const double tails = std::erfc(protection_level_m(1.0) / std::sqrt(2.0));
  EXPECT_NEAR(share_beyond(3.0, 0.0), tails, tolerance(tails));
}

TEST(ProtectionLevel, IsTheFormulaOfTheHeader) {
  EXPECT_EQ(protection_level_m(0.0), 0.0);
  for (const double sigma : {0.02, 1.0, 50.0}) {
    EXPECT_NEAR(protection_level_m(sigma), std::sqrt(-2.0 * std::log(1e-3)) * sigma, 1e-12 * sigma) << sigma;
  }
}

}  // namespace
}  // namespace urban_gnss
