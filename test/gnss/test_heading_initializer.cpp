#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include "urban_gnss_localization/gnss/heading_initializer.hpp"

namespace urban_gnss {
namespace {

/// A robot that drives an arc at 1 m/s with a fix each second.
struct Drive {
  Pose2 map_from_odometry{};
  double sigma{1.0};           ///< m, of the fixes, per axis
  double declared_sigma{1.0};  ///< m
  double turn_rate{0.03};      ///< rad/s
  double speed{1.0};           ///< m/s

  Pose2 odometry(int second) const {
    const double yaw = turn_rate * second;
    return {speed / turn_rate * std::sin(yaw) + 40.0, speed / turn_rate * (1.0 - std::cos(yaw)) - 7.0, wrap_angle(yaw)};
  }
  Pose2 truth(int second) const { return compose(map_from_odometry, odometry(second)); }
  LocalFix fix(int second, std::mt19937_64& generator) const {
    std::normal_distribution<double> normal;
    LocalFix result;
    result.stamp = from_seconds(1000.0 + second);
    const double east = sigma * normal(generator);
    const double north = sigma * normal(generator);
    result.position = truth(second).position() + Eigen::Vector2d(east, north);
    result.covariance = declared_sigma * declared_sigma * Eigen::Matrix2d::Identity();
    return result;
  }
};

Eigen::Vector3d error(const Pose2& estimate, const Pose2& truth) {
  return {estimate.x - truth.x, estimate.y - truth.y, angle_difference(estimate.yaw, truth.yaw)};
}

double squared_mahalanobis(const PoseEstimate& estimate, const Pose2& truth) {
  const Eigen::Vector3d difference = error(estimate.pose, truth);
  return difference.dot(estimate.covariance.ldlt().solve(difference));
}

Pose2 random_pose(std::mt19937_64& generator) {
  std::uniform_real_distribution<double> angle(-kPi, kPi);
  std::uniform_real_distribution<double> place(-500.0, 500.0);
  const double x = place(generator);
  const double y = place(generator);
  return {x, y, angle(generator)};
}

TEST(HeadingInitializer, RecoversAnyPoseWithoutNoise) {
  for (double yaw = -3.1; yaw < 3.14; yaw += 0.4) {
    Drive drive;
    drive.map_from_odometry = {100.0, -200.0, yaw};
    drive.sigma = 0.0;
    std::mt19937_64 generator(1);
    HeadingInitializer initializer({});
    for (int second = 0; second < 30; ++second) {
      initializer.add(drive.odometry(second), drive.fix(second, generator));
    }
    const auto estimate = initializer.estimate();
    ASSERT_TRUE(estimate) << initializer.waiting_for();
    EXPECT_LT(error(estimate->pose, drive.truth(29)).norm(), 1e-9);
    EXPECT_EQ(initializer.waiting_for(), "");
  }
}

/// For drives whose fixes have independent errors and whose odometry is exact.
HeadingInitializerParameters independent() {
  HeadingInitializerParameters parameters;
  parameters.initialization_heading_walk = 0.0;
  parameters.fix_errors = {0.0, 0.0};
  return parameters;
}

// 300 runs, each examined at its first estimate: the moment at which a localizer starts from it.
TEST(HeadingInitializer, FirstEstimateIsConsistentOverSeeds) {
  constexpr int kRuns = 300;
  double nees_sum = 0.0;
  int beyond_three_sigma = 0;
  for (int run = 0; run < kRuns; ++run) {
    std::mt19937_64 generator(run);
    Drive drive;
    drive.map_from_odometry = random_pose(generator);
    drive.turn_rate = run % 2 == 0 ? 0.03 : -0.005;
    HeadingInitializer initializer(independent());
    bool found = false;
    for (int second = 0; second < 60 && !found; ++second) {
      initializer.add(drive.odometry(second), drive.fix(second, generator));
      const auto estimate = initializer.estimate();
      if (!estimate) continue;
      found = true;
      const double yaw_error = error(estimate->pose, drive.truth(second)).z();
      if (std::abs(yaw_error) > 3.0 * std::sqrt(estimate->covariance(2, 2))) ++beyond_three_sigma;
      EXPECT_LT(std::sqrt(estimate->covariance(2, 2)), 0.2);
      EXPECT_LT(std::abs(yaw_error), 1.0) << run;
      nees_sum += squared_mahalanobis(*estimate, drive.truth(second));
    }
    EXPECT_TRUE(found) << initializer.waiting_for();
  }
  EXPECT_LE(beyond_three_sigma, 5);  // 0.27 % of 300 is 0.8; more than 5 has a probability below 0.001
  // The mean of 300 NEES with 3 degrees of freedom is within [2.57, 3.46] with 99.9 %. The first estimate waits for
  // the larger of declared and residual noise, which makes it a little more cautious than that.
  EXPECT_LT(nees_sum / kRuns, 3.46);
  EXPECT_GT(nees_sum / kRuns, 2.0);
}

// Errors that last, as those of real fixes do: taken as independent, the heading would be surer than it is.
TEST(HeadingInitializer, ErrorsThatLastAreInTheCovariance) {
  const auto nees_with = [](const HeadingInitializerParameters& parameters) {
    constexpr int kRuns = 200;
    constexpr double kSigma_m = 2.0;
    double sum = 0.0;
    int found = 0;
    for (int run = 0; run < kRuns; ++run) {
      std::mt19937_64 generator(run);
      std::normal_distribution<double> normal;
      Drive drive;
      drive.map_from_odometry = random_pose(generator);
      drive.sigma = 0.0;
      drive.declared_sigma = kSigma_m;
      HeadingInitializer initializer(parameters);
      const double kept = std::exp(-1.0 / 15.0 - 1.0 / 40.0);  // 1 m and 1 s from fix to fix
      Eigen::Vector2d lasting(kSigma_m * normal(generator), kSigma_m * normal(generator));
      for (int second = 0; second < 60; ++second) {
        const double fresh = kSigma_m * std::sqrt(1.0 - kept * kept);
        lasting = kept * lasting + Eigen::Vector2d(fresh * normal(generator), fresh * normal(generator));
        LocalFix fix = drive.fix(second, generator);
        fix.position += lasting;
        initializer.add(drive.odometry(second), fix);
      }
      const auto estimate = initializer.estimate();
      if (!estimate) continue;
      ++found;
      const double yaw_error = error(estimate->pose, drive.truth(59)).z();
      sum += yaw_error * yaw_error / estimate->covariance(2, 2);
    }
    EXPECT_GT(found, kRuns / 2);
    return sum / found;
  };
  HeadingInitializerParameters lasting = independent();
  lasting.fix_errors = HeadingInitializerParameters{}.fix_errors;
  EXPECT_LT(nees_with(lasting), 1.6);
  EXPECT_GT(nees_with(independent()), 2.5);
}

TEST(HeadingInitializer, OneSpikeOf1600MetresDoesNotSpoilIt) {
  for (int spike = 0; spike < 20; ++spike) {
    for (const double direction : {0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0}) {
      std::mt19937_64 generator(spike);
      Drive drive;
      drive.map_from_odometry = {10.0, 20.0, 2.5};
      HeadingInitializer initializer(independent());
      for (int second = 0; second < 20; ++second) {
        LocalFix fix = drive.fix(second, generator);
        if (second == spike) fix.position += 1600.0 * Eigen::Vector2d(std::cos(direction), std::sin(direction));
        initializer.add(drive.odometry(second), fix);
      }
      const auto estimate = initializer.estimate();
      ASSERT_TRUE(estimate) << spike << ' ' << direction << ' ' << initializer.waiting_for();
      EXPECT_LT(squared_mahalanobis(*estimate, drive.truth(19)), 16.3);  // 99.9 %, 3 degrees of freedom
      EXPECT_LT(error(estimate->pose, drive.truth(19)).head<2>().norm(), 3.0);
      // Nor does it spoil the start without a heading.
      const PoseEstimate without = initializer.without_heading();
      EXPECT_LT(error(without.pose, drive.truth(19)).head<2>().norm(), 6.0) << spike << ' ' << direction;
    }
  }
}

// Every third fix comes by the same reflection, from 60 m aside: too many for least squares with one rejection to cope.
TEST(HeadingInitializer, ReflectedThirdOfTheFixesDoesNotSpoilIt) {
  int beyond = 0;
  for (int run = 0; run < 100; ++run) {
    std::mt19937_64 generator(run);
    Drive drive;
    drive.map_from_odometry = random_pose(generator);
    HeadingInitializer initializer({});
    for (int second = 0; second < 30; ++second) {
      LocalFix fix = drive.fix(second, generator);
      if (second >= 10 && second < 20) fix.position += Eigen::Vector2d(36.0, -48.0);
      initializer.add(drive.odometry(second), fix);
    }
    const auto estimate = initializer.estimate();
    ASSERT_TRUE(estimate) << run << ' ' << initializer.waiting_for();
    if (squared_mahalanobis(*estimate, drive.truth(29)) > 16.3) ++beyond;  // 99.9 %, 3 degrees of freedom
  }
  EXPECT_LE(beyond, 2);
}

TEST(HeadingInitializer, StartWithoutAHeadingCoversTheWaySinceTheLastAgreeingFix) {
  std::mt19937_64 generator(4);
  Drive drive;
  drive.speed = 3.0;
  HeadingInitializerParameters parameters;
  parameters.initialization_heading_sigma = 0.001;
  HeadingInitializer initializer(parameters);
  for (int second = 0; second < 12; ++second) {
    LocalFix fix = drive.fix(second, generator);
    if (second >= 10) fix.position.x() += 1600.0;
    initializer.add(drive.odometry(second), fix);
  }
  const PoseEstimate start = initializer.without_heading();
  EXPECT_LT((start.pose.position() - drive.truth(9).position()).norm(), 4.0);
  EXPECT_NEAR(start.covariance(0, 0), 1.0 + 6.0 * 6.0, 0.1);
  EXPECT_NEAR(start.covariance(1, 1), 1.0 + 6.0 * 6.0, 0.1);
}

TEST(HeadingInitializer, NoiseAboveTheDeclaredWidensTheCovariance) {
  double nees_sum = 0.0;
  for (int run = 0; run < 100; ++run) {
    std::mt19937_64 generator(run);
    Drive drive;
    drive.map_from_odometry = random_pose(generator);
    drive.sigma = 4.0;
    drive.turn_rate = 0.01;
    HeadingInitializer initializer({});
    for (int second = 0; second < 60; ++second) {
      initializer.add(drive.odometry(second), drive.fix(second, generator));
    }
    const auto estimate = initializer.estimate();
    ASSERT_TRUE(estimate) << initializer.waiting_for();
    nees_sum += squared_mahalanobis(*estimate, drive.truth(59));
  }
  EXPECT_LT(nees_sum / 100.0, 4.0);  // 48 if the declared noise were believed
}

TEST(HeadingInitializer, PoorFixesWeighLessThanGoodOnes) {
  std::mt19937_64 generator(3);
  Drive good;
  good.map_from_odometry = {0.0, 0.0, -1.0};
  good.sigma = good.declared_sigma = 0.3;
  Drive poor = good;
  poor.sigma = poor.declared_sigma = 50.0;
  HeadingInitializer initializer({});
  for (int second = 0; second < 40; ++second) {
    const Drive& drive = second % 2 == 0 ? good : poor;
    initializer.add(drive.odometry(second), drive.fix(second, generator));
  }
  const auto estimate = initializer.estimate();
  ASSERT_TRUE(estimate) << initializer.waiting_for();
  EXPECT_LT(error(estimate->pose, good.truth(39)).norm(), 0.5);
}

TEST(HeadingInitializer, ParkedNeverConvergesButTimesOut) {
  std::mt19937_64 generator(5);
  std::normal_distribution<double> jitter(0.0, 0.05);  // m, of a scan matcher: 75 m of "path" in ten minutes
  Drive drive;
  drive.map_from_odometry = {300.0, 100.0, 1.0};
  drive.speed = 0.0;
  HeadingInitializer initializer({});
  EXPECT_FALSE(initializer.timed_out());
  for (int second = 0; second <= 600; ++second) {
    Pose2 odometry = drive.odometry(second);
    odometry.x += jitter(generator);
    odometry.y += jitter(generator);
    initializer.add(odometry, drive.fix(second, generator));
    ASSERT_FALSE(initializer.estimate());
    ASSERT_EQ(initializer.timed_out(), second >= 60);
  }
  EXPECT_NE(initializer.waiting_for().find("moved"), std::string::npos) << initializer.waiting_for();
  const PoseEstimate start = initializer.without_heading();
  EXPECT_LT((start.pose.position() - drive.truth(600).position()).norm(), 4.0);
  EXPECT_NEAR(start.covariance(2, 2), kPi * kPi / 3.0, 1e-12);
  EXPECT_GE(start.covariance(0, 0), 1.0);
}

TEST(HeadingInitializer, NeedsFourFixesAndAWayOfTwoSigma) {
  std::mt19937_64 generator(7);
  Drive drive;
  drive.sigma = 0.0;
  drive.declared_sigma = 3.0;
  drive.turn_rate = 0.001;
  HeadingInitializerParameters parameters = independent();
  parameters.initialization_heading_sigma = 1.0;
  HeadingInitializer initializer(parameters);
  int second = 0;
  for (; second < 3; ++second) initializer.add(drive.odometry(10 * second), drive.fix(10 * second, generator));
  EXPECT_FALSE(initializer.estimate());
  EXPECT_EQ(initializer.waiting_for(), "heading: fewer than 4 agreeing fixes");
  initializer.add(drive.odometry(30), drive.fix(30, generator));
  EXPECT_TRUE(initializer.estimate()) << initializer.waiting_for();

  initializer.reset();
  for (second = 0; second <= 6; ++second) initializer.add(drive.odometry(second), drive.fix(second, generator));
  EXPECT_FALSE(initializer.estimate());  // 6.0 m is not more than 2 sigma
  EXPECT_EQ(initializer.waiting_for(), "heading: moved 6.0 of 6.0 m");
  initializer.add(drive.odometry(7), drive.fix(7, generator));
  EXPECT_TRUE(initializer.estimate()) << initializer.waiting_for();
}

TEST(HeadingInitializer, EveryParameterHasAnEffect) {
  std::mt19937_64 generator(9);
  Drive drive;
  std::vector<LocalFix> fixes;
  for (int second = 0; second < 40; ++second) fixes.push_back(drive.fix(second, generator));
  const auto fed = [&](const HeadingInitializerParameters& parameters) {
    HeadingInitializer initializer(parameters);
    for (int second = 0; second < 40; ++second) initializer.add(drive.odometry(second), fixes[second]);
    return initializer;
  };
  HeadingInitializerParameters parameters;
  ASSERT_TRUE(fed(parameters).estimate());
  EXPECT_FALSE(fed(parameters).timed_out());
  parameters.initialization_timeout = 30.0;
  EXPECT_TRUE(fed(parameters).timed_out());
  parameters.initialization_heading_sigma = 0.001;
  EXPECT_FALSE(fed(parameters).estimate());
  EXPECT_NE(fed(parameters).waiting_for().find("needed 0.00"), std::string::npos) << fed(parameters).waiting_for();
  HeadingInitializerParameters brief;
  brief.initialization_window = 10.0;
  EXPECT_GT(fed(brief).estimate().value_or(PoseEstimate{{}, 9.0 * Eigen::Matrix3d::Identity()}).covariance(2, 2),
            3.0 * fed({}).estimate()->covariance(2, 2));
}

TEST(HeadingInitializer, ResetForgetsEverything) {
  std::mt19937_64 generator(11);
  Drive drive;
  HeadingInitializer initializer({});
  EXPECT_THROW(initializer.without_heading(), std::logic_error);
  for (int second = 0; second < 100; ++second) initializer.add(drive.odometry(second), drive.fix(second, generator));
  EXPECT_TRUE(initializer.estimate());
  EXPECT_TRUE(initializer.timed_out());
  initializer.reset();
  EXPECT_FALSE(initializer.estimate());
  EXPECT_FALSE(initializer.timed_out());
  EXPECT_THROW(initializer.without_heading(), std::logic_error);
  initializer.add(drive.odometry(0), drive.fix(0, generator));  // an older stamp than before the reset
  EXPECT_NO_THROW(initializer.without_heading());
  initializer.reset();
  initializer.add(drive.odometry(500), drive.fix(500, generator));
  EXPECT_FALSE(initializer.timed_out());
}

TEST(HeadingInitializer, BadInputIsIgnored) {
  std::mt19937_64 generator(13);
  Drive drive;
  HeadingInitializer initializer({});
  for (int second = 0; second < 20; ++second) initializer.add(drive.odometry(second), drive.fix(second, generator));
  const auto before = initializer.estimate();
  ASSERT_TRUE(before);
  const LocalFix good = drive.fix(21, generator);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    initializer.add({bad, 0.0, 0.0}, good);
    initializer.add({0.0, 0.0, bad}, good);
    LocalFix fix = good;
    fix.position.x() = bad;
    initializer.add(drive.odometry(21), fix);
    fix = good;
    fix.covariance(0, 0) = bad;
    initializer.add(drive.odometry(21), fix);
  }
  initializer.add({1e300, 0.0, 0.0}, good);
  LocalFix zero = good;
  zero.covariance.setZero();
  initializer.add(drive.odometry(21), zero);
  initializer.add(drive.odometry(19), drive.fix(19, generator));  // a stamp that is known
  initializer.add(drive.odometry(5), drive.fix(5, generator));    // an old one
  const auto after = initializer.estimate();
  ASSERT_TRUE(after);
  EXPECT_EQ(after->pose.x, before->pose.x);
  EXPECT_EQ(after->covariance, before->covariance);
}

}  // namespace
}  // namespace urban_gnss
