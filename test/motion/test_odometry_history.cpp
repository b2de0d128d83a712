#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "matchers.hpp"
#include "urban_gnss_localization/motion/odometry_history.hpp"

namespace urban_gnss {
namespace {

constexpr Twist2 kTwists[] = {{0.0, 0.0}, {2.0, 0.5}, {1.0, -1.0}, {3.0, 0.0}, {-1.0, 2.0}};

/// Messages at 100 s, 101 s, ...: each twist holds for the second before its message.
OdometryHistory five_seconds() {
  OdometryHistory history;
  for (int i = 0; i < 5; ++i) history.add(from_seconds(100.0 + i), kTwists[i]);
  return history;
}

/// Where constant twists lead: an independent integration in 20 000 straight pieces a second.
Pose2 integrated(double until) {
  constexpr int kPieces = 20000;
  Pose2 pose;
  for (int i = 1; i < 5; ++i) {
    const double length = std::min(1.0, until - (99.0 + i));
    if (length <= 0.0) break;
    const double dt = length / kPieces;
    for (int k = 0; k < kPieces; ++k) {
      const double middle = pose.yaw + 0.5 * kTwists[i].yaw_rate_radps * dt;
      pose.x += kTwists[i].speed_mps * dt * std::cos(middle);
      pose.y += kTwists[i].speed_mps * dt * std::sin(middle);
      pose.yaw += kTwists[i].yaw_rate_radps * dt;
    }
  }
  return pose;
}

TEST(OdometryHistory, InterpolatesExactlyOnTheArcs) {
  const OdometryHistory history = five_seconds();
  for (const double time : {100.0, 100.3, 101.0, 101.5, 102.999, 103.2, 104.0}) {
    const auto pose = history.pose_at(from_seconds(time));
    ASSERT_TRUE(pose) << time;
    EXPECT_TRUE(near(*pose, integrated(time), 1e-8)) << time;  // the pieces leave dt^2 * omega^2 / 24 of the way
  }
}

TEST(OdometryHistory, TwistIsThatOfTheStepThatHoldsTheStamp) {
  const OdometryHistory history = five_seconds();
  const auto expect = [&](double time, int step) {
    const auto twist = history.twist_at(from_seconds(time));
    ASSERT_TRUE(twist) << time;
    EXPECT_EQ(twist->speed_mps, kTwists[step].speed_mps) << time;
    EXPECT_EQ(twist->yaw_rate_radps, kTwists[step].yaw_rate_radps) << time;
  };
  expect(100.0, 0);
  expect(100.001, 1);
  expect(101.0, 1);
  expect(101.001, 2);
  expect(103.5, 4);
  expect(104.0, 4);
}

TEST(OdometryHistory, NothingOutsideOfItsTime) {
  const OdometryHistory history = five_seconds();
  EXPECT_FALSE(history.twist_at(from_seconds(100.0) - Stamp(1)));
  EXPECT_FALSE(history.twist_at(from_seconds(104.0) + Stamp(1)));
  EXPECT_FALSE(OdometryHistory().twist_at(Stamp(0)));
  EXPECT_FALSE(history.pose_at(from_seconds(100.0) - Stamp(1)));
  EXPECT_FALSE(history.pose_at(from_seconds(104.0) + Stamp(1)));
  EXPECT_TRUE(history.pose_at(from_seconds(104.0)));
  EXPECT_FALSE(history.motion_between(from_seconds(99.0), from_seconds(102.0)));
  EXPECT_FALSE(history.motion_between(from_seconds(102.0), from_seconds(105.0)));
  EXPECT_FALSE(OdometryHistory().pose_at(Stamp(0)));
}

TEST(OdometryHistory, MotionBetweenComposesAndInverts) {
  const OdometryHistory history = five_seconds();
  const Stamp a = from_seconds(100.7), b = from_seconds(102.2), c = from_seconds(103.9);
  const Pose2 ab = *history.motion_between(a, b);
  const Pose2 bc = *history.motion_between(b, c);
  EXPECT_TRUE(near(compose(ab, bc), *history.motion_between(a, c), 1e-14));
  EXPECT_TRUE(near(*history.motion_between(c, a), inverse(*history.motion_between(a, c)), 1e-14));
  EXPECT_TRUE(near(compose(*history.pose_at(a), ab), *history.pose_at(b), 1e-14));
  EXPECT_TRUE(near(*history.motion_between(b, b), {}, 1e-15));
  // In the robot's frame: one second straight ahead is one second straight ahead, whatever the heading.
  EXPECT_TRUE(near(*history.motion_between(from_seconds(102.0), from_seconds(103.0)), {3.0, 0.0, 0.0}, 1e-14));
}

TEST(OdometryHistory, KeepsItsWindowAndNotMuchMore) {
  OdometryHistory history(2.0);
  for (int i = 0; i <= 100; ++i) history.add(from_seconds(0.3 * i), {1.0, 0.0});
  const Stamp latest = from_seconds(30.0);
  EXPECT_EQ(history.latest(), latest);
  ASSERT_TRUE(history.motion_between(latest - from_seconds(2.0), latest));
  EXPECT_NEAR(history.motion_between(latest - from_seconds(2.0), latest)->x, 2.0, 1e-12);
  EXPECT_GE(history.oldest(), latest - from_seconds(2.0 + 2.0 * 0.3));
  history.clear();
  EXPECT_TRUE(history.empty());
  history.add(from_seconds(1.0), {1.0, 0.0});  // older than before: a new path
  EXPECT_TRUE(history.pose_at(from_seconds(1.0)));
}

TEST(OdometryHistory, NoFieldOfAMessageMayBeAbsurd) {
  const OdometrySample good{from_seconds(1.0), {1.0, 2.0, 3.0}, {5.0, 1.0}};
  EXPECT_EQ(odometry_fault(good), "");
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), -1e300}) {
    for (int field = 0; field < 5; ++field) {
      OdometrySample sample = good;
      double* const fields[] = {&sample.pose.x, &sample.pose.y, &sample.twist.speed_mps, &sample.twist.yaw_rate_radps,
                                &sample.pose.yaw};
      *fields[field] = bad;
      if (field == 4 && std::isfinite(bad)) continue;  // any finite yaw is an angle
      EXPECT_NE(odometry_fault(sample), "") << field << ' ' << bad;
    }
  }
}

TEST(OdometryFault, AllowsThePaperSharpestTurn) {
  // 10 m/s with the steering at its limit of 1.2 rad on a wheelbase of 1 m.
  EXPECT_EQ(odometry_fault({Stamp(0), {}, {10.0, 10.0 * std::tan(1.2)}}), "");
  EXPECT_NE(odometry_fault({Stamp(0), {}, {10.0, 1e3}}), "");
}

}  // namespace
}  // namespace urban_gnss
