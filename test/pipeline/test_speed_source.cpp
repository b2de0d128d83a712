#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "urban_gnss_localization/pipeline/speed_source.hpp"

namespace urban_gnss {
namespace {

constexpr double kStep_s = 0.1;

/// Odometry at 10 Hz, and a receiver whose velocity comes with each of its steps, or not at all.
struct Drive {
  SpeedSource source;
  std::vector<PipelineEvent> events;
  int steps{0};

  explicit Drive(const SpeedParameters& parameters = {}) : source(parameters) {}
  /// The speed that is used.
  double step(double odometry_mps) {
    return source.speed_of(odometry_mps, from_seconds(kStep_s * ++steps), kStep_s, events);
  }
  double step(double odometry_mps, double forward_mps) {
    const double speed_mps = step(odometry_mps);
    source.compare({from_seconds(kStep_s * steps), std::abs(forward_mps), forward_mps, 0.1}, events);
    return speed_mps;
  }
  double step_for(double duration_s, double odometry_mps, double forward_mps) {
    for (int k = 1; k < std::lround(duration_s / kStep_s); ++k) step(odometry_mps, forward_mps);
    return step(odometry_mps, forward_mps);
  }
};

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(SpeedSource, GlitchIsHeld) {
  Drive drive;
  for (int k = 0; k < 10; ++k) EXPECT_EQ(drive.step(5.0), 5.0);
  EXPECT_EQ(drive.step(140.0), 5.0);
  ASSERT_EQ(drive.events.size(), 1u);
  EXPECT_EQ(drive.events[0].level, PipelineEvent::Level::kWarn);
  EXPECT_TRUE(contains(drive.events[0].text, "5.0")) << drive.events[0].text;
  EXPECT_TRUE(contains(drive.events[0].text, "140.0")) << drive.events[0].text;
  for (int k = 0; k < 10; ++k) EXPECT_EQ(drive.step(5.1), 5.1);
  EXPECT_EQ(drive.events.size(), 1u);
  EXPECT_EQ(drive.step(-140.0), 5.1) << "backwards as well";
}

TEST(SpeedSource, StepThatLastsIsBelievedAfterTwoSeconds) {
  Drive drive;
  drive.step(5.0);
  int held = 0;
  while (drive.step(140.0) == 5.0 && held < 100) ++held;
  EXPECT_NEAR(kStep_s * held, 2.0, 1.01 * kStep_s);
  for (int k = 0; k < 10; ++k) EXPECT_EQ(drive.step(140.0), 140.0);
  EXPECT_EQ(drive.events.size(), 1u) << "told once";
  EXPECT_EQ(drive.step(5.0), 5.0) << "the way back is believed at once";
}

TEST(SpeedSource, AccelerationWithinTheLimitIsNoGlitch) {
  Drive fast;
  for (int k = 0; k <= 15; ++k) EXPECT_EQ(fast.step(0.95 * k), 0.95 * k) << "9.5 m/s^2";
  EXPECT_TRUE(fast.events.empty());
  SpeedParameters gentle;
  gentle.max_acceleration = 2.0;
  Drive slow(gentle);
  for (int k = 0; k < 20; ++k) EXPECT_EQ(slow.step(k % 2 * 0.9), k % 2 * 0.9) << "ticks of a coarse encoder";
  EXPECT_TRUE(slow.events.empty());
  EXPECT_EQ(slow.step(-1.0), 0.9) << "19 m/s^2 are too many here";
}

TEST(SpeedSource, ReceiverTakesThePlaceOfADeadEncoder) {
  Drive drive;
  EXPECT_EQ(drive.step_for(4.0, 0.0, 5.0), 0.0);
  EXPECT_TRUE(drive.events.empty());
  EXPECT_EQ(drive.step_for(0.3, 0.0, 5.0), 5.0);
  EXPECT_TRUE(contains(drive.source.complaint(), "0.0 m/s")) << drive.source.complaint();
  EXPECT_TRUE(contains(drive.source.complaint(), "5.0 m/s")) << drive.source.complaint();
  ASSERT_EQ(drive.events.size(), 1u);
  EXPECT_EQ(drive.events[0].level, PipelineEvent::Level::kWarn);
  EXPECT_TRUE(contains(drive.events[0].text, "5.0 m/s")) << drive.events[0].text;
  drive.step(0.0, 7.0);
  EXPECT_EQ(drive.step(0.0), 7.0) << "as it changes";
  EXPECT_EQ(drive.events.size(), 1u);
}

// Before anything is found, who is wrong is open: that both contradict each other is not.
TEST(SpeedSource, ContradictionIsToldBeforeItIsFound) {
  Drive drive;
  drive.step_for(10.0, 5.0, 5.0);
  EXPECT_EQ(drive.source.complaint(), "");
  for (int k = 0; k < 30; ++k) {
    EXPECT_EQ(drive.step(5.0, 3.3), 5.0);
    EXPECT_EQ(drive.source.doubt_m2(), 0.0) << "the receiver's speed changed, by a reflection";
    EXPECT_EQ(drive.source.complaint().empty(), k < 25) << k;
  }
  drive.step_for(2.0, 5.0, 5.0);
  EXPECT_EQ(drive.source.complaint(), "") << "it was the receiver";
}

TEST(SpeedSource, ContradictionEndsWhereTheRobotStandsOrTheReceiverIsSilent) {
  Drive standing;
  standing.step_for(10.0, 5.0, 5.0);
  standing.step_for(3.0, 5.0, 3.3);
  EXPECT_NE(standing.source.complaint(), "");
  standing.step(0.0, 0.1);
  EXPECT_EQ(standing.source.complaint(), "");
  Drive silent;
  silent.step_for(10.0, 5.0, 5.0);
  silent.step_for(3.0, 5.0, 3.3);
  for (int k = 0; k < 26; ++k) silent.step(5.0);
  EXPECT_EQ(silent.source.complaint(), "");
}

TEST(SpeedSource, JumpOfTheOdometryIsDoubtedAtOnce) {
  Drive drive;
  drive.step_for(10.0, 3.0, 3.0);
  double doubt_m2 = 0.0;
  for (int k = 0; k < 40; ++k) {
    EXPECT_EQ(drive.step(4.9, 3.0), 4.9);
    doubt_m2 += drive.source.doubt_m2();
    EXPECT_EQ(drive.source.complaint().empty(), k < 15) << k;
  }
  EXPECT_NEAR(std::sqrt(doubt_m2), 0.5 * 4.0 * 4.9, 0.5) << "4 s of a speed that may be any";
  EXPECT_EQ(drive.step_for(1.2, 4.9, 3.0), 3.0) << "found after half of the time";
}

TEST(SpeedSource, ReceiverTakesThePlaceOfWheelsThatAnotherSensorContradicts) {
  Drive drive;
  drive.step_for(10.0, 1.0, 1.1);
  drive.source.set_wheels_contradicted(true);
  EXPECT_EQ(drive.step(0.9), 1.1);
  EXPECT_GT(drive.source.doubt_m2(), 0.0) << "errors of the receiver's speed last";
  drive.source.set_wheels_contradicted(false);
  EXPECT_EQ(drive.step(0.9), 0.9);
  EXPECT_EQ(drive.source.doubt_m2(), 0.0);
}

// A driver that multiplies by -1 says -0.0, and an encoder that stands may say a rounded -0.001.
TEST(SpeedSource, SignOfWheelsThatStandDoesNotMatter) {
  for (const double standing : {-0.0, -0.001}) {
    Drive drive;
    EXPECT_EQ(drive.step_for(5.0, standing, 5.0), 5.0) << standing;
  }
}

TEST(SpeedSource, OdometryIsUsedAgainOnceBothAgree) {
  Drive drive;
  drive.step_for(5.0, 0.0, 5.0);
  EXPECT_EQ(drive.step_for(1.4, 5.2, 5.0), 5.0);
  EXPECT_EQ(drive.step_for(0.4, 5.2, 5.0), 5.2);
  EXPECT_EQ(drive.source.complaint(), "");
  ASSERT_EQ(drive.events.size(), 2u) << "from 0 to 5.2 m/s is no glitch here";
  EXPECT_EQ(drive.events[1].level, PipelineEvent::Level::kInfo);
}

TEST(SpeedSource, ReversingIsFoundOnlyAfterTheSignHasAgreed) {
  Drive drive;
  EXPECT_EQ(drive.step_for(20.0, 2.0, -2.0), 2.0) << "the heading may be the wrong way round";
  EXPECT_TRUE(drive.events.empty());
  drive.step_for(2.0, 2.0, 2.0);
  drive.step_for(0.5, 0.9, 0.9);  // slow enough to turn back
  EXPECT_EQ(drive.step_for(1.5, 2.0, -2.0), 2.0);
  EXPECT_TRUE(drive.events.empty());
  EXPECT_EQ(drive.step_for(0.3, 2.0, -2.0), -2.0);
  ASSERT_EQ(drive.events.size(), 1u);
  EXPECT_TRUE(contains(drive.source.complaint(), " 2.0 m/s")) << drive.source.complaint();
  EXPECT_TRUE(contains(drive.source.complaint(), "-2.0 m/s")) << drive.source.complaint();
}

TEST(SpeedSource, WithoutAHeadingTheSizeIsCompared) {
  Drive drive;
  const auto compare = [&](double speed_mps) {
    drive.source.compare({from_seconds(kStep_s * drive.steps), speed_mps, {}, 0.1}, drive.events);
  };
  for (int k = 0; k < 200; ++k) {
    EXPECT_EQ(drive.step(-3.0), -3.0) << k;
    compare(3.0);
  }
  EXPECT_TRUE(drive.events.empty());
  for (int k = 0; k < 110; ++k) {  // half of the robot's speed
    drive.step(-3.0);
    compare(6.0);
  }
  EXPECT_EQ(drive.step(-3.0), -6.0) << "with the sign of the odometry";
}

TEST(SpeedSource, OdometryIsUsedWhileTheReceiverIsSilent) {
  Drive drive;
  drive.step_for(5.0, 0.0, 5.0);
  for (int k = 1; k <= 24; ++k) EXPECT_EQ(drive.step(0.01), 5.0) << k;
  drive.step(0.01);  // 2.5 s
  for (int k = 26; k <= 60; ++k) EXPECT_EQ(drive.step(0.01), 0.01) << k;
  drive.step(0.01, 4.0);
  EXPECT_EQ(drive.step(0.01), 4.0) << "the receiver is back, and the encoder is as dead as it was";
}

TEST(SpeedSource, WheelsAreNotCheckedWhereThatIsNotWanted) {
  SpeedParameters p;
  p.check_wheels = false;
  Drive drive(p);
  EXPECT_EQ(drive.step_for(60.0, 0.0, 5.0), 0.0);
  EXPECT_EQ(drive.source.complaint(), "");
  EXPECT_TRUE(drive.events.empty());
  EXPECT_EQ(drive.step(140.0, 5.0), 0.0) << "glitches are";
}

TEST(SpeedSource, ResetForgetsTheFault) {
  Drive drive;
  ASSERT_EQ(drive.step_for(5.0, 0.0, 5.0), 5.0);
  drive.source.reset();
  EXPECT_EQ(drive.source.complaint(), "");
  EXPECT_EQ(drive.step(50.0), 50.0) << "nothing to compare with";
}

TEST(SpeedSource, ReceiverAheadOfAllOdometryIsNotCompared) {
  Drive drive;
  for (int k = 0; k < 100; ++k) {
    drive.source.compare({from_seconds(kStep_s * (drive.steps + 1)), 5.0, 5.0, 0.1}, drive.events);
    EXPECT_EQ(drive.step(0.0), 0.0);
  }
  EXPECT_TRUE(drive.events.empty());
}

/// A second of odometry at 10 Hz, and the speed by fixes at its end.
double second_beside_fixes(Drive& drive, double odometry_mps, double fixes_mps, double sigma_mps = 0.1) {
  for (int k = 0; k < 9; ++k) drive.step(odometry_mps);
  const double speed_mps = drive.step(odometry_mps);
  drive.source.compare({from_seconds(kStep_s * drive.steps), std::abs(fixes_mps), fixes_mps, sigma_mps, 3.0},
                       drive.events);
  return speed_mps;
}

TEST(SpeedSource, FixesTakeThePlaceOfADeadEncoder) {
  Drive drive;
  for (int k = 0; k < 10; ++k) second_beside_fixes(drive, 1.0, 1.0);
  for (int k = 0; k < 9; ++k) second_beside_fixes(drive, 0.0, 1.0);
  EXPECT_TRUE(contains(drive.source.complaint(), "the fixes 1.0 m/s: a dead encoder?")) << drive.source.complaint();
  EXPECT_NEAR(second_beside_fixes(drive, 0.0, 1.0), 1.0, 0.05);
  EXPECT_GT(drive.source.doubt_m2(), 0.0);
  for (int k = 0; k < 7; ++k) {
    second_beside_fixes(drive, 1.0, 1.0);
    EXPECT_NE(drive.source.complaint(), "") << k;
  }
  for (int k = 0; k < 4; ++k) second_beside_fixes(drive, 1.0, 1.0);
  EXPECT_EQ(drive.source.complaint(), "") << "after 6 s of agreement, and 3 s that the means need";
}

TEST(SpeedSource, FixesThatScatterTellNothing) {
  Drive drive;
  for (int k = 0; k < 60; ++k) {
    EXPECT_EQ(second_beside_fixes(drive, 1.0, 3.0, 0.6), 1.0) << "a reflection";
    EXPECT_EQ(drive.source.complaint(), "");
  }
  for (int k = 0; k < 10; ++k) second_beside_fixes(drive, 0.447, 1.0);
  ASSERT_NE(drive.source.complaint(), "");
  for (int k = 0; k < 20; ++k) second_beside_fixes(drive, 0.447, 0.447, 0.3);
  EXPECT_NE(drive.source.complaint(), "") << "nor do they end a fault";
}

TEST(SpeedSource, OdometryIsComparedByItsMeanOverTheTimeOfTheFixes) {
  Drive drive;
  for (int k = 0; k < 60; ++k) {
    for (int i = 0; i < 10; ++i) drive.step(i % 2 * 2.0);
    drive.source.compare({from_seconds(kStep_s * drive.steps), 1.0, 1.0, 0.1, 3.0}, drive.events);
    EXPECT_EQ(drive.source.complaint(), "");
  }
}

}  // namespace
}  // namespace urban_gnss
