// The start's heading from velocities.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "matchers.hpp"
#include "urban_gnss_localization/gnss/heading_initializer.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"

namespace urban_gnss {
namespace {

/// A robot that drives an arc in an odometry frame that lies in the map at `frame`.
struct Drive {
  Pose2 frame{30.0, -20.0, 2.0};
  Twist2 twist{2.0, 0.05};
  double fix_sigma{5.0};        ///< m
  double velocity_sigma{0.2};   ///< m/s
  double declared{0.2};         ///< m/s
  double rate{1.0};             ///< Hz, of the velocities
  double outlier_share{0.0};    ///< off by 20 m/s
  double receiver_factor{1.0};  ///< on the speed that the receiver sees

  Pose2 odometry(double time) const { return move({3.0, 4.0, 0.5}, twist, time); }
  Pose2 truth(double time) const { return compose(frame, odometry(time)); }
  LocalFix fix(double time, RandomEngine& engine) const {
    LocalFix fix;
    fix.stamp = from_seconds(1000.0 + time);
    const double east = fix_sigma * draw_normal(engine);
    const double north = fix_sigma * draw_normal(engine);
    fix.position = truth(time).position() + Eigen::Vector2d(east, north);
    fix.covariance = isotropic(fix_sigma);
    return fix;
  }
  VelocityPair velocity(double time, RandomEngine& engine) const {
    const auto along = [&](double yaw) {
      return Eigen::Vector2d(twist.speed_mps * std::cos(yaw), twist.speed_mps * std::sin(yaw));
    };
    VelocityPair pair;
    pair.stamp = from_seconds(1000.0 + time);
    pair.odometry = along(odometry(time).yaw);
    const double east = velocity_sigma * draw_normal(engine);
    const double north = velocity_sigma * draw_normal(engine);
    pair.measured = receiver_factor * along(truth(time).yaw) + Eigen::Vector2d(east, north);
    if (draw_uniform(engine) < outlier_share) pair.measured += Eigen::Vector2d(-12.0, 16.0);
    pair.covariance = isotropic(declared);
    return pair;
  }
  HeadingInitializer after(double duration, std::uint64_t seed) const {
    RandomEngine engine = make_engine(seed);
    HeadingInitializer initializer({});
    for (int k = 0; k / rate <= duration; ++k) initializer.add_velocity(velocity(k / rate, engine));
    for (int k = 0; k <= duration; ++k) initializer.add(odometry(k), fix(k, engine));
    return initializer;
  }
};

TEST(HeadingInitializerVelocity, TellsTheHeadingWithoutHavingMovedFar) {
  Drive drive;
  drive.velocity_sigma = 0.0;
  for (double yaw = -3.0; yaw < 3.2; yaw += 0.5) {
    drive.frame.yaw = yaw;
    const auto estimate = drive.after(4.0, 1).estimate();
    ASSERT_TRUE(estimate) << drive.after(4.0, 1).waiting_for();
    EXPECT_LT(std::abs(angle_difference(estimate->pose.yaw, drive.truth(4.0).yaw)), 0.05);
    EXPECT_LT(std::sqrt(estimate->covariance(2, 2)), 0.2);
  }
}

TEST(HeadingInitializerVelocity, FirstEstimateIsConsistentOverSeeds) {
  for (const double rate : {1.0, 10.0}) {
    for (const double declared : {0.2, 0.05}) {  // honest; too small by a factor, which the residuals tell
      Drive drive;
      drive.rate = rate;
      drive.declared = declared;
      double nees = 0.0;
      int beyond = 0;
      constexpr int kRuns = 200;
      for (int run = 0; run < kRuns; ++run) {
        const auto estimate = drive.after(8.0, static_cast<std::uint64_t>(run)).estimate();
        ASSERT_TRUE(estimate) << run;
        const double error = angle_difference(estimate->pose.yaw, drive.truth(8.0).yaw);
        nees += error * error / estimate->covariance(2, 2);
        beyond += std::abs(error) > 3.0 * std::sqrt(estimate->covariance(2, 2));
      }
      EXPECT_LT(nees / kRuns, 1.3) << rate << ' ' << declared;  // correlated errors are allowed for, these are not
      EXPECT_LE(beyond, 4) << rate << ' ' << declared;
    }
  }
}

TEST(HeadingInitializerVelocity, AFifthOfOutliersDoesNotSpoilIt) {
  Drive drive;
  drive.outlier_share = 0.2;
  int spoilt = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const auto estimate = drive.after(15.0, seed).estimate();
    spoilt += !estimate || std::abs(angle_difference(estimate->pose.yaw, drive.truth(15.0).yaw)) > 0.3;
  }
  EXPECT_LE(spoilt, 1);
}

/// Of 100 parked robots, those that ever find a heading in their odometry's jitter (m/s) and a receiver's noise, which
/// is five times what it declares.
int fooled_by(double jitter) {
  const Drive drive;
  int fooled = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    RandomEngine engine = make_engine(seed);
    HeadingInitializer initializer({});
    bool found = false;
    for (int k = 0; k <= 50; ++k) {
      LocalFix fix = drive.fix(k, engine);
      fix.position -= drive.truth(k).position();
      initializer.add({}, fix);
      VelocityPair pair = drive.velocity(k, engine);
      pair.odometry = {jitter * draw_normal(engine), jitter * draw_normal(engine)};
      pair.measured = {draw_normal(engine), draw_normal(engine)};
      initializer.add_velocity(pair);
      found = found || initializer.estimate();
    }
    fooled += found;
  }
  return fooled;
}

