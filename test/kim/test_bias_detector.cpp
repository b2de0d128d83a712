#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <limits>
#include <stdexcept>
#include <utility>

#include "matchers.hpp"
#include "urban_gnss_localization/gnss/chi_squared.hpp"
#include "urban_gnss_localization/localizers/kim/bias_detector.hpp"

namespace urban_gnss {
namespace {

Eigen::Matrix2d tilted() {
  Eigen::Matrix2d covariance;
  covariance << 4.0, 1.5, 1.5, 2.0;
  return covariance;
}

Eigen::Vector2d draw(const Eigen::Matrix2d& covariance, RandomEngine& engine) {
  const double x = draw_normal(engine);
  const double y = draw_normal(engine);
  return covariance.llt().matrixL() * Eigen::Vector2d(x, y);
}

// The paper's 7.81 is the quantile for three degrees of freedom.
TEST(BiasDetector, ThresholdIsTheQuantileForTwoDimensions) {
  BiasDetectorParameters parameters;
  parameters.gate_probability = 0.95;
  EXPECT_NEAR(BiasDetector(parameters).threshold(), 5.991, 1e-3);
  EXPECT_NEAR(chi_squared_quantile(0.95, 3), 7.81, 0.01);
}

TEST(BiasDetector, FalseAlarmsComeAtTheirRate) {
  RandomEngine engine = make_engine(1);
  constexpr int kFixes = 4000000;
  for (const auto& [probability, fixes_per_ramp] : {std::pair(0.99, 7800.0), std::pair(0.999999, 4630.0)}) {
    BiasDetectorParameters parameters;
    parameters.gate_probability = probability;
    BiasDetector detector(parameters);
    int jumps = 0;
    int ramps = 0;
    for (int k = 0; k < kFixes; ++k) {
      const BiasDetection detection = detector.test(draw(tilted(), engine), tilted());
      jumps += detection.is_jump;
      ramps += detection.is_ramp;
    }
    const double expected = kFixes * (1.0 - probability);
    EXPECT_NEAR(jumps, expected, 4.5 * std::sqrt(expected)) << probability;
    EXPECT_NEAR(ramps * fixes_per_ramp / kFixes, 1.0, 0.15) << probability;
  }
}

// Steps of a tenth of a sigma: no single fix shows it.
TEST(BiasDetector, SlowRampIsFound) {
  BiasDetector detector({});
  RandomEngine engine = make_engine(2);
  int found = 0;
  for (int k = 1; k <= 40 && !found; ++k) {
    const Eigen::Vector2d ramp(0.0, -0.1 * k * std::sqrt(2.0));
    const BiasDetection detection = detector.test(ramp + 0.3 * draw(tilted(), engine), tilted());
    EXPECT_FALSE(detection.is_jump) << k;
    if (detection.is_ramp) found = k;
  }
  EXPECT_GT(found, 5);
  EXPECT_LE(found, 25);
}

// The mean count of fixes until an innovation with this mean (sigma) is found, by either test.
TEST(BiasDetector, SteadyBiasIsFoundSoon) {
  RandomEngine engine = make_engine(3);
  constexpr int kRuns = 5000;
  for (const auto& [mean, expected] :
       {std::pair(0.75, 21.1), std::pair(1.0, 12.7), std::pair(1.5, 6.6), std::pair(2.0, 3.9)}) {
    double fixes = 0.0;
    for (int run = 0; run < kRuns; ++run) {
      BiasDetector detector({});
      BiasDetection detection;
      while (!detection.is_biased()) {
        detection = detector.test(draw(isotropic(1.0), engine) + Eigen::Vector2d(mean, 0.0), isotropic(1.0));
        fixes += 1.0;
      }
    }
    EXPECT_NEAR(fixes / kRuns, expected, 0.05 * expected) << mean;
  }
}

TEST(BiasDetector, SpikeIsNoRamp) {
  BiasDetector detector({});
  const BiasDetection detection = detector.test({1e6, 0.0}, Eigen::Matrix2d::Identity());
  EXPECT_TRUE(detection.is_jump);
  EXPECT_FALSE(detection.is_ramp);
  EXPECT_EQ(detector.sums().maxCoeff(), 0.0);
}

TEST(BiasDetector, SmallestDetectableJumpIsFoundWithItsPower) {
  const Eigen::Matrix2d covariance = tilted();
  const double jump = smallest_detectable_jump(covariance, 0.99, 0.9);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(covariance);
  const Eigen::Vector2d hardest = axes.eigenvectors().col(1);
  RandomEngine engine = make_engine(4);
  constexpr int kTrials = 20000;
  int found = 0;
  BiasDetector detector({});
  for (int k = 0; k < kTrials; ++k)
    found += detector.test(jump * hardest + draw(covariance, engine), covariance).is_jump;
  EXPECT_NEAR(found, 0.9 * kTrials, 4.5 * std::sqrt(kTrials * 0.9 * 0.1));
}

TEST(BiasDetector, SmallestDetectableJumpGrowsAsItShould) {
  const double one = smallest_detectable_jump(isotropic(1.0), 0.99);
  // The root of the non-centrality 17.427 at which 2 degrees of freedom exceed 9.21 in 90 %:
  // sum over j of Poisson(j; l / 2) times the tail of chi-squared with 2 + 2 j, solved for l by bisection.
  EXPECT_NEAR(one, 4.1745, 1e-3);
  EXPECT_NEAR(smallest_detectable_jump(isotropic(5.0), 0.99), 5.0 * one, 1e-6);
  EXPECT_GT(smallest_detectable_jump(isotropic(1.0), 0.999), one);
  EXPECT_GT(smallest_detectable_jump(isotropic(1.0), 0.99, 0.99), one);
  EXPECT_EQ(smallest_detectable_jump(isotropic(1.0), 0.99, 0.005), 0.0) << "false alarms alone are more frequent";
  EXPECT_THROW(smallest_detectable_jump(isotropic(1.0), 1.0), std::invalid_argument);
  EXPECT_THROW(smallest_detectable_jump(isotropic(1.0), 0.99, 1.0), std::invalid_argument);
  EXPECT_THROW(smallest_detectable_jump(isotropic(0.0), 0.99), std::invalid_argument);
  EXPECT_THROW(smallest_detectable_jump(isotropic(std::numeric_limits<double>::quiet_NaN()), 0.99),
               std::invalid_argument);
}

}  // namespace
}  // namespace urban_gnss
