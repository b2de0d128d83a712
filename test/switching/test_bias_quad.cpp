#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "random_gaussian.hpp"
#include "switching_rig.hpp"
#include "urban_gnss_localization/localizers/switching/bias_quad.hpp"

namespace urban_gnss {
namespace {

constexpr BiasMode kModes[] = {BiasMode::kDirect, BiasMode::kSlow, BiasMode::kFast, BiasMode::kJump};
constexpr double kTolerance = 1e-12;  // of numbers of about 10

using Gaussians = std::array<std::array<BiasGaussian, kContinuations>, kQualityLevels>;

/// States of every mode at every quality, whose yaws lie on both sides of pi.
struct States {
  Gaussians single;
  BiasQuads quads;
  QualityNumbers weights{};  ///< whose sum is 1

  explicit States(std::uint64_t seed) {
    RandomEngine engine = make_engine(seed);
    double sum = 0.0;
    for (std::size_t level = 0; level < kQualityLevels; ++level) {
      for (std::size_t m = 0; m < kContinuations; ++m) {
        single[level][m] = random_gaussian(engine);
        single[level][m].mean[2] = wrap_angle(3.1 + 0.3 * draw_normal(engine));
        quads[level].set(m, single[level][m]);
        if (m < kLastingModes) sum += weights[level][m] = draw_uniform(engine);
      }
    }
    for (ModeNumbers& modes : weights) {
      for (double& weight : modes) weight /= sum;
    }
  }
};

void expect_same(const BiasGaussian& a, const BiasGaussian& b, const std::string& what) {
  EXPECT_LT(difference(a.mean, b.mean).cwiseAbs().maxCoeff(), kTolerance) << what;
  EXPECT_LT((a.covariance - b.covariance).cwiseAbs().maxCoeff(), kTolerance * b.covariance.cwiseAbs().maxCoeff())
      << what;
}
void expect_same(const BiasQuad& quad, const std::array<BiasGaussian, kContinuations>& single,
                 const std::string& what) {
  for (std::size_t m = 0; m < kContinuations; ++m) expect_same(quad.at(m), single[m], what + std::to_string(m));
}
void expect_same(const BiasQuadUpdate& quad, std::size_t m, const BiasEkfUpdate& single) {
  EXPECT_NEAR(quad.log_likelihood[m], single.log_likelihood, kTolerance * std::abs(single.log_likelihood));
  EXPECT_NEAR(quad.nis[m], single.nis, kTolerance * single.nis);
  EXPECT_NEAR(quad.white_nis[m], single.white_nis, kTolerance * single.white_nis);
  EXPECT_NEAR(quad.outlier[m], single.outlier, kTolerance);
}

TEST(BiasQuad, PredictsAsOne) {
  MotionParameters velocity;
  MotionParameters bicycle;
  bicycle.motion_model = MotionModel::kBicycle;
  const auto levels = quality_levels({}, {});
  for (const MotionParameters& motion : {velocity, bicycle}) {
    // Straight on, round a bend, backwards and sideways, more than a turn in a step, on the spot, at rest.
    for (const Twist2& twist : {Twist2{1.5, 0.0}, Twist2{12.0, 0.4}, Twist2{-3.0, -1.1, 0.3}, Twist2{1.0, 40.0},
                                Twist2{0.0, 0.7}, Twist2{0.0, 0.0}}) {
      States states(3);
      const auto steps = make_motion_steps(twist, 0.2, motion, levels);
      predict(states.quads, steps, levels);
      for (std::size_t level = 0; level < kQualityLevels; ++level) {
        for (BiasGaussian& each : states.single[level]) predict(each, steps[level], levels[level]);
        expect_same(states.quads[level], states.single[level], std::to_string(twist.speed_mps) + " m/s ");
      }
    }
  }
}

TEST(BiasQuad, MixesAsOne) {
  const States states(4);
  const auto state_of = [&](std::size_t i) -> const BiasGaussian& { return states.single[i / 3][i % 3]; };
  const auto weight_of = [&](std::size_t i) { return states.weights[i / 3][i % 3]; };
  const BiasGaussian expected = match_moments(9, state_of, weight_of);
  expect_same(mixture_of(states.quads, states.weights), expected, "all");
  const PoseEstimate estimate = pose_estimate_of(states.quads, states.weights);
  EXPECT_NEAR(angle_difference(estimate.pose.yaw, expected.mean[2]), 0.0, kTolerance);
  EXPECT_LT((estimate.covariance - expected.covariance.topLeftCorner<3, 3>()).cwiseAbs().maxCoeff(), 100 * kTolerance);
  const Pose2 pose = pose_of(states.quads, states.weights);
  EXPECT_NEAR(pose.x, expected.mean[0], kTolerance);
  EXPECT_NEAR(pose.y, expected.mean[1], kTolerance);
  EXPECT_NEAR(angle_difference(pose.yaw, expected.mean[2]), 0.0, kTolerance);

  QualityNumbers shares{};
  for (std::size_t m = 0; m < kContinuations; ++m) {
    const double second = 0.1 + 0.2 * static_cast<double>(m);
    shares[0][m] = 0.9 - second;
    shares[1][m] = second;
    shares[2][m] = 0.1;
  }
  BiasQuad mixed;
  QualityNumbers weights = shares;
  for (ModeNumbers& modes : weights) modes[0] *= 0.3;
  for (ModeNumbers& modes : weights) modes[3] = 0.0;
  const ModeNumbers sums = mix_qualities(states.quads, weights, 1, mixed);
  EXPECT_NEAR(sums[0], 0.3, kTolerance);
  EXPECT_NEAR(sums[1], 1.0, kTolerance);
  EXPECT_EQ(sums[3], 0.0);
  for (std::size_t level = 0; level < kQualityLevels; ++level) shares[level][3] = level == 1 ? 1.0 : 0.0;
  for (std::size_t m = 0; m < kContinuations; ++m) {
    expect_same(mixed.at(m),
                match_moments(
                    3, [&](std::size_t i) -> const BiasGaussian& { return states.single[i][m]; },
                    [&](std::size_t i) { return shares[i][m]; }),
                "qualities");
  }

  BiasQuad merged;
  merge_jump(states.quads[0], 0.7, 0.3, merged);
  const auto& parts = states.single[0];
  expect_same(merged.at(1),
              match_moments(
                  2, [&](std::size_t i) -> const BiasGaussian& { return parts[i == 0 ? 1 : 3]; },
                  [&](std::size_t i) { return i == 0 ? 0.7 : 0.3; }),
              "slow bias and jump");
  expect_same(merged.at(0), parts[0], "direct");
  expect_same(merged.at(2), parts[2], "fast");
}

TEST(BiasQuad, BiasesGoOnAsOne) {
  const States states(5);
  const BiasModeParameters p;
  const double elapsed_s = 0.7;
  std::array<ModeNumbers, kLastingModes> weights{{{0.4, 0.1, 0.0, 0.0}, {1.0, 0.3, 0.0, 0.4}, {0.6, 0.6, 0.0, 0.6}}};
  BiasQuad after;
  EXPECT_EQ(continue_biases(states.quads[1], weights, bias_steps(elapsed_s, p), after),
            ModeNumbers({2.0, 1.0, 0.0, 1.0}));
  for (ModeNumbers& modes : weights) modes[0] *= 0.5;
  weights[0][2] = 1.0;
  for (std::size_t j = 0; j < kContinuations; ++j) {
    std::array<BiasGaussian, kLastingModes> parts;
    for (std::size_t m = 0; m < kLastingModes; ++m) {
      parts[m] = states.single[1][m];
      continue_bias(parts[m], bias_steps(elapsed_s, p)[m][j]);
    }
    expect_same(after.at(j),
                match_moments(
                    3, [&](std::size_t m) -> const BiasGaussian& { return parts[m]; },
                    [&](std::size_t m) { return weights[m][j]; }),
                "mode " + std::to_string(j));
  }
}

TEST(BiasQuad, TakesAFixAsOne) {
  SwitchingModelParameters p;
  p.fix.shadow_sigma = 5.0;
  FixMeasurement fix;
  fix.covariance << 4.0, 0.7, 0.7, 9.0;
  fix.antenna_in_body = {0.4, -0.2};
  for (const bool of_ranges : {false, true}) {
    for (const double share : {0.0, 0.01}) {
      for (const double far_m : {1.0, 30.0, 3000.0}) {
        p.modes.outlier_share = share;
        fix.position = {far_m, -0.5 * far_m};
        const FixNoise noise{1.7, 2.5, 0.3, of_ranges};
        States states(6);
        const BiasQuadUpdates updates = take_fix(states.quads, fix, noise, p);
        for (std::size_t level = 0; level < kQualityLevels; ++level) {
          for (std::size_t m = 0; m < kContinuations; ++m) {
            expect_same(updates[level], m, take_fix(states.single[level][m], kModes[m], fix, noise, p));
            expect_same(states.quads[level].at(m), states.single[level][m], "fix at " + std::to_string(far_m));
          }
        }
      }
    }
  }
}

TEST(BiasQuad, TakesAVelocityAsOne) {
  VelocityMeasurement measured;
  measured.velocity = {-1.0, 0.4};
  measured.antenna_velocity_in_body = {1.4, 0.1};
  Eigen::Matrix2d noise;
  noise << 0.04, 0.01, 0.01, 0.09;
  States states(7);
  const BiasQuadUpdates updates = take_velocity(states.quads, measured, noise, 1.8, 1.5);
  for (std::size_t level = 0; level < kQualityLevels; ++level) {
    for (std::size_t m = 0; m < kContinuations; ++m) {
      expect_same(updates[level], m, take_velocity(states.single[level][m], measured, noise, 1.8, 1.5));
      expect_same(states.quads[level].at(m), states.single[level][m], "velocity");
    }
  }
}

TEST(BiasQuad, TellsWhatIsNotFinite) {
  States states(8);
  EXPECT_TRUE(are_finite(states.quads));
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    BiasQuads mean = states.quads;
    mean[0].mean[3][2] = bad;
    EXPECT_FALSE(are_finite(mean));
    BiasQuads covariance = states.quads;
    covariance[2].covariance[BiasQuad::pair(7, 7)][3] = bad;
    EXPECT_FALSE(are_finite(covariance));
  }
}

}  // namespace
}  // namespace urban_gnss
