#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <map>

#include "switching_rig.hpp"
#include "urban_gnss_localization/filters/imm_ekf.hpp"
#include "urban_gnss_localization/filters/switching_particle_filter.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

ParticleFilterParameters switching(const std::string& changes = "{}") {
  return with(with(with(ParticleFilterParameters{}, "mode: switching"), kTextbookNoise), changes);
}
SwitchingParticleFilter make(const std::string& changes = "{}") { return {switching(changes), {}}; }

TEST(SwitchingParticleFilter, ArraysAgreeWithThePlainForm) {
  std::map<BiasMode, int> seen;
  for (const char* changes : {"{}", "{student_dof: 2.0, bias_fade_time: 5.0}",
                              "{outlier_share: 0.0, jump_share: 0.2, direct_time: 3.0, fast_bias_time: 2.0}",
                              "{outlier_share: 0.4, outlier_radius: 3.0, direct_time: 1.0, jump_share: 0.3}"}) {
    const ParticleFilterParameters p = with(switching(changes), "{particle_count: 400, shadow_sigma: 4.0}");
    const PoseEstimate start = pose_with_sigma({3.0, -1.0, 0.5}, 0.05, 0.02);  // close together: nothing is resampled
    SwitchingParticleFilter filter(p, {});
    filter.initialize(start);
    RandomEngine engine = make_engine(1);
    ParticleSet plain(400);
    plain.draw_gaussian(start, engine);
    std::vector<BiasMode> modes(400);
    std::vector<BiasState> biases(400);
    double last_s = 0.0;
    const std::pair<double, Eigen::Vector2d> fixes[] = {
        {0.0, {3.0, -1.0}}, {1.0, {6.0, 1.0}}, {2.5, {6.5, 1.5}}, {3.0, {3.0, -0.5}}, {30.0, {8.0, -5.0}}};
    for (const auto& [time_s, position] : fixes) {
      FixMeasurement fix = fix_of(position, 3.0, time_s);
      fix.antenna_in_body = {time_s, -0.5 * time_s};
      filter.correct(fix);
      const SwitchingFix as_seen{position, fix.antenna_in_body, 9.0, 16.0, time_s - last_s};
      last_s = time_s;
      const ModeTransition transition = mode_transition(as_seen.elapsed_s, p.modes);
      for (std::size_t i = 0; i < 400; ++i) {
        const ParticleContinuation next =
            continue_particle(plain.pose(i), modes[i], biases[i], as_seen, transition, p.modes, draw_uniform(engine));
        modes[i] = next.mode;
        biases[i] = next.bias;
        plain.log_weight[i] += next.log_likelihood;
        ++seen[next.mode];
      }
      ASSERT_TRUE(plain.normalise());
      ASSERT_GT(filter.effective_sample_size(), 200.0);
      for (std::size_t i = 0; i < 400; ++i) {
        ASSERT_EQ(filter.biases().mode[i], modes[i]) << i;
        ASSERT_LT((filter.biases().bias(i).mean - biases[i].mean).norm(), 1e-9) << i;
        ASSERT_NEAR(filter.biases().variance[i], biases[i].variance, 1e-9) << i;
        ASSERT_NEAR(filter.particles().weight[i], plain.weight[i], 1e-12) << i;
      }
    }
  }
  EXPECT_EQ(seen.size(), kLastingModes);  // every mode occurred
}

/// The sum over the continuations, against one density each and numerical integration over the bias.
TEST(SwitchingParticleFilter, LikelihoodIsTheIntegralOverTheBias) {
  BiasModeParameters p;
  p.outlier_share = 0.0;
  p.student_dof = 1e9;
  const BiasState bias{{4.0, -2.0}, 1.5};
  const SwitchingFix fix{{5.0, 0.5}, {0.0, 0.0}, 4.0, 9.0, 2.0};
  const ModeTransition t = mode_transition(fix.elapsed_s, p);
  double expected = 0.0;
  for (int j = 0; j < 4; ++j) {
    const auto to = static_cast<BiasMode>(j);
    const BiasState before = predict_bias(bias, BiasMode::kSlow, to, fix.elapsed_s, p);
    const double noise = j == 0 ? 4.0 : 9.0;
    double axis[2];
    for (int a = 0; a < 2; ++a) {
      if (before.variance == 0.0) {
        axis[a] = std::exp(-0.5 * fix.position[a] * fix.position[a] / noise) / std::sqrt(2.0 * kPi * noise);
        continue;
      }
      axis[a] = 0.0;
      const double sigma = std::sqrt(before.variance);
      for (double u = -8.0; u < 8.0; u += 0.001) {
        const double d = fix.position[a] - before.mean[a] - sigma * u;
        axis[a] += 0.001 * std::exp(-0.5 * u * u - 0.5 * d * d / noise) / (2.0 * kPi * std::sqrt(noise));
      }
    }
    expected += t(1, j) * axis[0] * axis[1];
  }
  EXPECT_NEAR(continue_particle({}, BiasMode::kSlow, bias, fix, t, p, 0.5).log_likelihood, std::log(expected), 1e-6);
}

