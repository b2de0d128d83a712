#include <gtest/gtest.h>

#include <cmath>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/geometry/protection_level.hpp"

namespace urban_gnss {
namespace {

constexpr int kDraws = 200000;
constexpr int kDof = 6;

/// 4.5 standard deviations of a share of kDraws that is expected to be `p`.
double tolerance(double p) { return 4.5 * std::sqrt(p * (1.0 - p) / kDraws); }

/// Draws 1 / sqrt(chi^2 / (kDof - 2)): times normal numbers it makes Student's t of kDof degrees of freedom and of
/// variance 1.
double draw_heavy_tail(RandomEngine& engine) {
  double chi_squared = 0.0;
  for (int i = 0; i < kDof; ++i) {
    const double normal = draw_normal(engine);
    chi_squared += normal * normal;
  }
  return std::sqrt((kDof - 2) / chi_squared);
}

/// The share of errors with these standard deviations along the axes of their ellipse that are beyond the level.
double share_beyond(double major_m, double minor_m) {
  RandomEngine engine = make_engine(31);
  const double level = protection_level_m(major_m);
  int beyond = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double tail = draw_heavy_tail(engine);
    const double along = tail * major_m * draw_normal(engine);
    const double across = tail * minor_m * draw_normal(engine);
    beyond += std::hypot(along, across) > level;
  }
  return beyond / static_cast<double>(kDraws);
}

TEST(ProtectionLevel, OneOfAThousandHeavyTailedErrorsIsBeyondItOfACircle) {
  EXPECT_NEAR(share_beyond(1.0, 1.0), 1e-3, tolerance(1e-3));
  EXPECT_NEAR(share_beyond(7.5, 7.5), 1e-3, tolerance(1e-3));
}

TEST(ProtectionLevel, FewerAreBeyondItOfAnEllipse) {
  for (const double ratio : {0.7, 0.4, 0.0}) EXPECT_LT(share_beyond(3.0, 3.0 * ratio), 1e-3) << ratio;
}

TEST(ProtectionLevel, IsTheQuantileOfStudentsDistribution) {
  EXPECT_EQ(protection_level_m(0.0), 0.0);
  for (const double sigma : {0.02, 1.0, 50.0}) {
    const double factor = std::sqrt((kDof - 2) * (std::pow(1e-3, -2.0 / kDof) - 1.0));
    EXPECT_NEAR(protection_level_m(sigma), factor * sigma, 1e-9 * sigma) << sigma;
  }
}

}  // namespace
}  // namespace urban_gnss
