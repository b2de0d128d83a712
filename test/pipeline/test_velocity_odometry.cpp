#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/pipeline/velocity_odometry.hpp"

namespace urban_gnss {
namespace {

using ::testing::IsEmpty;

RawVelocity velocity(double time, double east, double north, double sigma = 0.05) {
  RawVelocity raw;
  raw.stamp = from_seconds(time);
  raw.velocity = {east, north};
  raw.covariance = Eigen::Matrix2d::Identity() * sigma * sigma;
  return raw;
}

std::vector<RawVelocity> circle(double speed, double yaw_rate, int seconds) {
  std::vector<RawVelocity> velocities;
  for (int t = 0; t <= seconds; ++t) {
    velocities.push_back(velocity(t, speed * std::cos(yaw_rate * t), speed * std::sin(yaw_rate * t)));
  }
  return velocities;
}

TEST(VelocityOdometry, FollowsACircle) {
  constexpr double kSpeed = 4.0, kYawRate = 0.2;
  const auto samples = odometry_of_velocities(circle(kSpeed, kYawRate, 60));
  ASSERT_EQ(samples.size(), 601U);
  double most = 0.0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    EXPECT_EQ(samples[i].stamp - samples[i - 1].stamp, from_seconds(0.1));
    const double angle = kYawRate * to_seconds(samples[i].stamp);
    const Eigen::Vector2d truth = kSpeed / kYawRate * Eigen::Vector2d(std::sin(angle), 1.0 - std::cos(angle));
    most = std::max(most, (Eigen::Vector2d(samples[i].pose.x, samples[i].pose.y) - truth).norm());
  }
  // A chord is shorter than its arc by the square of the angle between two velocities over 12: 0.8 m in 240 m.
  EXPECT_LT(most, 1.0);
  EXPECT_NEAR(samples.back().pose.yaw, wrap_angle(kYawRate * 60.0), 0.01);
}

TEST(VelocityOdometry, TurnsOnTheSpotWhereTheCourseComesBackAnotherOne) {
  std::vector<RawVelocity> velocities;
  for (int t = 0; t <= 5; ++t) velocities.push_back(velocity(t, 2.0, 0.0));
  for (int t = 6; t <= 15; ++t) velocities.push_back(velocity(t, 0.02, -0.03));
  for (int t = 16; t <= 20; ++t) velocities.push_back(velocity(t, 0.0, 2.0));
  const auto samples = odometry_of_velocities(velocities);
  for (const OdometrySample& sample : samples) {
    const double time = to_seconds(sample.stamp);
    if (time > 6.1 && time < 15.0) {
      EXPECT_EQ(sample.twist.speed_mps, 0.0) << time;
    }
    EXPECT_LT(std::abs(sample.twist.yaw_rate_radps), 0.5);
  }
  EXPECT_NEAR(samples.back().pose.yaw, 0.5 * kPi, 1e-6);
}

TEST(VelocityOdometry, NoiseAtAStandstillIsNoMotion) {
  std::vector<RawVelocity> velocities;
  for (int t = 0; t < 20; ++t)
    velocities.push_back(velocity(t, 0.4 * std::cos(3.0 * t), 0.4 * std::sin(2.0 * t), 0.36));
  for (const OdometrySample& sample : odometry_of_velocities(velocities)) {
    EXPECT_EQ(sample.twist.speed_mps, 0.0);
    EXPECT_EQ(sample.twist.yaw_rate_radps, 0.0);
  }
}

TEST(VelocityOdometry, DoesNotBridgeGaps) {
  const std::vector<RawVelocity> velocities = {velocity(0, 1, 0), velocity(1, 1, 0), velocity(1, 9, 9),
                                               velocity(4, 1, 0), velocity(5, 1, 0)};
  const auto samples = odometry_of_velocities(velocities);
  ASSERT_EQ(samples.size(), 22U);
  EXPECT_EQ(samples[10].stamp, from_seconds(1.0));
  EXPECT_EQ(samples[11].stamp, from_seconds(4.0));
  EXPECT_THAT(odometry_of_velocities({}), IsEmpty());
  EXPECT_THAT(odometry_of_velocities({velocity(0, 1, 0)}), IsEmpty());
}

TEST(VelocityOdometry, FixesTellTheVelocityOfAReceiverWithoutOne) {
  const LocalFrame frame({48.0, 11.0, 500.0});
  std::vector<RawFix> fixes;
  for (int t = 0; t <= 20; ++t) {
    RawFix fix;
    fix.stamp = from_seconds(t);
    fix.position = frame.to_geodetic({3.0 * t, -1.0 * t, 0.0});
    fix.has_fix = t != 10;
    if (t == 11) fix.position.latitude_deg = 1000.0;
    fixes.push_back(fix);
  }
  const auto velocities = velocities_of_fixes(fixes);
  ASSERT_EQ(velocities.size(), 19U);
  for (const RawVelocity& each : velocities) {
    EXPECT_NEAR((each.velocity - Eigen::Vector2d(3.0, -1.0)).norm(), 0.0, 1e-3);
    EXPECT_GE(each.covariance(0, 0), 0.4);
  }
  EXPECT_THAT(velocities_of_fixes({}), IsEmpty());
}

}  // namespace
}  // namespace urban_gnss