TEST(HeadingInitializerVelocity, AParkedRobotsNoiseIsNoHeading) {
  EXPECT_EQ(fooled_by(0.05), 0);
  EXPECT_LE(fooled_by(1.0), 5);  // by chance: few velocities agree
}

TEST(HeadingInitializerVelocity, VelocitiesThatContradictTheOdometrysSpeedAreLeftOut) {
  Drive drive;
  EXPECT_TRUE(drive.after(5.0, 3).estimate());
  drive.receiver_factor = 0.4;
  EXPECT_FALSE(drive.after(5.0, 3).estimate());
}

TEST(HeadingInitializerVelocity, WithoutUsableOnesItIsAsItWas) {
  Drive drive;
  drive.fix_sigma = 1.0;
  RandomEngine engine = make_engine(9);
  HeadingInitializer plain({});
  HeadingInitializer with_bad({});
  for (int k = 0; k <= 30; ++k) {
    const LocalFix fix = drive.fix(k, engine);
    plain.add(drive.odometry(k), fix);
    with_bad.add(drive.odometry(k), fix);
    const VelocityPair good = drive.velocity(k, engine);
    for (const double bad :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e300}) {
      for (int field = 0; field < 3; ++field) {
        VelocityPair pair = good;
        double* const fields[] = {&pair.odometry.x(), &pair.measured.y(), &pair.covariance(0, 0)};
        if (field == 2 && std::isfinite(bad)) continue;  // such a variance is no fault
        *fields[field] = bad;
        with_bad.add_velocity(pair);
      }
    }
    VelocityPair slow = good;
    slow.odometry *= 0.1;
    with_bad.add_velocity(slow);
    slow = good;
    slow.covariance.setZero();
    with_bad.add_velocity(slow);
  }
  ASSERT_TRUE(plain.estimate() && with_bad.estimate());
  EXPECT_EQ(plain.estimate()->pose, with_bad.estimate()->pose);
  EXPECT_EQ(plain.estimate()->covariance, with_bad.estimate()->covariance);
}

TEST(HeadingInitializerVelocity, ForgetsThem) {
  Drive drive;
  RandomEngine engine = make_engine(2);
  HeadingInitializer initializer = drive.after(5.0, 3);
  ASSERT_TRUE(initializer.estimate());
  HeadingInitializer later = initializer;
  initializer.reset();
  for (int k = 6; k <= 10; ++k) {
    initializer.add(drive.odometry(6), drive.fix(6, engine));
    LocalFix fix = drive.fix(6, engine);
    fix.stamp = from_seconds(1000.0 + k);
    initializer.add(drive.odometry(6), fix);
  }
  EXPECT_FALSE(initializer.estimate());
  // A minute later, without having moved.
  for (int k = 0; k <= 5; ++k) {
    LocalFix fix = drive.fix(5, engine);
    fix.stamp = from_seconds(1066.0 + k);
    later.add(drive.odometry(5), fix);
  }
  EXPECT_FALSE(later.estimate());
}

}  // namespace
}  // namespace urban_gnss
