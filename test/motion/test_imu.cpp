// How an IMU is mounted, whether it tells the robot's yaw rate, and by which clock.

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/motion/imu_mounting_check.hpp"
#include "urban_gnss_localization/motion/rate_lag.hpp"

namespace urban_gnss {
namespace {

const Eigen::Vector3d kUp(0.0, 0.0, 1.0);

Eigen::Quaterniond turned(double roll, double pitch, double yaw) {
  return Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
}

/// What an IMU that is mounted like this says of a robot on level ground that turns by `yaw_rate_radps`.
ImuSample sample_of(const Eigen::Quaterniond& base_from_imu, double yaw_rate_radps, bool with_gravity, double time_s) {
  ImuSample sample;
  sample.stamp = from_seconds(time_s);
  sample.rate_radps = base_from_imu.inverse() * (yaw_rate_radps * kUp);
  if (with_gravity) sample.acceleration_mps2 = base_from_imu.inverse() * (9.81 * kUp);
  return sample;
}

const Eigen::Quaterniond kMountings[] = {
    turned(0.0, 0.0, 0.0),       turned(kPi, 0.0, 0.0),  turned(0.0, kPi, 1.0),       turned(0.5 * kPi, 0.0, 0.0),
    turned(0.0, 0.5 * kPi, 0.3), turned(0.3, -0.2, 2.0), turned(-0.5 * kPi, 0.1, 0.0)};

TEST(ImuLeveller, TurnsTheRateByTfOrByItsOrientation) {
  for (const Eigen::Quaterniond& mounting : kMountings) {
    ImuLeveller by_tf;
    by_tf.set_mounting(mounting);
    EXPECT_NEAR(by_tf.yaw_rate(sample_of(mounting, 0.4, false, 1.0)).told_radps, 0.4, 1e-12);
    ImuLeveller by_orientation;
    by_orientation.set_mounting(turned(1.0, 1.0, 1.0));  // of which the message knows better
    for (const double heading : {0.3, 2.0}) {
      ImuSample sample = sample_of(mounting, 0.4, false, 1.0);
      sample.orientation = turned(0.0, 0.0, heading) * mounting;
      EXPECT_NEAR(by_orientation.yaw_rate(sample).told_radps, 0.4, 1e-12);
    }
  }
}

TEST(ImuLeveller, AnOrientationThatWasNeverFilledInDoesNotHideTheMounting) {
  ImuLeveller leveller;
  leveller.set_mounting(turned(kPi, 0.0, 0.0));
  ImuSample sample = sample_of(turned(kPi, 0.0, 0.0), 0.4, false, 1.0);
  sample.orientation = Eigen::Quaterniond::Identity();
  EXPECT_NEAR(leveller.yaw_rate(sample).told_radps, 0.4, 1e-12);
}

TEST(ImuLeveller, HeadingIsThatOfTheBase) {
  for (const Eigen::Quaterniond& mounting : kMountings) {
    ImuLeveller leveller;
    leveller.set_mounting(mounting);
    for (const double heading : {0.3, 2.0, -3.0}) {
      ImuSample sample;
      sample.orientation = turned(0.0, 0.0, heading) * mounting;
      sample.heading_sigma_rad = 0.1;
      ASSERT_TRUE(leveller.heading(sample));
      EXPECT_NEAR(angle_difference(leveller.heading(sample)->yaw_rad, heading), 0.0, 1e-9);
      EXPECT_EQ(leveller.heading(sample)->sigma_rad, 0.1);
    }
  }
}

TEST(ImuLeveller, WithoutAnOrientationThereIsNoHeading) {
  const ImuLeveller leveller;
  ImuSample sample;
  EXPECT_FALSE(leveller.heading(sample));
  sample.orientation = Eigen::Quaterniond::Identity();
  EXPECT_FALSE(leveller.heading(sample)) << "never filled in";
  sample.orientation = turned(0.0, 0.5 * kPi, 0.0);
  EXPECT_FALSE(leveller.heading(sample)) << "the base's x axis points down";
}

TEST(ImuLeveller, GravityTellsTheAxisThatIsUp) {
  RandomEngine engine = make_engine(1);
  for (const Eigen::Quaterniond& mounting : kMountings) {
    ImuLeveller leveller;
    ImuYawRate rate;
    for (int k = 0; k <= 2000; ++k) {
      ImuSample sample = sample_of(mounting, 0.4, true, 0.01 * k);
      for (int axis = 0; axis < 3; ++axis) sample.acceleration_mps2[axis] += 2.0 * draw_normal(engine);
      rate = leveller.yaw_rate(sample);
    }
    ASSERT_TRUE(rate.by_gravity_radps);
    EXPECT_NEAR(*rate.by_gravity_radps, 0.4, 0.01);
  }
  ImuLeveller without;
  EXPECT_FALSE(without.yaw_rate(sample_of(turned(0.0, 0.0, 0.0), 0.4, false, 1.0)).by_gravity_radps);
}

struct Turning {
  ImuVerdict verdict;
  double decided_s;
};

/// Turns left and right at 20 Hz; when the verdict came.
Turning turn(const Eigen::Quaterniond& mounting, bool with_gravity, double unit, double odometry_factor = 1.0) {
  RandomEngine engine = make_engine(2);
  ImuLeveller leveller;
  ImuMountingCheck check;
  double decided_s = -1.0;
  for (int k = 0; k <= 1200; ++k) {
    const double rate = 0.4 * std::sin(0.01 * k);
    ImuSample sample = sample_of(mounting, unit * rate, with_gravity, 0.05 * k);
    for (int axis = 0; axis < 3; ++axis) sample.rate_radps[axis] += 0.01 * draw_normal(engine);
    if (check.add(odometry_factor * rate + 0.02 * draw_normal(engine), leveller.yaw_rate(sample), 0.05)) {
      decided_s = 0.05 * k;
    }
  }
  return {check.verdict(), decided_s};
}

TEST(ImuMountingCheck, DecidesWithinSecondsOfTurning) {
  const Eigen::Quaterniond upright = turned(0.0, 0.0, 0.0);
  const Eigen::Quaterniond upside_down = turned(kPi, 0.0, 0.0);
  const Eigen::Quaterniond on_its_side = turned(0.5 * kPi, 0.0, 0.0);
  const struct {
    Turning found;
    ImuVerdict expected;
  } cases[] = {{turn(upright, true, 1.0), ImuVerdict::kFits},
               {turn(upright, false, 1.0), ImuVerdict::kFits},
               {turn(upright, true, 1.0, 1.8), ImuVerdict::kFits},  // wheels that skid
               {turn(upside_down, false, 1.0), ImuVerdict::kReversed},
               {turn(upside_down, true, 1.0), ImuVerdict::kGravityFits},
               {turn(on_its_side, false, 1.0), ImuVerdict::kNotVertical},
               {turn(on_its_side, true, 1.0), ImuVerdict::kGravityFits},
               {turn(upright, true, 57.3), ImuVerdict::kDegrees},
               {turn(upright, false, -57.3), ImuVerdict::kDegrees},
               {turn(upright, false, 8.0), ImuVerdict::kScaled}};
  for (const auto& each : cases) {
    EXPECT_EQ(each.found.verdict, each.expected);
    EXPECT_LT(each.found.decided_s, 12.0);
    EXPECT_GT(each.found.decided_s, 0.0);
  }
}

TEST(ImuMountingCheck, OneThatFitsIsNotDoubtedWhereAWheelDies) {
  ImuMountingCheck check;
  for (int k = 0; k < 2000; ++k) check.add(0.3, {from_seconds(0.05 * k), k < 400 ? 0.3 : 0.0, {}, 0.01}, 0.05);
  EXPECT_EQ(check.verdict(), ImuVerdict::kFits);
}

TEST(ImuMountingCheck, AnImuThatHardlyMovesMayBeRightBesideWheelsThatSlip) {
  RandomEngine engine = make_engine(4);
  ImuMountingCheck noisy;
  ImuMountingCheck dead;
  for (int k = 0; k < 2000; ++k) {
    const double noise = 0.01 * draw_normal(engine);
    noisy.add(0.3, {from_seconds(0.05 * k), noise, {}, std::abs(noise)}, 0.05);
    dead.add(0.3, {from_seconds(0.05 * k), 0.0, {}, 0.0}, 0.05);
  }
  EXPECT_EQ(noisy.verdict(), ImuVerdict::kUnknown);
  EXPECT_EQ(dead.verdict(), ImuVerdict::kStill);
}

/// The lead that is found of an IMU whose clock is ahead by `lead_s`, and when.
std::pair<std::optional<double>, double> find_lead(double lead_s, double unit, double period_s) {
  RandomEngine engine = make_engine(5);
  const auto rate_at = [&](double time_s) {
    return 0.25 * std::sin(2.0 * kPi * time_s / period_s) + 0.2 * std::sin(2.0 * kPi * time_s / (0.37 * period_s));
  };
  std::vector<double> imu;  // at 50 Hz of its own clock
  for (int k = 0; k < 50 * 400; ++k) imu.push_back(unit * rate_at(0.02 * k - lead_s) + 0.01 * draw_normal(engine));
  RateLagSearch search;
  for (int k = 0; k < 20 * 300; ++k) {
    const double now_s = 0.05 * k;
    search.add(from_seconds(now_s), rate_at(now_s) + 0.02 * draw_normal(engine),
               [&](Stamp at) -> std::optional<double> {
                 const long i = std::lround(to_seconds(at) / 0.02);
                 const bool has_come = to_seconds(at) <= now_s + lead_s;
                 if (i < 0 || !has_come) return std::nullopt;
                 return imu[static_cast<std::size_t>(i)];
               });
    if (const auto found = search.lead_s()) return {found, now_s};
  }
  return {std::nullopt, 300.0};
}

TEST(RateLagSearch, FindsAClockThatIsAheadOrBehind) {
  for (const double lead_s : {-3.1, -1.0, -0.4, 0.5, 1.0, 3.1}) {
    for (const double unit : {1.0, -1.0}) {
      const auto [found, when_s] = find_lead(lead_s, unit, 40.0);
      ASSERT_TRUE(found) << lead_s;
      EXPECT_NEAR(*found, lead_s, 0.15);
      EXPECT_LT(when_s, 120.0);
    }
  }
}

TEST(RateLagSearch, SaysNothingOfClocksThatAgreeOrOfATurnThatIsEven) {
  EXPECT_FALSE(find_lead(0.0, 1.0, 40.0).first);
  EXPECT_FALSE(find_lead(0.05, 1.0, 40.0).first);
  RateLagSearch search;
  for (int k = 0; k < 6000; ++k) {
    search.add(from_seconds(0.05 * k), 0.3, [](Stamp) { return std::optional<double>(0.3); });
    EXPECT_FALSE(search.lead_s());
  }
}

}  // namespace
}  // namespace urban_gnss