TEST(SwitchingParticleFilter, SameSeedSameNumbersF26) {
  SwitchingDrive d;
  d.bias = bias_between(20.0, 40.0, {10.0, 5.0});
  d.duration_s = 50.0;
  SwitchingParticleFilter filter = make();
  const Pose2 first = drive(filter, d).back().estimate.pose;
  EXPECT_TRUE(drive(filter, d).back().estimate.pose == first);  // initialize() starts the random numbers anew
  SwitchingParticleFilter other = make("seed: 2");
  EXPECT_FALSE(drive(other, d).back().estimate.pose == first);
  EXPECT_EQ(filter.mode(), "switching");
  EXPECT_FALSE(filter.wants_bias());
}

TEST(SwitchingParticleFilter, FindsABiasThatComesAtOnceAndItsEnd) {
  SwitchingParticleFilter filter = make();
  SwitchingDrive d;
  d.bias = bias_between(40.0, 80.0, {15.0, -8.0});
  const auto steps = drive(filter, d);
  EXPECT_LT(rmse_between(steps, 20.0, 40.0), 0.6);
  EXPECT_LT(rmse_between(steps, 40.0, 80.0), 1.5);
  EXPECT_LT(rmse_between(steps, 90.0, 120.0), 1.0);
}

/// Two ways to compute one posterior.
TEST(SwitchingParticleFilter, AgreesWithTheInteractingModels) {
  for (std::uint64_t seed = 101; seed < 104; ++seed) {
    SwitchingDrive d;
    d.seed = seed;
    d.bias = bias_between(40.0, 80.0, {6.0, 12.0});
    SwitchingParticleFilter particles = make();
    ImmEkf imm(with(ImmEkfParameters{}, kTextbookNoise), {});
    const auto a = drive(particles, d);
    const auto b = drive(imm, d);
    double squares = 0.0;
    double spread = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      squares += (a[i].estimate.pose.position() - b[i].estimate.pose.position()).squaredNorm();
      spread += b[i].estimate.covariance.topLeftCorner<2, 2>().trace();
    }
    EXPECT_LT(squares, 0.5 * spread) << seed;
  }
}

TEST(SwitchingParticleFilter, CovarianceIsHonestF14) {
  double sum = 0.0;
  int count = 0;
  for (std::uint64_t seed = 101; seed < 111; ++seed) {
    SwitchingDrive d;
    d.seed = seed;
    RandomEngine engine = make_engine(seed, 7);
    d.errors = {0.03 * draw_normal(engine), 0.005 * draw_normal(engine)};
    const double direction = uniform_between(-kPi, kPi, engine);
    d.bias = bias_between(40.0, 90.0, 20.0 * Eigen::Vector2d(std::cos(direction), std::sin(direction)));
    SwitchingParticleFilter filter = make();
    for (const auto& step : drive(filter, d)) {
      sum += step.nees / 3.0;
      ++count;
    }
  }
  EXPECT_GT(sum / count, 0.3);
  EXPECT_LT(sum / count, 1.6);
}

TEST(SwitchingParticleFilter, FindsAnUnknownHeadingF16) {
  SwitchingParticleFilter filter = make("particle_count: 4000");
  PoseEstimate start = pose_with_sigma({}, 1.0, kPi);
  filter.initialize(start);
  RandomEngine engine = make_engine(5);
  Pose2 truth{0.0, 0.0, 2.2};
  for (int k = 1; k <= 300; ++k) {
    truth = move(truth, {1.5, 0.05}, 0.1);
    filter.move({1.5, 0.05}, 0.1);
    if (k % 5 != 0) continue;
    const double east = 0.5 * draw_normal(engine);
    const double north = 0.5 * draw_normal(engine);
    filter.correct(fix_of(truth.position() + Eigen::Vector2d(east, north), 0.5, 0.1 * k));
  }
  EXPECT_LT((filter.pose().position() - truth.position()).norm(), 1.0);
  EXPECT_LT(std::abs(angle_difference(filter.pose().yaw, truth.yaw)), 0.15);
}

TEST(SwitchingParticleFilter, ASpikeSaysNothing) {
  SwitchingParticleFilter filter = make();
  drive(filter, {});
  const Pose2 before = filter.pose();
  const FixVerdict verdict = filter.correct(fix_of(before.position() + Eigen::Vector2d(1600.0, 0.0), 0.5, 120.5));
  EXPECT_EQ(verdict.decision, FixDecision::kInflated);
  EXPECT_LT((filter.pose().position() - before.position()).norm(), 0.3);
}

