#include <gtest/gtest.h>

#include <cmath>

#include "urban_gnss_localization/motion/odometry_quality.hpp"

namespace urban_gnss {
namespace {

constexpr double kRounding = 1e-12;

/// The greatest log-likelihood ratio between two levels that leads from `before` to `result`.
double evidence_in(const QualityProbabilities& before, const QualityProbabilities& result) {
  const QualityProbabilities likelihood = result.cwiseQuotient(before);
  return std::log(likelihood.maxCoeff() / likelihood.minCoeff());
}

QualityProbabilities bayes(const QualityProbabilities& before, const QualityProbabilities& likelihood) {
  const QualityProbabilities product = before.cwiseProduct(likelihood);
  return product / product.sum();
}

TEST(OdometryQuality, LevelsGrowByEqualRatios) {
  const OdometryErrorParameters best;
  OdometryQualityParameters p;
  p.wander_factor = 16.0;
  const auto levels = quality_levels(best, p);
  EXPECT_EQ(levels.front().heading_walk, best.heading_walk);
  EXPECT_NEAR(levels.back().heading_walk / best.heading_walk, 16.0, 1e-9);
  const double ratio = std::pow(16.0, 1.0 / (kQualityLevels - 1));
  for (std::size_t i = 1; i < kQualityLevels; ++i) {
    const OdometryErrorParameters& worse = levels[i];
    const OdometryErrorParameters& better = levels[i - 1];
    EXPECT_NEAR(worse.heading_walk / better.heading_walk, ratio, 1e-9) << i;
    EXPECT_NEAR(worse.motion_noise_factor / better.motion_noise_factor, ratio * ratio, 1e-9) << i;
    EXPECT_NEAR(worse.position_walk / better.position_walk, std::sqrt(ratio), 1e-9) << i;
    EXPECT_NEAR(worse.speed_scale_walk / better.speed_scale_walk, std::sqrt(ratio), 1e-9) << i;
    // What does not depend on the wheels' quality.
    EXPECT_EQ(worse.speed_scale_sigma, best.speed_scale_sigma) << i;
    EXPECT_EQ(worse.yaw_rate_bias_sigma, best.yaw_rate_bias_sigma) << i;
    EXPECT_EQ(worse.yaw_rate_bias_walk, best.yaw_rate_bias_walk) << i;
    EXPECT_EQ(worse.parked_walk, best.parked_walk) << i;
    EXPECT_EQ(worse.standstill_radps, best.standstill_radps) << i;
  }
}

TEST(OdometryQuality, FactorOfOneIsOneLevel) {
  OdometryQualityParameters p;
  p.wander_factor = 1.0;
  for (const OdometryErrorParameters& level : quality_levels({}, p)) {
    EXPECT_EQ(level.heading_walk, OdometryErrorParameters().heading_walk);
    EXPECT_EQ(level.motion_noise_factor, OdometryErrorParameters().motion_noise_factor);
    EXPECT_EQ(level.position_walk, OdometryErrorParameters().position_walk);
    EXPECT_EQ(level.speed_scale_walk, OdometryErrorParameters().speed_scale_walk);
  }
}

TEST(OdometryQuality, PriorGivesTheWorseLevelsTheirShare) {
  OdometryQualityParameters p;
  for (const double share : {0.0, 0.3, 1.0}) {
    p.wander_share = share;
    const QualityProbabilities prior = prior_quality(p);
    EXPECT_NEAR(prior.sum(), 1.0, kRounding) << share;
    EXPECT_NEAR(prior[0], 1.0 - share, kRounding);
    for (Eigen::Index i = 1; i < prior.size(); ++i) EXPECT_NEAR(prior[i], share / (kQualityLevels - 1), kRounding);
  }
}

TEST(OdometryQuality, TransitionGoesFromTheLevelItselfToThePrior) {
  const OdometryQualityParameters p;
  for (const double elapsed_s : {0.0, 10.0, 1e6}) {
    const QualityTransition transition = quality_transition(elapsed_s, p);
    for (Eigen::Index row = 0; row < transition.rows(); ++row) {
      EXPECT_NEAR(transition.row(row).sum(), 1.0, kRounding) << elapsed_s;
      EXPECT_GE(transition.row(row).minCoeff(), 0.0) << elapsed_s;
    }
  }
  EXPECT_TRUE(quality_transition(0.0, p).isIdentity(kRounding));
  for (Eigen::Index row = 0; row < static_cast<Eigen::Index>(kQualityLevels); ++row) {
    EXPECT_TRUE(quality_transition(1e6, p).row(row).transpose().isApprox(prior_quality(p), kRounding)) << row;
  }
}

// It is a Markov process in time: two steps are one of their sum, and who knows nothing learns nothing by waiting.
TEST(OdometryQuality, TransitionsOfTwoStepsAreThatOfTheirSum) {
  const OdometryQualityParameters p;
  const QualityTransition both = quality_transition(40.0, p) * quality_transition(260.0, p);
  EXPECT_TRUE(both.isApprox(quality_transition(300.0, p), kRounding));
  const QualityProbabilities prior = prior_quality(p);
  EXPECT_TRUE((both.transpose() * prior).isApprox(prior, kRounding));
  const double stays = std::exp(-1.0);  // after quality_time nothing was drawn with 1/e
  EXPECT_NEAR(quality_transition(p.quality_time, p)(0, 1), (1.0 - stays) * prior[1], kRounding);
}

TEST(OdometryQuality, SmallEvidenceIsBayesRule) {
  const QualityProbabilities before(0.6, 0.3, 0.1);
  const OdometryQualityParameters p;
  const QualityProbabilities after = bayes(before, {1.0, std::exp(0.04), std::exp(-0.05)});
  ASSERT_LT(evidence_in(before, after), p.quality_evidence);
  EXPECT_TRUE(bounded_quality(before, after, p).isApprox(after, kRounding));
}

TEST(OdometryQuality, NoFixSaysMoreThanItMay) {
  OdometryQualityParameters p;
  const QualityProbabilities before(0.6, 0.3, 0.1);
  const QualityProbabilities likelihoods[] = {
      {1.0, 5.0, 30.0}, {1e6, 1.0, 1e-6}, {1.0, 1.0, 1e9}, {0.0, 1.0, 0.0}, {1.0, 0.5, 1e-300}};
  for (const double most : {0.01, 0.1, 1.0}) {
    p.quality_evidence = most;
    for (const QualityProbabilities& likelihood : likelihoods) {
      const QualityProbabilities after = bayes(before, likelihood);
      const QualityProbabilities result = bounded_quality(before, after, p);
      EXPECT_NEAR(result.sum(), 1.0, kRounding);
      // All of these say more than they may, so that the bound is reached, and the best explanation gains by it.
      EXPECT_NEAR(evidence_in(before, result), most, 1e-9) << likelihood.transpose();
      Eigen::Index best = 0;
      likelihood.maxCoeff(&best);
      EXPECT_GT(result[best], before[best]) << likelihood.transpose();
    }
  }
}

TEST(OdometryQuality, WithoutEvidenceNothingIsLearnt) {
  OdometryQualityParameters p;
  p.quality_evidence = 0.0;
  const QualityProbabilities before(0.6, 0.3, 0.1);
  EXPECT_TRUE(bounded_quality(before, {0.01, 0.09, 0.9}, p).isApprox(before, kRounding));
}

TEST(OdometryQuality, LevelThatIsImpossibleStaysSo) {
  const QualityProbabilities result = bounded_quality({0.7, 0.3, 0.0}, {0.1, 0.9, 0.0}, {});
  EXPECT_EQ(result[2], 0.0);
  EXPECT_NEAR(result.sum(), 1.0, kRounding);
  EXPECT_GT(result[1], 0.3);
}

}  // namespace
}  // namespace urban_gnss
