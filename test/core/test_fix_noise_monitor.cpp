#include <gtest/gtest.h>

#include "matchers.hpp"
#include "urban_gnss_localization/filters/fix_noise_monitor.hpp"

namespace urban_gnss {
namespace {

/// Mean shares over fixes at 1 Hz that declare 2 m, of a robot that drives east: error of correlation `rho` from fix to
/// fix and of standard deviation `sigma`.
FixNoise mean_noise(double sigma, double rho, std::uint64_t seed, FixNoiseParameters parameters = {}) {
  FixNoiseMonitor monitor(parameters);
  RandomEngine engine = make_engine(seed);
  Eigen::Vector2d error(0.0, 0.0);
  FixNoise sum{0.0, 0.0};
  int count = 0;
  for (int k = 0; k < 4000; ++k) {
    const double x = draw_normal(engine);
    const double y = draw_normal(engine);
    error = rho * error + std::sqrt(1.0 - rho * rho) * sigma * Eigen::Vector2d(x, y);
    const Eigen::Vector2d place(1.0 * k, 0.0);
    monitor.add(place + error, isotropic(2.0), place, 0.0, 0.0, k);
    if (k < 200) continue;
    sum.white += monitor.noise().white;
    sum.coloured += monitor.noise().coloured;
    ++count;
  }
  return {sum.white / count, sum.coloured / count};
}

// Of 60 pairs the mean scatters by about a tenth.
TEST(FixNoiseMonitor, WhiteErrorsOfTheDeclaredSizeAreWhite) {
  const FixNoise noise = mean_noise(2.0, 0.0, 1);
  EXPECT_NEAR(noise.white, 1.0, 0.05);
  EXPECT_LT(noise.coloured, 0.15);
}

TEST(FixNoiseMonitor, UnderstatedErrorsAreEnlarged) { EXPECT_NEAR(mean_noise(4.0, 0.0, 2).white, 3.7, 0.4); }

// Half the mean square difference of neighbours is (1 - rho) of the variance.
TEST(FixNoiseMonitor, CorrelatedErrorsAreMostlyColoured) {
  const FixNoise noise = mean_noise(2.0, 0.9, 3);
  EXPECT_NEAR(noise.white, 0.1, 0.01);
  EXPECT_NEAR(noise.coloured, 0.9, 0.01);
}

TEST(FixNoiseMonitor, TheWholeOfTheDeclaredCovarianceStays) {
  const FixNoise noise = mean_noise(0.2, 0.0, 4);
  EXPECT_NEAR(noise.white + noise.coloured, 1.0, 1e-9);
  EXPECT_NEAR(noise.white, 0.01, 0.002);
}

TEST(FixNoiseMonitor, CanBeSwitchedOff) {
  FixNoiseParameters parameters;
  parameters.adapt_fix_noise = false;
  const FixNoise noise = mean_noise(2.0, 0.9, 5, parameters);
  EXPECT_EQ(noise.white, 1.0);
  EXPECT_EQ(noise.coloured, 0.0);
}

TEST(FixNoiseMonitor, SpikesHaveALimitedSay) {
  FixNoiseMonitor monitor({});
  RandomEngine engine = make_engine(6);
  for (int k = 0; k < 300; ++k) {
    const double x = 2.0 * draw_normal(engine) + (k % 50 == 25 ? 2500.0 : 0.0);
    monitor.add({x, 2.0 * draw_normal(engine)}, isotropic(2.0), {0.0, 0.0}, 0.0, 0.0, k);
  }
  EXPECT_LT(monitor.noise().white, 2.0);
}

// What the odometry itself may be wrong by is not blamed on the fix.
TEST(FixNoiseMonitor, UncertainOdometryIsAllowedFor) {
  FixNoiseMonitor sure({});
  FixNoiseMonitor unsure({});
  for (int k = 0; k < 200; ++k) {
    const Eigen::Vector2d place(20.0 * k, 0.0);
    const Eigen::Vector2d fix(20.0 * k, 2.0 * k);  // a heading that is wrong by 0.1 rad
    sure.add(fix, isotropic(2.0), place, 0.0, 0.0, k);
    unsure.add(fix, isotropic(2.0), place, 0.0, 0.1, k);
  }
  EXPECT_NEAR(sure.noise().white, 0.25, 1e-6);  // 4 / 2 / (4 + 4)
  EXPECT_NEAR(unsure.noise().white, 4.0 / 2.0 / 12.0, 1e-6);
}

TEST(FixNoiseMonitor, OutagesAndDoubtedFixesTeachNothing) {
  FixNoiseMonitor monitor({});
  for (int k = 0; k < 30; ++k) monitor.add({500.0 * k, 0.0}, isotropic(2.0), {0.0, 0.0}, 0.0, 0.0, 100.0 * k);
  for (int k = 0; k < 30; ++k) monitor.add({500.0 * k, 0.0}, isotropic(2.0), {0.0, 0.0}, 0.0, 0.0, 4000.0 + k, true);
  EXPECT_EQ(monitor.noise().white, 1.0);
  EXPECT_EQ(monitor.noise().coloured, 1.0) << "not known yet";
}

}  // namespace
}  // namespace urban_gnss
