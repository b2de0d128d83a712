#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <unsupported/Eigen/MatrixFunctions>

#include "matchers.hpp"
#include "urban_gnss_localization/gnss/fix_sigma.hpp"
#include "urban_gnss_localization/localizers/switching/bias_modes.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"

namespace urban_gnss {
namespace {

constexpr auto S = BiasMode::kDirect;
constexpr auto L = BiasMode::kSlow;
constexpr auto F = BiasMode::kFast;
constexpr auto J = BiasMode::kJump;

/// Without the column of jumps, which are entries into the slow mode.
Eigen::Matrix3d lasting_transition(const ModeTransition& t) {
  Eigen::Matrix3d lasting = t.leftCols<3>();
  lasting.col(index_of(L)) += t.col(index_of(J));
  return lasting;
}

BiasModeParameters times(double direct, double slow, double fast, double end, double jump_share) {
  BiasModeParameters p;
  p.direct_time = direct;
  p.slow_bias_time = slow;
  p.fast_bias_time = fast;
  p.bias_end_time = end;
  p.jump_share = jump_share;
  return p;
}

TEST(BiasModes, RowsAreProbabilitiesAfterAnyTime) {
  for (const auto& p : {BiasModeParameters(), times(5.0, 10.0, 0.5, 5.0, 0.05), times(1e-3, 1e3, 1e-3, 1e4, 0.0),
                        times(1, 1, 1, 1, 1)}) {
    for (const double odds : {1e-3, 1.0, 1e3}) {
      for (const double elapsed : {0.0, 1e-9, 0.01, 1.0, 60.0, 3600.0, 1e6, 1e300}) {
        const ModeTransition t = mode_transition(elapsed, p, odds);
        EXPECT_TRUE(t.allFinite()) << elapsed;
        EXPECT_GE(t.minCoeff(), 0.0) << elapsed;
        EXPECT_LT((t.rowwise().sum().array() - 1.0).abs().maxCoeff(), 1e-12) << elapsed;
      }
    }
  }
}

TEST(BiasModes, NothingChangesInNoTimeAndRatesAreThoseOfTheTimes) {
  const BiasModeParameters p = times(5.0, 10.0, 0.5, 4.0, 0.2);
  ModeTransition same = ModeTransition::Zero();
  same.leftCols<3>().setIdentity();
  EXPECT_EQ(mode_transition(0.0, p), same);

  const double dt = 1e-6;
  const ModeTransition rates = (mode_transition(dt, p) - same) / dt;
  ModeTransition expected;
  expected << -0.2, 0.08, 0.08, 0.04,  //
      0.25, -0.25 - 0.1, 0.08, 0.02,   //
      0.8, 0.8, -2.0, 0.4;
  EXPECT_LT((rates - expected).cwiseAbs().maxCoeff(), 1e-5) << rates;
}

TEST(BiasModes, IsTheMatrixExponentialOfTheRates) {
  const BiasModeParameters p = times(5.0, 10.0, 0.5, 4.0, 0.2);
  Eigen::Matrix4d rates;
  rates << -0.2, 0.08, 0.08, 0.04,  //
      0.25, -0.35, 0.08, 0.02,      //
      0.8, 0.8, -2.0, 0.4,          //
      0.25, 0.0, 0.08, -0.33;
  for (const double elapsed : {1e-4, 0.01, 0.03, 0.2, 1.0, 3.7, 60.0, 400.0}) {
    const Eigen::Matrix4d exponential = (elapsed * rates).exp();
    EXPECT_LT((mode_transition(elapsed, p) - exponential.topRows<3>()).cwiseAbs().maxCoeff(), 1e-13) << elapsed;
  }
}

TEST(BiasModes, TwoStepsAreOneAndTheLongRunForgetsTheStart) {
  const BiasModeParameters p = times(5.0, 10.0, 0.5, 4.0, 0.2);
  const Eigen::Matrix3d one = lasting_transition(mode_transition(3.0, p));
  const Eigen::Matrix3d two = lasting_transition(mode_transition(6.0, p));
  EXPECT_LT((one * one - two).cwiseAbs().maxCoeff(), 1e-12);
  // Whether there was a jump: no jump in two steps, or one in the second, or one in the first and nothing since.
  EXPECT_GT(mode_transition(6.0, p)(0, 3), mode_transition(3.0, p)(0, 3));

  const ModeProbabilities shares = stationary_modes(p);
  EXPECT_NEAR(shares.sum(), 1.0, 1e-12);
  EXPECT_LT((shares.transpose() * one - shares.transpose()).cwiseAbs().maxCoeff(), 1e-12);
  const Eigen::Matrix3d late = lasting_transition(mode_transition(1e6, p));
  EXPECT_LT((late.rowwise() - shares.transpose()).cwiseAbs().maxCoeff(), 1e-12);
}

/// The chain, simulated in continuous time.
TEST(BiasModes, AgreesWithASimulationOfTheTimes) {
  const BiasModeParameters p = times(5.0, 2.0, 0.5, 4.0, 0.3);
  const double horizon = 3.0;
  RandomEngine engine = make_engine(3);
  const int runs = 40000;
  for (const BiasMode start : {S, L, F}) {
    Eigen::Vector4d counts = Eigen::Vector4d::Zero();
    for (int run = 0; run < runs; ++run) {
      BiasMode mode = start;
      double t = 0.0;
      while (true) {
        const double rate = mode == S ? 1.0 / 5.0 : mode == F ? 1.0 / 0.5 : 1.0 / 2.0 + 1.0 / 4.0;
        t -= std::log(1.0 - draw_uniform(engine)) / rate;
        if (t > horizon) break;
        const bool is_end = (mode == L || mode == J) && draw_uniform(engine) < (1.0 / 4.0) / rate;
        if (is_end) {
          mode = S;
        } else if (draw_uniform(engine) < 0.3) {
          mode = J;
        } else if (mode == L || mode == J) {
          mode = F;
        } else {
          const bool first = draw_uniform(engine) < 0.5;
          mode = mode == S ? (first ? L : F) : (first ? S : L);
        }
      }
      counts[static_cast<int>(index_of(mode))] += 1.0 / runs;
    }
    const Eigen::RowVector4d row = mode_transition(horizon, p).row(static_cast<int>(index_of(start)));
    // 4.5 standard deviations of a share of 0.5
    EXPECT_LT((counts.transpose() - row).cwiseAbs().maxCoeff(), 4.5 * std::sqrt(0.25 / runs)) << counts << "\n" << row;
  }
}

TEST(BiasModes, OddsOfABiasMultiplyThoseOfTheLongRun) {
  const BiasModeParameters p = times(5.0, 10.0, 0.5, 4.0, 1.0);  // S, L and J only
  const auto odds = [](const ModeProbabilities& m) { return (1.0 - m[0]) / m[0]; };
  EXPECT_NEAR(odds(stationary_modes(p, 9.0)) / odds(stationary_modes(p)), 9.0, 1e-9);
  // The rate of fixes does not matter.
  const Eigen::Matrix3d often = lasting_transition(mode_transition(0.5, p, 9.0));
  EXPECT_LT((often * often - lasting_transition(mode_transition(1.0, p, 9.0))).cwiseAbs().maxCoeff(), 1e-12);
}

/// A bias (m): Gaussian with the same variance (m^2) in x and y, independent.
struct BiasState {
  Eigen::Vector2d mean{Eigen::Vector2d::Zero()};
  double variance{0.0};
};
BiasState predict_bias(const BiasState& bias, BiasMode from, BiasMode to, double elapsed_s,
                       const BiasModeParameters& p) {
  const BiasStep step = bias_steps(elapsed_s, p)[index_of(from)][index_of(to)];
  return {step.left * bias.mean, step.left * step.left * bias.variance + step.growth_m2};
}

TEST(BiasModes, BiasOfEachContinuation) {
  BiasModeParameters p;
  p.slow_bias_walk = 0.5;
  p.fast_bias_walk = 3.0;
  p.jump_sigma = 20.0;
  p.onset_sigma = 0.25;
  p.bias_fade_time = 0.0;
  const BiasState bias{{4.0, -1.0}, 0.5};
  for (const BiasMode from : {S, L, F}) {
    const BiasState direct = predict_bias(bias, from, S, 2.0, p);
    EXPECT_EQ(direct.mean, Eigen::Vector2d::Zero());
    EXPECT_EQ(direct.variance, 0.0);
    const BiasState jump = predict_bias(bias, from, J, 2.0, p);
    EXPECT_EQ(jump.mean, Eigen::Vector2d::Zero());
    EXPECT_EQ(jump.variance, 400.0);
  }
  for (const BiasMode from : {L, F}) {
    EXPECT_EQ(predict_bias(bias, from, L, 2.0, p).mean, bias.mean);
    EXPECT_EQ(predict_bias(bias, from, L, 2.0, p).variance, 0.5 + 0.25 * 2.0);
    EXPECT_EQ(predict_bias(bias, from, F, 2.0, p).mean, bias.mean);
    EXPECT_EQ(predict_bias(bias, from, F, 2.0, p).variance, 0.5 + 9.0 * 2.0);
  }
  EXPECT_EQ(predict_bias(bias, S, L, 2.0, p).mean, Eigen::Vector2d::Zero());
  EXPECT_EQ(predict_bias(bias, S, L, 2.0, p).variance, 0.0625 + 0.25 * 2.0);
  EXPECT_EQ(lasting(J), L);
  EXPECT_EQ(lasting(F), F);
}

TEST(BiasModes, ABiasThatFadesEndsAsOneThatHasJustCome) {
  BiasModeParameters p;
  p.bias_fade_time = 10.0;
  p.jump_sigma = 8.0;
  p.slow_bias_walk = 0.0;
  const BiasState bias{{4.0, -1.0}, 0.5};
  const BiasState later = predict_bias(bias, L, L, 10.0, p);
  EXPECT_NEAR(later.mean.x(), 4.0 * std::exp(-1.0), 1e-12);
  EXPECT_NEAR(later.variance, std::exp(-2.0) * 0.5 + (1.0 - std::exp(-2.0)) * 64.0, 1e-12);
  // Two steps are as good as one.
  const BiasState half = predict_bias(predict_bias(bias, L, L, 4.0, p), L, L, 6.0, p);
  EXPECT_LT((half.mean - later.mean).norm(), 1e-12);
  EXPECT_NEAR(half.variance, later.variance, 1e-12);
  const BiasState end = predict_bias(bias, L, L, 1000.0, p);
  EXPECT_LT(end.mean.norm(), 1e-12);
  EXPECT_NEAR(end.variance, predict_bias(bias, L, J, 1.0, p).variance, 1e-9);
}

TEST(BiasModes, NoiseOfAFixWithAndWithoutBias) {
  FixSigmaParameters sigmas;
  sigmas.direct_sigma = 2.0;
  sigmas.shadow_sigma = 6.0;
  const Eigen::Matrix2d declared = (Eigen::Matrix2d() << 4.0, 1.0, 1.0, 9.0).finished();
  EXPECT_EQ(sigmas.direct_covariance(declared), declared);
  EXPECT_TRUE(sigmas.shadow_covariance(declared).isApprox(9.0 * declared, 1e-12));
  sigmas.use_fix_covariance = false;
  EXPECT_TRUE(sigmas.direct_covariance(declared).isApprox(isotropic(2.0), 1e-12));
  EXPECT_TRUE(sigmas.shadow_covariance(declared).isApprox(isotropic(6.0), 1e-12));
}

TEST(BiasModes, BadParametersAreNamed) {
  const YAML::Node map = YAML::Load("{direct_time: 0.0, jump_share: 1.5, onset_sigma: -1.0, outlier_share: 0.6}");
  ParameterReader reader(map);
  BiasModeParameters p;
  EXPECT_EQ(reader.read(p).finish().size(), 4u);
}

}  // namespace
}  // namespace urban_gnss
