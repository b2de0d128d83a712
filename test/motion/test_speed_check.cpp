#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "urban_gnss_localization/motion/speed_check.hpp"

namespace urban_gnss {
namespace {

constexpr double kStep_s = 0.1;

/// Pairs at 10 Hz.
struct Pairs {
  SpeedCheck check;
  int count{0};
  double sigma_mps{0.1};

  SpeedFault add(double odometry_mps, double receiver_mps) {
    return check.add({from_seconds(kStep_s * count++), odometry_mps, receiver_mps, sigma_mps});
  }
  /// Pairs that span `duration_s` from the first to the last.
  SpeedFault add_for(double duration_s, double odometry_mps, double receiver_mps) {
    for (int k = 0; k < std::lround(duration_s / kStep_s); ++k) add(odometry_mps, receiver_mps);
    return add(odometry_mps, receiver_mps);
  }
};

/// Expects the fault at `least_s` after the first pair that shows it, and nothing before.
void expect_found(SpeedFault fault, double odometry_mps, double receiver_mps, double least_s) {
  Pairs pairs;
  pairs.add(0.6, 0.6);  // slow enough to turn back
  EXPECT_EQ(pairs.add_for(least_s - kStep_s, odometry_mps, receiver_mps), SpeedFault::kNone)
      << odometry_mps << ' ' << receiver_mps;
  EXPECT_EQ(pairs.add(odometry_mps, receiver_mps), fault) << odometry_mps << ' ' << receiver_mps;
}

TEST(SpeedCheck, AgreesWithinTheNoise) {
  for (const auto& [odometry, receiver] :
       {std::pair{0.0, 0.0}, {0.0, 0.45}, {0.2, -0.2}, {5.0, 6.0}, {-5.0, -6.0}, {30.0, 25.0}}) {
    EXPECT_EQ(Pairs().add_for(60.0, odometry, receiver), SpeedFault::kNone) << odometry << ' ' << receiver;
  }
  Pairs noisy;
  noisy.sigma_mps = 1.0;
  EXPECT_EQ(noisy.add_for(60.0, 0.0, 3.9), SpeedFault::kNone) << "below four of the receiver's sigmas";
  EXPECT_EQ(noisy.add_for(60.0, 0.0, 4.1), SpeedFault::kDead) << "above them";
}

TEST(SpeedCheck, ScaleOfATyreAgrees) {
  for (const double speed : {-3.0, 0.5, 5.0, 40.0}) {
    EXPECT_EQ(Pairs().add_for(100.0, speed, 1.07 * speed), SpeedFault::kNone) << speed;
  }
}

TEST(SpeedCheck, FaultsAreFoundAfterTheirTime) {
  expect_found(SpeedFault::kReversed, 3.0, -3.0, 1.5);
  expect_found(SpeedFault::kReversed, -2.0, 2.3, 1.5);
  expect_found(SpeedFault::kDead, 0.0, 3.0, 4.0);
  expect_found(SpeedFault::kDead, -0.04, -3.0, 4.0);
  expect_found(SpeedFault::kScaled, 2.0, 4.0, 4.0);    // one of two wheels dead
  expect_found(SpeedFault::kScaled, 36.0, 10.0, 4.0);  // km/h
  expect_found(SpeedFault::kScaled, -1.2, -4.0, 4.0);
  expect_found(SpeedFault::kScaled, 4.0, 6.0, 10.0);
}

TEST(SpeedCheck, ScaleIsOneOfAllSpeeds) {
  Pairs pairs;
  const auto odometry_at = [](int k) { return 6.0 + 4.0 * std::sin(0.05 * k); };
  for (int k = 0; k < 100; ++k) EXPECT_EQ(pairs.add(odometry_at(k), 0.7 * odometry_at(k)), SpeedFault::kNone) << k;
  for (int k = 100; k < 102; ++k) pairs.add(odometry_at(k), 0.7 * odometry_at(k));
  EXPECT_EQ(pairs.check.fault(), SpeedFault::kScaled);
}

// From backwards over standing to twice as fast, while the wheels say 5 m/s: each pattern is met, none is kept.
TEST(SpeedCheck, ReflectionOfChangingSizeIsNoFault) {
  Pairs pairs;
  for (int k = 0; k <= 80; ++k) EXPECT_EQ(pairs.add(5.0, -12.0 + 0.3 * k), SpeedFault::kNone) << k;
  // And one that lasts for longer than a scale needs, but never keeps its size.
  for (int k = 0; k <= 300; ++k) {
    EXPECT_EQ(pairs.add(10.0, 4.5 + 3.0 * std::sin(0.1 * k)), SpeedFault::kNone) << k;
  }
}

TEST(SpeedCheck, SlowWheelsOfAFastRobotHaveNoPattern) {
  EXPECT_EQ(Pairs().add_for(60.0, 0.2, 5.0), SpeedFault::kNone);
  EXPECT_EQ(Pairs().add_for(60.0, 5.0, -1.0), SpeedFault::kNone);
}

TEST(SpeedCheck, FaultEndsAfterAgreeing) {
  for (const auto& [odometry, receiver] : {std::pair{3.0, -3.0}, {0.0, 3.0}, {2.0, 4.0}}) {
    Pairs pairs;
    pairs.add(0.6, 0.6);
    const SpeedFault fault = pairs.add_for(10.0, odometry, receiver);
    ASSERT_NE(fault, SpeedFault::kNone);
    EXPECT_EQ(pairs.add_for(1.4, 3.0, 3.0), fault);
    EXPECT_EQ(pairs.add(odometry, receiver), fault);
    EXPECT_EQ(pairs.add_for(1.4, 3.0, 3.0), fault) << "one that does not agree starts the time anew";
    EXPECT_EQ(pairs.add(3.0, 3.0), SpeedFault::kNone);
  }
}

// A reflection can turn the receiver's velocity round, a robot has to stop for that; wheels may change their sign.
TEST(SpeedCheck, NoRobotTurnsBackAtSpeed) {
  EXPECT_EQ(Pairs().add_for(60.0, 5.0, -5.0), SpeedFault::kNone);
  Pairs pairs;
  pairs.add_for(10.0, 5.0, 5.0);
  EXPECT_EQ(pairs.add_for(1.4, -5.0, 5.0), SpeedFault::kNone);
  EXPECT_EQ(pairs.add(-5.0, 5.0), SpeedFault::kReversed);
}

// What has no pattern is no agreement either.
TEST(SpeedCheck, DifferenceWithoutAPatternEndsNothing) {
  Pairs pairs;
  ASSERT_EQ(pairs.add_for(4.0, 0.0, 3.0), SpeedFault::kDead);
  EXPECT_EQ(pairs.add_for(60.0, 0.2, 5.0), SpeedFault::kDead);
}

TEST(SpeedCheck, GapInThePatternStartsAnew) {
  for (const double between : {3.0, -9.0}) {  // agrees; has no pattern
    Pairs pairs;
    pairs.add(0.6, 0.6);
    pairs.add_for(1.4, 3.0, -3.0);
    pairs.add(3.0, between);
    EXPECT_EQ(pairs.add_for(1.4, 3.0, -3.0), SpeedFault::kNone) << between;
    EXPECT_EQ(pairs.add(3.0, -3.0), SpeedFault::kReversed) << between;
  }
}

// Two pairs before and after a tunnel are not a minute of a dead encoder.
TEST(SpeedCheck, SilenceOfTheReceiverStartsAnew) {
  Pairs pairs;
  pairs.add(0.0, 3.0);
  pairs.count += 600;
  EXPECT_EQ(pairs.add(0.0, 3.0), SpeedFault::kNone);
  EXPECT_EQ(pairs.add_for(3.8, 0.0, 3.0), SpeedFault::kNone);
  EXPECT_EQ(pairs.add_for(0.2, 0.0, 3.0), SpeedFault::kDead);
}

}  // namespace
}  // namespace urban_gnss
