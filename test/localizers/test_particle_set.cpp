#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "matchers.hpp"
#include "urban_gnss_localization/localizers/particle_set.hpp"

namespace urban_gnss {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

double total(const ParticleSet& particles) {
  return std::accumulate(particles.weight.begin(), particles.weight.end(), 0.0);
}

TEST(ParticleSet, NormalisesWithoutUnderflow) {
  for (const float offset : {0.0F, -1e4F, 1e4F, -1e30F}) {
    ParticleSet particles(3);
    particles.log_weight = {offset, offset, offset};
    if (std::abs(offset) < 1e20F) {
      particles.log_weight = {offset + std::log(1.0F), offset + std::log(2.0F), offset + std::log(5.0F)};
      ASSERT_TRUE(particles.normalise());
      EXPECT_NEAR(particles.weight[2], 5.0 / 8.0, 5e-4);  // floats of 1e4 have a rounding of 5e-4
    } else {
      ASSERT_TRUE(particles.normalise());
    }
    EXPECT_NEAR(total(particles), 1.0, 3e-7);
  }
}

TEST(ParticleSet, NormalisingTwiceIsNormalisingOnce) {
  RandomEngine engine = make_engine(1);
  ParticleSet particles = random_particles(1000, engine);
  const ParticleSet before = particles;
  ASSERT_TRUE(particles.normalise());
  for (std::size_t i = 0; i < 1000; ++i) {
    EXPECT_NEAR(particles.log_weight[i], before.log_weight[i], 2e-6);  // floats of -7
    EXPECT_NEAR(std::exp(particles.log_weight[i]), particles.weight[i], 2e-6 * particles.weight[i]);
  }
}

TEST(ParticleSet, WeightsThatAreNoNumbersAreNone) {
  ParticleSet particles(5);
  particles.log_weight = {-kInfinity, kNaN, 0.0, -2000.0, 0.0};
  ASSERT_TRUE(particles.normalise());
  EXPECT_EQ(particles.weight, (std::vector<float>{0.0F, 0.0F, 0.5F, 0.0F, 0.5F}));
}

TEST(ParticleSet, WithoutAnyWeightAllAreEqual) {
  for (const float nothing : {-kInfinity, kNaN, kInfinity}) {
    ParticleSet particles(4);
    particles.log_weight.assign(4, nothing);
    EXPECT_FALSE(particles.normalise());
    EXPECT_EQ(particles.weight, std::vector<float>(4, 0.25F));
    EXPECT_TRUE(particles.normalise());
  }
}

TEST(ParticleSet, DrawsTheGaussianAskedFor) {
  RandomEngine engine = make_engine(2);
  PoseEstimate start;
  start.pose = {10.0, -20.0, 3.1};
  start.covariance << 4.0, 1.5, 0.1, 1.5, 2.0, -0.2, 0.1, -0.2, 0.09;
  ParticleSet particles(40000);
  particles.draw_gaussian(start, engine);
  // Whitened by an independent factorisation, the draws are three independent standard normals.
  const Eigen::Matrix3d lower = start.covariance.llt().matrixL();
  std::vector<double> whitened[3], products[3];
  for (std::size_t i = 0; i < particles.size(); ++i) {
    ASSERT_GE(particles.pose(i).yaw, -kPi);
    ASSERT_LT(particles.pose(i).yaw, kPi);
    const Pose2 pose = particles.pose(i);
    const Eigen::Vector3d offset(pose.x - 10.0, pose.y + 20.0, angle_difference(pose.yaw, 3.1));
    const Eigen::Vector3d white = lower.triangularView<Eigen::Lower>().solve(offset);
    for (int k = 0; k < 3; ++k) {
      whitened[k].push_back(white(k));
      products[k].push_back((white(k) + white((k + 1) % 3)) / std::sqrt(2.0));
    }
  }
  for (int k = 0; k < 3; ++k) {
    EXPECT_TRUE(has_moments(whitened[k], 0.0, 1.0)) << k;
    EXPECT_TRUE(has_moments(products[k], 0.0, 1.0)) << k;  // 1 plus the correlation
  }
}

TEST(ParticleSet, NewOriginChangesNoPlace) {
  RandomEngine engine = make_engine(5);
  ParticleSet particles(1000);
  particles.draw_gaussian(pose_with_sigma({10000.0, -20000.0, 1.0}, 3.0, 0.1), engine);
  EXPECT_EQ(particles.origin, Eigen::Vector2d(10000.0, -20000.0));
  const ParticleSet before = particles;
  particles.recentre({10010.0, -20010.0});
  EXPECT_EQ(particles.x, before.x);  // near enough
  for (const double nowhere : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    particles.recentre({nowhere, 0.0});
    EXPECT_EQ(particles.x, before.x);
  }
  particles.recentre({10020.0, -20000.0});
  EXPECT_EQ(particles.origin, Eigen::Vector2d(10020.0, -20000.0));
  for (std::size_t i = 0; i < 1000; ++i) ASSERT_TRUE(near(particles.pose(i), before.pose(i), 1e-6));  // floats of 30 m
}

TEST(ParticleSet, SingularCovarianceIsDrawnFrom) {
  RandomEngine engine = make_engine(3);
  ParticleSet particles(1000);
  particles.draw_gaussian(pose_with_sigma({1.0, 2.0, 3.0}, 0.0, 0.0), engine);
  for (std::size_t i = 0; i < 1000; ++i) ASSERT_TRUE(near(particles.pose(i), {1.0, 2.0, 3.0}, 1e-6));
  PoseEstimate line = pose_with_sigma({}, 1.0, 0.0);
  line.covariance(0, 1) = line.covariance(1, 0) = 1.0;  // x = y
  particles.draw_gaussian(line, engine);
  double largest = 0.0;
  for (std::size_t i = 0; i < 1000; ++i) {
    ASSERT_NEAR(particles.x[i], particles.y[i], 5e-7);  // floats of metres
    largest = std::max<double>(largest, std::abs(particles.x[i]));
  }
  EXPECT_GT(largest, 2.0);
}

TEST(ParticleSet, UnknownHeadingIsUniform) {
  RandomEngine engine = make_engine(4);
  ParticleSet particles(20000);
  particles.draw_gaussian(pose_with_sigma({}, 1.0, kPi / std::sqrt(3.0) + 1e-9), engine);
  std::sort(particles.yaw.begin(), particles.yaw.end());
  double largest = 0.0;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    largest = std::max(largest, std::abs((particles.yaw[i] + kPi) / (2.0 * kPi) - (i + 0.5) / 20000.0));
  }
  EXPECT_LT(largest, 1.95 / std::sqrt(20000.0) + 1e-4);  // Kolmogorov-Smirnov, exceeded once in a thousand
}

}  // namespace
}  // namespace urban_gnss
