#include <gtest/gtest.h>

#include "urban_gnss_localization/motion/yaw_rate_check.hpp"

namespace urban_gnss {
namespace {

/// Both rates at 20 Hz, of a robot that rolls at 1 m/s.
struct Rates {
  YawRateArbiter arbiter;
  double speed_mps{1.0};
  YawRateFault add_for(double duration_s, double odometry_radps, double imu_radps) {
    for (int k = 0; k < duration_s / 0.05; ++k) arbiter.add({speed_mps, odometry_radps}, imu_radps, 0.05);
    return arbiter.fault();
  }
  /// Turns in which both agree.
  Rates& agree() {
    add_for(5.0, 0.4, 0.35);
    return *this;
  }
};

TEST(YawRateArbiter, ImuThatJumpsIsWrong) {
  for (const double turning : {0.0, 0.4, -0.4}) {
    Rates rates = Rates().agree();
    ASSERT_EQ(rates.add_for(5.0, turning, turning), YawRateFault::kNone);
    EXPECT_EQ(rates.add_for(3.0, turning, turning + 1.3), YawRateFault::kImu) << turning;
    EXPECT_NEAR(rates.arbiter.lasted_s(), 3.0, 0.06);
    EXPECT_EQ(rates.add_for(0.1, turning, turning), YawRateFault::kNone) << "it is back";
    EXPECT_EQ(rates.arbiter.lasted_s(), 0.0);
  }
}

TEST(YawRateArbiter, ElseTheWheelsAreWrong) {
  for (const double turning : {0.0, 0.4, -0.4}) {
    Rates rates = Rates().agree();
    rates.add_for(5.0, turning, turning);
    EXPECT_EQ(rates.add_for(30.0, turning + 1.7, turning), YawRateFault::kOdometry) << turning;
    EXPECT_EQ(rates.add_for(0.1, turning, turning), YawRateFault::kNone);
  }
}

// A dead encoder, and a robot that begins to turn; at once, too, where the wheels stand.
TEST(YawRateArbiter, ImuThatBeginsATurnIsRight) {
  Rates rates = Rates().agree();
  rates.add_for(5.0, 0.0, 0.0);
  for (int k = 0; k <= 20; ++k) EXPECT_NE(rates.add_for(0.05, 0.0, 0.05 * k), YawRateFault::kImu) << k;
  EXPECT_EQ(rates.arbiter.fault(), YawRateFault::kOdometry);
  Rates standing = Rates().agree();
  standing.speed_mps = 0.0;
  standing.add_for(5.0, 0.0, 0.0);
  EXPECT_EQ(standing.add_for(2.0, 0.0, 1.5), YawRateFault::kOdometry);
}

TEST(YawRateArbiter, OdometryWithoutAYawRateHasNoSay) {
  Rates rates;
  for (int k = 0; k < 50; ++k) {
    EXPECT_EQ(rates.add_for(2.0, 0.0, 0.0), YawRateFault::kNone);
    EXPECT_EQ(rates.add_for(2.0, 0.0, 1.0), YawRateFault::kNone) << k;
  }
}

TEST(YawRateArbiter, WheelsThatSkidAreNoContradiction) {
  EXPECT_EQ(Rates().agree().add_for(10.0, 2.0, 1.0), YawRateFault::kNone) << "a skid-steered robot";
  EXPECT_EQ(Rates().agree().add_for(10.0, 0.25, 0.0), YawRateFault::kNone) << "a bump";
}

}  // namespace
}  // namespace urban_gnss
