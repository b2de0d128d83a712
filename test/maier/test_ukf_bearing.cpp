// The IMU's bearing in the UKF.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "ukf_rig.hpp"

namespace urban_gnss {
namespace {

TEST(UkfBearing, UnknownYawBecomesTheBearing) {
  Ukf ukf(plain(), noise_free());
  ukf.initialize(pose_with_sigma({1.0, 2.0, 0.0}, 3.0, kPi / std::sqrt(3.0)));
  ukf.correct_heading({-1.2, 0.2});
  EXPECT_NEAR(ukf.pose().yaw, -1.2, 0.02);
  EXPECT_NEAR(std::sqrt(ukf.covariance()(2, 2)), 0.2, 1e-9);
  EXPECT_EQ(ukf.pose().x, 1.0);
  EXPECT_TRUE(is_sound(ukf));
}

TEST(UkfBearing, ManyAreNoBetterThanOne) {
  Ukf ukf(plain(), MotionParameters());
  ukf.initialize(pose_with_sigma({}, 1.0, 1.0));
  for (int k = 0; k < 1000; ++k) {
    ukf.correct_heading({0.3, 0.2});
    ukf.move({1.0, 0.1}, 0.1);
    EXPECT_GE(std::sqrt(ukf.covariance()(2, 2)), 0.2 - 1e-9);
  }
  EXPECT_TRUE(is_sound(ukf));
}

TEST(UkfBearing, SurerYawStaysAsItIs) {
  Ukf ukf(plain(), noise_free());
  ukf.initialize(pose_with_sigma({1.0, 2.0, 0.4}, 3.0, 0.05));
  const Ukf::State before = ukf.state();
  ukf.correct_heading({0.5, 0.2});
  EXPECT_EQ(ukf.state(), before);
}

TEST(UkfBearing, MovesThePositionThatDependsOnTheYaw) {
  Ukf ukf(plain(), noise_free());
  ukf.initialize(pose_with_sigma({}, 0.1, 0.5));
  for (int k = 0; k < 100; ++k) ukf.move({1.0, 0.0}, 0.1);
  const double before = ukf.covariance()(1, 1);
  ukf.correct_heading({0.3, 0.1});
  EXPECT_NEAR(ukf.pose().y, 10.0 * std::sin(0.3), 0.6);
  EXPECT_LT(ukf.covariance()(1, 1), 0.2 * before);
}

TEST(UkfBearing, WhatCannotBeIsLeftOut) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  Ukf ukf(plain(), noise_free());
  ukf.initialize(pose_with_sigma({1.0, 2.0, 0.4}, 3.0, 0.3));
  const Ukf::State before = ukf.state();
  for (const HeadingMeasurement& bad :
       {HeadingMeasurement{kNaN, 0.2}, {0.4, kNaN}, {0.4, 0.0}, {0.4, -1.0}, {0.4 + 1.5, 0.2}}) {
    ukf.correct_heading(bad);
    EXPECT_EQ(ukf.state(), before) << bad.yaw_rad << ' ' << bad.sigma_rad;
  }
  ukf.correct_heading({0.4 + 2.0 * kPi + 0.3, 0.2});
  EXPECT_GT(ukf.pose().yaw, 0.4) << "another turn of the same bearing";
}

}  // namespace
}  // namespace urban_gnss
