#include <gtest/gtest.h>

#include <cmath>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/gnss/chi_squared.hpp"
#include "urban_gnss_localization/gnss/learnt_scale.hpp"

namespace urban_gnss {
namespace {

TEST(LearntScale, MedianIsThatOfTheChiSquaredDistribution) {
  EXPECT_NEAR(LearntScale::kMedianNis, chi_squared_quantile(0.5, 2), 1e-9);
}

/// Geometric mean of where the factor settles for measurements with `draw_nis` at factor 1.
template <class Draw>
double settled(LearntScale scale, const Draw& draw_nis) {
  double log_sum = 0.0;
  constexpr int kCount = 40000;
  for (int k = 0; k < kCount; ++k) {
    scale.learn(draw_nis() / scale.value() > LearntScale::kMedianNis ? 1.0 : 0.0);
    if (k >= kCount / 2) log_sum += std::log(scale.value());
  }
  return std::exp(log_sum / (kCount / 2));
}

/// The factor puts the median of any distribution at that of the chi-squared one.
TEST(LearntScale, FindsTheMedianWhateverTheDistribution) {
  RandomEngine engine = make_engine(11);
  const LearntScale scale(0.01, 100.0);
  const auto exponential = [&] { return -2.0 * std::log(1.0 - draw_uniform(engine)); };  // chi-squared, 2 dof
  for (const double sigma : {0.1, 1.0, 7.0}) {
    EXPECT_NEAR(settled(scale, [&] { return sigma * sigma * exponential(); }) / (sigma * sigma), 1.0, 0.05) << sigma;
  }
  // A tail without a mean.
  EXPECT_NEAR(
      settled(scale, [&] { return LearntScale::kMedianNis * std::pow(draw_normal(engine) / draw_normal(engine), 2); }),
      1.0, 0.06);
  // Two fifths of the measurements may be anything: the quantile of the others is 0.5 / 0.6.
  const auto mostly = [&] { return draw_uniform(engine) < 0.4 ? 1e12 : exponential(); };
  EXPECT_NEAR(settled(scale, mostly), -2.0 * std::log(1.0 / 6.0) / LearntScale::kMedianNis, 0.15);
}

TEST(LearntScale, KeepsToItsLimitsAndItsRate) {
  LearntScale scale(0.5, 3.0);
  for (int k = 0; k < 100; ++k) scale.learn(1.0);
  EXPECT_NEAR(scale.value(), 9.0, 1e-12);
  for (int k = 0; k < 100; ++k) scale.learn(0.0);
  EXPECT_NEAR(scale.value(), 1.0 / 9.0, 1e-12);
  LearntScale step(0.03, 20.0);
  step.learn(0.5);
  EXPECT_EQ(step.value(), 1.0);
  step.learn(1.0);
  EXPECT_NEAR(step.value(), std::exp(0.03), 1e-12);
  LearntScale fixed(0.0, 20.0);
  fixed.learn(1.0);
  EXPECT_EQ(fixed.value(), 1.0);
}

}  // namespace
}  // namespace urban_gnss
