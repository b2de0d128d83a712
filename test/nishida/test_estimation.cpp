#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "matchers.hpp"
#include "urban_gnss_localization/localizers/nishida/estimation.hpp"

namespace urban_gnss {
namespace {

constexpr double kFloats = 1e-6;  ///< some roundings of places of metres, angles and weights

/// Particles in a disc of 1 m about a place, all with the same yaw.
void add_blob(ParticleSet& particles, std::size_t begin, std::size_t end, const Pose2& centre, RandomEngine& engine) {
  for (std::size_t i = begin; i < end; ++i) {
    const double direction = uniform_between(-kPi, kPi, engine);
    const double radius = std::sqrt(draw_uniform(engine));
    particles.x[i] = centre.x + radius * std::cos(direction);
    particles.y[i] = centre.y + radius * std::sin(direction);
    particles.yaw[i] = centre.yaw;
  }
}

ParticleSet permuted(const ParticleSet& particles) {
  ParticleSet result(particles.size());
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const std::size_t from = (i * 7919 + 13) % particles.size();  // a prime: every particle once
    result.x[i] = particles.x[from];
    result.y[i] = particles.y[from];
    result.yaw[i] = particles.yaw[from];
    result.weight[i] = particles.weight[from];
    result.log_weight[i] = particles.log_weight[from];
  }
  return result;
}

TEST(Estimation, MeanAngleIsTakenOnTheCircle) {
  ParticleSet particles(2);
  particles.yaw = {kPi - 0.1, -kPi + 0.3};
  EXPECT_NEAR(std::abs(angle_difference(circular_mean(particles).yaw, -kPi + 0.1)), 0.0, kFloats);
  EXPECT_NEAR(arithmetic_mean(particles).yaw, 0.1, kFloats);  // eq. (35) to the letter: the opposite direction
  set_weights(particles, {3.0, 1.0});
  const double sine = 0.75 * std::sin(kPi - 0.1) + 0.25 * std::sin(-kPi + 0.3);
  const double cosine = 0.75 * std::cos(kPi - 0.1) + 0.25 * std::cos(-kPi + 0.3);
  EXPECT_NEAR(circular_mean(particles).yaw, std::atan2(sine, cosine), kFloats);
}

TEST(Estimation, MeanAndCovarianceAreTheWeightedOnes) {
  ParticleSet particles(3);
  particles.x = {0.0, 4.0, 10.0};
  particles.y = {1.0, 1.0, 5.0};
  particles.yaw = {3.0, -3.0, 3.1};
  set_weights(particles, {1.0, 2.0, 1.0});
  EXPECT_NEAR(circular_mean(particles).x, 4.5, kFloats);
  EXPECT_NEAR(circular_mean(particles).y, 2.0, kFloats);
  const Eigen::Matrix3d covariance = covariance_about(particles, {4.5, 2.0, kPi});
  EXPECT_NEAR(covariance(0, 0), (4.5 * 4.5 + 2 * 0.5 * 0.5 + 5.5 * 5.5) / 4.0, kFloats);
  EXPECT_NEAR(covariance(0, 1), (4.5 + 2 * 0.5 + 5.5 * 3.0) / 4.0, kFloats);
  const double a = 3.0 - kPi, b = kPi - 3.0, c = 3.1 - kPi;
  EXPECT_NEAR(covariance(2, 2), (a * a + 2.0 * b * b + c * c) / 4.0, kFloats);
  EXPECT_NEAR(covariance(0, 2), (-4.5 * a - 2 * 0.5 * b + 5.5 * c) / 4.0, kFloats);
  EXPECT_EQ(covariance, covariance.transpose());
}

TEST(Estimation, CircularSigmaIsThatOfAWrappedGaussian) {
  RandomEngine engine = make_engine(1);
  for (const double sigma : {0.01, 0.3, 1.0}) {
    ParticleSet particles(50000);
    for (float& yaw : particles.yaw) yaw = wrap_angle(3.0 + sigma * draw_normal(engine));
    // The resultant R = exp(-sigma^2/2) is the mean of n cosines: 4.5 of its standard deviations, through -2 ln R.
    const double resultant = std::exp(-0.5 * sigma * sigma);
    const double cosine_variance = 0.5 * (1.0 + std::exp(-2.0 * sigma * sigma)) - resultant * resultant;
    const double tolerance = 4.5 * std::sqrt(cosine_variance / 50000.0) / (resultant * sigma);
    EXPECT_NEAR(circular_sigma(particles), sigma, tolerance);
  }
  ParticleSet opposite(4);
  opposite.yaw = {0.0, kPi / 2.0, -kPi, -kPi / 2.0};
  EXPECT_GT(circular_sigma(opposite), 5.0);  // R is nothing but rounding of floats
  ParticleSet same(10);
  EXPECT_EQ(circular_sigma(same), 0.0);
}

TEST(Estimation, EffectiveSampleSizeLiesBetweenOneAndAllEq39) {
  RandomEngine engine = make_engine(2);
  ParticleSet equal(1000);
  EXPECT_NEAR(effective_sample_size(equal), 1000.0, 1e-3);  // of a weight of 6e-8
  ParticleSet one(1000);
  set_weights(one, std::vector<double>(1000, 0.0));
  one.log_weight.assign(1000, -1e9);
  one.log_weight[17] = 0.0;
  one.normalise();
  EXPECT_EQ(effective_sample_size(one), 1.0);
  ParticleSet half(1000);
  std::vector<double> weights(1000, 0.0);
  std::fill(weights.begin(), weights.begin() + 500, 2.0);
  set_weights(half, weights);
  EXPECT_NEAR(effective_sample_size(half), 500.0, 1e-3);
  const double random = effective_sample_size(random_particles(1000, engine));
  EXPECT_GT(random, 1.0);
  EXPECT_LT(random, 999.0);
}

TEST(Estimation, OrderOfTheParticlesDoesNotMatter) {
  RandomEngine engine = make_engine(3);
  const ParticleSet particles = random_particles(1000, engine);
  const ParticleSet other = permuted(particles);
  const Pose2 mean = circular_mean(particles);
  EXPECT_TRUE(near(circular_mean(other), mean, 1e-11));  // a thousand roundings of metres
  EXPECT_TRUE(near(arithmetic_mean(other), arithmetic_mean(particles), 1e-12));
  EXPECT_LT((covariance_about(other, mean) - covariance_about(particles, mean)).norm(), 1e-11);
  EXPECT_NEAR(effective_sample_size(other), effective_sample_size(particles), 1e-9);
  EXPECT_NEAR(circular_sigma(other), circular_sigma(particles), 1e-11);
  ParticleClusters clusters(1000, 0.15);
  clusters.find(particles);
  const auto count = clusters.count();
  const double mass = clusters.heaviest_mass();
  const Pose2 heaviest = clusters.heaviest_mean(particles);
  clusters.find(other);
  EXPECT_GT(count, 10u);
  EXPECT_EQ(clusters.count(), count);
  EXPECT_NEAR(clusters.heaviest_mass(), mass, 1e-13);
  EXPECT_TRUE(near(clusters.heaviest_mean(other), heaviest, 1e-11));
}

TEST(Clusters, HeavierOfTwoBlobsIsTheEstimate) {
  RandomEngine engine = make_engine(4);
  ParticleSet particles(1000);
  add_blob(particles, 0, 300, {20.0, 0.0, 0.5}, engine);
  add_blob(particles, 300, 1000, {-20.0, 3.0, kPi - 0.01}, engine);
  ParticleClusters clusters(1000, 1.0);
  clusters.find(particles);
  EXPECT_EQ(clusters.count(), 2u);
  EXPECT_NEAR(clusters.heaviest_mass(), 0.7, kFloats);
  // The mean of 700 points of a unit disc has sigma 0.5 / sqrt(700) = 0.019 per axis.
  EXPECT_TRUE(near(clusters.heaviest_mean(particles), {-20.0, 3.0, kPi - 0.01}, 0.085));

  // Weight, not number, is what counts.
  std::vector<double> weights(1000, 1.0);
  std::fill(weights.begin(), weights.begin() + 300, 10.0);
  set_weights(particles, weights);
  clusters.find(particles);
  EXPECT_NEAR(clusters.heaviest_mass(), 3000.0 / 3700.0, kFloats);
  EXPECT_TRUE(near(clusters.heaviest_mean(particles), {20.0, 0.0, 0.5}, 0.13));
}

TEST(Clusters, ChainOfTouchingCellsIsOneInEveryDirection) {
  for (const Eigen::Vector2d& step :
       {Eigen::Vector2d(1.0, 0.0), Eigen::Vector2d(0.0, -1.0), Eigen::Vector2d(1.0, 1.0), Eigen::Vector2d(-1.0, 1.0)}) {
    ParticleSet particles(100);
    for (std::size_t i = 0; i < 100; ++i) {
      particles.x[i] = 0.5 + step.x() * static_cast<double>(i);
      particles.y[i] = 0.5 + step.y() * static_cast<double>(i);
    }
    ParticleClusters clusters(100, 1.0);
    clusters.find(particles);
    EXPECT_EQ(clusters.count(), 1u);
    EXPECT_NEAR(clusters.heaviest_mass(), 1.0, kFloats);
    // Without one of them there are two; a particle of no weight does not bridge the gap.
    std::vector<double> weights(100, 1.0);
    weights[40] = 1e-6;
    set_weights(particles, weights);
    clusters.find(particles);
    EXPECT_EQ(clusters.count(), 2u);
    EXPECT_NEAR(clusters.heaviest_mass(), 59.0 / 99.0, 2e-6);
  }
}

TEST(Clusters, AgreeWithABruteForceSearch) {
  RandomEngine engine = make_engine(5);
  for (int trial = 0; trial < 20; ++trial) {
    const std::size_t n = 200;
    ParticleSet particles = random_particles(n, engine, 12.0);
    std::vector<std::size_t> label(n);
    std::iota(label.begin(), label.end(), 0);
    const auto cell = [&](const std::vector<float>& values, std::size_t i) { return std::floor(values[i] / 0.8); };
    for (bool changed = true; changed;) {
      changed = false;
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = 0; j < n; ++j) {
          if (std::abs(cell(particles.x, i) - cell(particles.x, j)) > 1.0 ||
              std::abs(cell(particles.y, i) - cell(particles.y, j)) > 1.0 || label[j] <= label[i]) {
            continue;
          }
          label[j] = label[i];
          changed = true;
        }
      }
    }
    std::vector<double> mass(n, 0.0);
    for (std::size_t i = 0; i < n; ++i) mass[label[i]] += particles.weight[i];
    ParticleClusters clusters(n, 0.8);
    clusters.find(particles);
    const auto occupied = std::count_if(mass.begin(), mass.end(), [](double m) { return m > 0.0; });
    EXPECT_EQ(clusters.count(), static_cast<std::uint32_t>(occupied));
    EXPECT_NEAR(clusters.heaviest_mass(), *std::max_element(mass.begin(), mass.end()), 1e-13);
  }
}

TEST(Clusters, ParticlesThatAreNowhereAreLeftOut) {
  RandomEngine engine = make_engine(6);
  ParticleSet particles(100);
  add_blob(particles, 0, 100, {5.0, 5.0, 1.0}, engine);
  particles.x[3] = std::numeric_limits<double>::quiet_NaN();
  particles.y[4] = std::numeric_limits<double>::infinity();
  particles.x[5] = -1e300;
  ParticleClusters clusters(100, 1.0);
  clusters.find(particles);
  EXPECT_EQ(clusters.count(), 1u);
  EXPECT_NEAR(clusters.heaviest_mass(), 0.97, kFloats);
  EXPECT_TRUE(near(clusters.heaviest_mean(particles), {5.0, 5.0, 1.0}, 0.5));
}

}  // namespace
}  // namespace urban_gnss