TEST(SwitchingParticleFilter, RefusesWhatIsNotFiniteAndSurvivesALongOutage) {
  SwitchingParticleFilter filter = make();
  drive(filter, {});
  const ParticleSet before = filter.particles();
  FixMeasurement fix = fix_of({kNaN, 0.0}, 1.0, 121.0);
  EXPECT_EQ(filter.correct(fix).decision, FixDecision::kRejectedNonFinite);
  fix = fix_of({1.0, 0.0}, 1.0, kNaN);
  EXPECT_EQ(filter.correct(fix).decision, FixDecision::kRejectedNonFinite);
  fix.time_s = 121.0;
  fix.covariance.setZero();
  EXPECT_EQ(filter.correct(fix).decision, FixDecision::kRejectedNonFinite);
  filter.move({kNaN, 0.0}, 0.1);
  filter.move({1.0, 0.0}, -1.0);
  EXPECT_EQ(filter.particles().x, before.x);
  EXPECT_EQ(filter.particles().weight, before.weight);
  EXPECT_THROW(filter.initialize(pose_with_sigma({0.0, kNaN, 0.0}, 1.0, 1.0)), std::invalid_argument);

  drive(filter, {});
  for (const double time_s : {1e6, 1e6 - 100.0, 1e12}) {
    filter.correct(fix_of(filter.pose().position() + Eigen::Vector2d(1.0, 0.0), 0.5, time_s));
    EXPECT_TRUE(is_finite(filter.pose()) && filter.estimate().covariance.allFinite()) << time_s;
    EXPECT_NEAR(filter.mode_probabilities().sum(), 1.0, 1e-9);
  }
}

TEST(SwitchingParticleFilter, FixThatNoParticleExplainsDoesNotAbortF30) {
  SwitchingParticleFilter filter = make("outlier_share: 0.0");
  filter.initialize(pose_with_sigma({}, 0.1, 0.1));
  filter.correct(fix_of({1e200, 0.0}, 1.0, 1.0));
  EXPECT_TRUE(is_finite(filter.pose()));
  filter.correct(fix_of({0.0, 0.0}, 1.0, 2.0));
  EXPECT_TRUE(is_finite(filter.pose()));
}

TEST(SwitchingParticleFilter, EveryParameterHasAnEffectF36) {
  const std::vector<std::pair<std::string, std::string>> changes = {
      {"particle_count: 290", "{}"},
      {"use_fix_covariance: false", "{}"},
      {"direct_sigma: 1.0", "{}"},
      {"shadow_sigma: 1.0", "{}"},
      {"estimate: mean", "cluster_cell: 0.1"},
      {"cluster_cell: 0.1", "{}"},
      {"seed: 2", "{}"},
      {"direct_time: 20.0", "{}"},
      {"slow_bias_time: 5.0", "{}"},
      {"fast_bias_time: 3.0", "{}"},
      {"bias_end_time: 5.0", "{}"},
      {"jump_share: 0.5", "{}"},
      {"slow_bias_walk: 0.5", "{}"},
      {"fast_bias_walk: 3.0", "{}"},
      {"jump_sigma: 5.0", "{}"},
      {"onset_sigma: 1.0", "{}"},
      {"outlier_share: 0.1", "{}"},
      {"outlier_radius: 20.0", "{}"},
      {"motion_noise_factor: 1.0", "{}"},
      {"speed_scale_sigma: 0.01", "{}"},
      {"speed_scale_walk: 0.01", "{}"},
      {"yaw_rate_bias_sigma: 0.01", "{}"},
      {"yaw_rate_bias_walk: 0.001", "{}"},
      {"position_walk: 0.2", "{}"},
      {"heading_walk: 0.05", "{}"},
      {"bias_fade_time: 5.0", "{}"},
      {"student_dof: 2.0", "{}"},
      {"fix_scale_rate: 0.1", "{}"},
      {"fix_scale_limit: 1.05", "fix_scale_rate: 0.1"},
      {"fix_correlation_time: 2.0", "{}"},
  };
  SwitchingDrive d;
  d.bias = bias_between(10.0, 20.0, {4.0, 3.0});
  d.duration_s = 30.0;
  const auto last = [&](const ParticleFilterParameters& p) {
    SwitchingParticleFilter filter(p, {});
    return drive(filter, d).back().estimate.pose;
  };
  for (const auto& [change, base] : changes) {
    const ParticleFilterParameters before = with(switching("particle_count: 300"), base);
    EXPECT_FALSE(last(with(before, change)) == last(before)) << change;
  }
}

TEST(SwitchingParticleFilter, TheModeChoosesTheFilter) {
  for (const char* mode : {"literal", "paper", "conventional", "switching"}) {
    const auto filter = make_particle_filter(with(ParticleFilterParameters{}, std::string("mode: ") + mode), {});
    EXPECT_EQ(filter->mode(), mode);
    EXPECT_EQ(dynamic_cast<SwitchingParticleFilter*>(filter.get()) != nullptr, mode == std::string("switching"));
  }
}

}  // namespace
}  // namespace urban_gnss
