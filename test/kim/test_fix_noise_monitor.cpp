#include <gtest/gtest.h>

#include "matchers.hpp"
#include "urban_gnss_localization/localizers/kim/fix_noise_monitor.hpp"

namespace urban_gnss {
namespace {

/// Mean inflation over fixes at 1 Hz that declare 2 m, of a robot that drives east: error of correlation `rho` from fix
/// to fix and of standard deviation `sigma`.
double mean_inflation(double sigma, double rho, std::uint64_t seed, FixNoiseParameters parameters = {}) {
  FixNoiseMonitor monitor(parameters);
  RandomEngine engine = make_engine(seed);
  Eigen::Vector2d error(0.0, 0.0);
  double sum = 0.0;
  int count = 0;
  for (int k = 0; k < 4000; ++k) {
    const double x = draw_normal(engine);
    const double y = draw_normal(engine);
    error = rho * error + std::sqrt(1.0 - rho * rho) * sigma * Eigen::Vector2d(x, y);
    const Eigen::Vector2d place(1.0 * k, 0.0);
    monitor.add(place + error, isotropic(2.0), place, 0.0, 0.0, k);
    if (k < 200) continue;
    sum += monitor.inflation();
    ++count;
  }
  return sum / count;
}

TEST(FixNoiseMonitor, WhiteErrorsOfTheDeclaredSizeAreBelieved) { EXPECT_LT(mean_inflation(2.0, 0.0, 1), 1.35); }

TEST(FixNoiseMonitor, UnderstatedErrorsAreEnlarged) { EXPECT_NEAR(mean_inflation(4.0, 0.0, 2), 4.0, 0.8); }

// (1 + rho) / (1 - rho) is 9 for 0.8; pairs 20 s apart are then independent.
TEST(FixNoiseMonitor, CorrelatedErrorsAreWorthLess) { EXPECT_NEAR(mean_inflation(2.0, 0.8, 3), 9.0, 2.0); }

TEST(FixNoiseMonitor, OverstatedErrorsAreNotReduced) { EXPECT_EQ(mean_inflation(0.2, 0.0, 4), 1.0); }

TEST(FixNoiseMonitor, InflationIsLimitedAndCanBeSwitchedOff) {
  FixNoiseParameters parameters;
  parameters.fix_noise_max_inflation = 3.0;
  EXPECT_LE(mean_inflation(2.0, 0.9, 5, parameters), 3.0);
  parameters.adapt_fix_noise = false;
  EXPECT_EQ(mean_inflation(2.0, 0.9, 5, parameters), 1.0);
}

TEST(FixNoiseMonitor, SpikesHaveALimitedSay) {
  FixNoiseMonitor monitor({});
  RandomEngine engine = make_engine(6);
  for (int k = 0; k < 300; ++k) {
    const double x = 2.0 * draw_normal(engine) + (k % 50 == 25 ? 2500.0 : 0.0);
    monitor.add({x, 2.0 * draw_normal(engine)}, isotropic(2.0), {0.0, 0.0}, 0.0, 0.0, k);
  }
  EXPECT_LT(monitor.inflation(), 3.0);
}

// What the odometry itself may be wrong by is not blamed on the fix.
TEST(FixNoiseMonitor, UncertainOdometryIsAllowedFor) {
  FixNoiseMonitor sure({});
  FixNoiseMonitor unsure({});
  for (int k = 0; k < 200; ++k) {
    const Eigen::Vector2d place(5.0 * k, 0.0);
    const Eigen::Vector2d fix(5.0 * k, 0.5 * k);  // a heading that is wrong by 0.1 rad
    sure.add(fix, isotropic(2.0), place, 0.0, 0.0, k);
    unsure.add(fix, isotropic(2.0), place, 0.0, 0.1, k);
  }
  EXPECT_EQ(sure.inflation(), FixNoiseParameters().fix_noise_max_inflation);
  EXPECT_LT(unsure.far(), 0.6 * sure.far());
}

TEST(FixNoiseMonitor, OutageJoinsNoPair) {
  FixNoiseMonitor monitor({});
  for (int k = 0; k < 30; ++k) monitor.add({500.0 * k, 0.0}, isotropic(2.0), {0.0, 0.0}, 0.0, 0.0, 100.0 * k);
  EXPECT_EQ(monitor.inflation(), 1.0);
  monitor.reset();
  EXPECT_EQ(monitor.near(), 1.0);
  EXPECT_EQ(monitor.far(), 1.0);
}

}  // namespace
}  // namespace urban_gnss
