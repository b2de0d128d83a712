#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "matchers.hpp"
#include "urban_gnss_localization/localizers/nishida/resampling.hpp"

namespace urban_gnss {
namespace {

constexpr ResamplingScheme kSchemes[] = {ResamplingScheme::kMultinomial, ResamplingScheme::kSystematic};

/// Particles whose x is their index.
ParticleSet numbered(std::size_t count, RandomEngine& engine) {
  ParticleSet particles = random_particles(count, engine);
  for (std::size_t i = 0; i < count; ++i) particles.x[i] = static_cast<double>(i);
  return particles;
}

TEST(Resampling, CopiesParticlesAndMakesWeightsEqualEq41) {
  RandomEngine engine = make_engine(1);
  for (const ResamplingScheme scheme : kSchemes) {
    const ParticleSet before = numbered(500, engine);
    ParticleSet particles = before;
    Resampler resampler(500, scheme);
    resampler.resample(particles, RandomStream(engine()));
    ASSERT_TRUE(std::is_sorted(resampler.parents().begin(), resampler.parents().end()));
    for (std::size_t i = 0; i < 500; ++i) {
      ASSERT_EQ(particles.pose(i), before.pose(resampler.parents()[i]));
      ASSERT_EQ(particles.weight[i], 1.0F / 500.0F);
      ASSERT_EQ(particles.log_weight[i], static_cast<float>(std::log(1.0 / 500.0)));
    }
  }
}

// Chi-square of the counts over 2000 resamplings of 100 particles against M w: 99 degrees of freedom where the draws
// are independent.
TEST(Resampling, EveryParticleIsDrawnByItsWeightEq40) {
  constexpr int kRounds = 2000;
  constexpr double kCount = 100.0;
  for (const ResamplingScheme scheme : kSchemes) {
    RandomEngine engine = make_engine(2);
    const ParticleSet original = numbered(100, engine);
    Resampler resampler(100, scheme);
    std::vector<double> drawn(100, 0.0);
    for (int round = 0; round < kRounds; ++round) {
      ParticleSet particles = original;
      resampler.resample(particles, RandomStream(engine()));
      for (const float x : particles.x) drawn[static_cast<std::size_t>(x)] += 1.0;
    }
    double statistic = 0.0;
    for (std::size_t i = 0; i < 100; ++i) {
      const double expected = kRounds * kCount * original.weight[i];
      statistic += (drawn[i] - expected) * (drawn[i] - expected) / expected;
      // The variance of a count is at most that of independent draws.
      EXPECT_LT(std::abs(drawn[i] - expected), 4.5 * std::sqrt(expected)) << i;
    }
    EXPECT_LT(statistic, 99.0 + 4.5 * std::sqrt(2.0 * 99.0));
    if (scheme == ResamplingScheme::kMultinomial) {
      EXPECT_GT(statistic, 99.0 - 4.5 * std::sqrt(2.0 * 99.0));
    } else {
      EXPECT_LT(statistic, 99.0 / 2.0);  // less variance is what it is for
    }
  }
}

TEST(Resampling, SystematicCountsAreWithinOneOfTheirExpectation) {
  RandomEngine engine = make_engine(3);
  for (int trial = 0; trial < 50; ++trial) {
    ParticleSet particles = numbered(300, engine);
    const std::vector<float> weight = particles.weight;
    Resampler(300, ResamplingScheme::kSystematic).resample(particles, RandomStream(engine()));
    for (std::size_t i = 0; i < 300; ++i) {
      const auto copies = static_cast<double>(std::count(particles.x.begin(), particles.x.end(), i));
      // 300 floats add up to 1 within 300 roundings of 6e-8.
      EXPECT_GE(copies, std::floor(300.0 * weight[i] - 1e-4));
      EXPECT_LE(copies, std::ceil(300.0 * weight[i] + 1e-4));
    }
  }
}

TEST(Resampling, ParticlesWithoutWeightAreNotDrawn) {
  RandomEngine engine = make_engine(4);
  for (const ResamplingScheme scheme : kSchemes) {
    for (const std::size_t survivor : {std::size_t{0}, std::size_t{57}, std::size_t{99}}) {
      ParticleSet particles = numbered(100, engine);
      std::vector<double> weights(100, 0.0);
      weights[survivor] = 1.0;
      set_weights(particles, weights);
      Resampler(100, scheme).resample(particles, RandomStream(engine()));
      for (const float x : particles.x) ASSERT_EQ(x, static_cast<float>(survivor));
    }
  }
  ParticleSet alone(1);
  Resampler(1, ResamplingScheme::kMultinomial).resample(alone, RandomStream(engine()));
  EXPECT_EQ(alone.weight[0], 1.0);
}

}  // namespace
}  // namespace urban_gnss
