#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "switching_rig.hpp"
#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"
#include "urban_gnss_localization/localizers/switching/switching_particle_filter.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

SwitchingParticleFilterParameters switching(const std::string& changes = "{}") {
  return with(with(with(SwitchingParticleFilterParameters{}, "yaw_rate_scale_sigma: 0.0"), kTextbookNoise), changes);
}
SwitchingParticleFilter make(const std::string& changes = "{}") { return {switching(changes), {}}; }

/// Else std::clamp would be asked for a value between a low that is above the high.
TEST(SwitchingParticleFilter, ParametersAreCheckedDownToThoseOfRanges) {
  const auto faults_of = [](const char* yaml) {
    const YAML::Node map = YAML::Load(yaml);
    ParameterReader reader(map);
    SwitchingParticleFilterParameters parameters;
    reader.read(parameters);
    return reader.finish();
  };
  EXPECT_TRUE(faults_of("{range_sigma_min: 4.0, range_sigma_max: 4.0}").empty());
  const auto faults = faults_of("{range_sigma_min: 6.0, range_sigma_max: 5.0}");
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_NE(faults.front().find("range_sigma"), std::string::npos) << faults.front();
}

/// Up to the second fix, mixing and particles are the same: all that may have happened, with its moments.
TEST(SwitchingParticleFilter, FirstFixIsTheInteractingModels) {
  for (const char* changes :
       {"{}", "{student_dof: 2.0, bias_fade_time: 5.0}", "{outlier_share: 0.4, outlier_radius: 3.0}",
        "{direct_time: 1.0, jump_share: 0.3, shadow_sigma: 4.0}"}) {
    SwitchingParticleFilter particles = make(changes);
    ImmEkf imm(switching(changes).model, {});
    for (Localizer* filter : {static_cast<Localizer*>(&particles), static_cast<Localizer*>(&imm)}) {
      filter->initialize(pose_with_sigma({3.0, -1.0, 0.5}, 1.0, 0.1));
      for (int k = 0; k < 20; ++k) filter->move({2.0, 0.1}, 0.1);
      VelocityMeasurement velocity;
      velocity.antenna_velocity_in_body = {2.0, 0.2};
      velocity.velocity = {1.0, 1.7};
      velocity.covariance = isotropic(0.1);
      filter->correct_velocity(velocity);
      FixMeasurement fix = fix_of({9.0, 4.0}, 1.5, 2.0);
      fix.antenna_in_body = {1.0, -0.5};
      filter->correct(fix);
    }
    const BiasGaussian a = particles.mixture();
    const BiasGaussian b = imm.mixture();
    EXPECT_LT((a.mean - b.mean).norm(), 1e-2) << changes;  // but for what is negligible
    EXPECT_LT((a.covariance - b.covariance).norm(), 1e-2 * b.covariance.norm()) << changes;
    EXPECT_LT((particles.mode_probabilities() - imm.mode_probabilities()).norm(), 1e-3) << changes;
    EXPECT_GT(particles.hypotheses().size(), 1u);
  }
}

/// Where all particles of a mode are merged, what is left is imm_ekf, the plain reference of one step and of all.
TEST(SwitchingParticleFilter, MergedParticlesAreTheInteractingModels) {
  for (const char* changes :
       {"{}",
        "{student_dof: 2.0, bias_fade_time: 5.0, fix_scale_rate: 0.05, correlation_time: 2.0, wander_share: 0.4}"}) {
    SwitchingDrive d;
    d.bias = bias_between(40.0, 80.0, {15.0, -8.0});
    SwitchingParticleFilter particles(with(switching(changes), "merge_distance: 1.0e+12"), {});
    ImmEkf imm(switching(changes).model, {});
    const auto a = drive(particles, d);
    const auto b = drive(imm, d);
    for (std::size_t i = 0; i < a.size(); ++i) {
      // But for modes that are negligible, and left out at random.
      ASSERT_TRUE(near(a[i].estimate.pose, b[i].estimate.pose, 0.02)) << a[i].time_s;
      ASSERT_EQ(a[i].outcome.decision, b[i].outcome.decision) << a[i].time_s;
    }
  }
}

TEST(SwitchingParticleFilter, VelocityCorrectsAndWeighsHeadings) {
  SwitchingParticleFilter filter = make();
  filter.initialize(pose_with_sigma({}, 1.0, kPi));
  EXPECT_EQ(filter.hypotheses().size(), 99u);  // 33 headings, at each quality of the odometry
  EXPECT_GT(filter.health().heading_sigma_rad, 2.0);
  VelocityMeasurement velocity;
  velocity.antenna_velocity_in_body = {5.0, 0.0};
  velocity.velocity = {5.0 * std::cos(2.2), 5.0 * std::sin(2.2)};
  velocity.covariance = isotropic(0.1);
  for (int k = 0; k < 5; ++k) filter.correct_velocity(velocity);
  EXPECT_NEAR(filter.pose().yaw, 2.2, 0.05);
  EXPECT_LT(filter.health().heading_sigma_rad, 0.1);
  const Pose2 before = filter.pose();
  velocity.velocity.x() = kNaN;
  filter.correct_velocity(velocity);
  EXPECT_TRUE(filter.pose() == before);
}

TEST(SwitchingParticleFilter, NumberOfParticlesAdaptsItself) {
  SwitchingParticleFilter filter = make();
  SwitchingDrive d;
  d.bias = bias_between(40.0, 80.0, {4.0, -3.0});
  drive(filter, d);
  EXPECT_LT(filter.hypotheses().size(), 60u);
  EXPECT_EQ(filter.health().particle_count, filter.hypotheses().size());
  EXPECT_EQ(filter.particles().size(), filter.hypotheses().size());
  filter.initialize(pose_with_sigma({}, 1.0, kPi));
  EXPECT_EQ(filter.health().particle_count, 99u);
}

/// The slices together are the Gaussian that was given.
TEST(SwitchingParticleFilter, SlicesOfAHeadingAreTheStart) {
  SwitchingParticleFilter filter = make();
  PoseEstimate start = pose_with_sigma({1.0, 2.0, 3.0}, 1.0, 0.5);
  start.covariance(0, 2) = start.covariance(2, 0) = 0.3;
  filter.initialize(start);
  EXPECT_GT(filter.hypotheses().size(), 50u);
  const BiasGaussian all = filter.mixture();
  EXPECT_NEAR(all.mean[0], 1.0, 1e-3);
  EXPECT_NEAR(angle_difference(all.mean[2], 3.0), 0.0, 1e-3);
  EXPECT_LT((all.covariance.topLeftCorner<3, 3>() - start.covariance).norm(), 0.05);
}

/// Two fixes that contradict each other, of a robot that knows little of its place: one of them has a bias.
void see_two_places(SwitchingParticleFilter& filter) {
  filter.initialize(pose_with_sigma({}, 8.0, 0.1));
  filter.move({0.0, 0.0}, 1.0);
  filter.correct(fix_of({0.0, 0.0}, 0.2, 1.0));
  filter.correct(fix_of({15.0, 0.0}, 0.2, 2.0));
}
const char* const kOftenBiased = "{direct_time: 2.0, bias_end_time: 2.0, onset_sigma: 0.1}";

TEST(SwitchingParticleFilter, EstimateIsOfTheHeaviestCluster) {
  SwitchingParticleFilter filter = make(kOftenBiased);
  see_two_places(filter);
  const LocalizerHealth health = filter.health();
  EXPECT_GE(health.cluster_count, 2u);
  EXPECT_LT(health.cluster_mass, 0.95);
  const double x = filter.pose().x;
  EXPECT_TRUE(std::abs(x) < 1.0 || std::abs(x - 15.0) < 1.0) << x;
  // The other place is in the covariance.
  EXPECT_GT(std::sqrt(filter.estimate().covariance(0, 0)), 3.0);
  EXPECT_LT(std::sqrt(filter.estimate().covariance(1, 1)), 3.0);
  EXPECT_GT(health.position_spread_m, 3.0);
}

TEST(SwitchingParticleFilter, SameSeedSameNumbers) {
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
    ImmEkf imm(switching().model, {});
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

TEST(SwitchingParticleFilter, CovarianceIsHonest) {
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

TEST(SwitchingParticleFilter, FindsAnUnknownHeading) {
  SwitchingParticleFilter filter = make();
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
  const FixOutcome outcome = filter.correct(fix_of(before.position() + Eigen::Vector2d(1600.0, 0.0), 0.5, 120.5));
  EXPECT_EQ(outcome.decision, FixDecision::kInflated);
  EXPECT_LT((filter.pose().position() - before.position()).norm(), 0.3);
}

TEST(SwitchingParticleFilter, RefusesWhatIsNotFiniteAndSurvivesALongOutage) {
  SwitchingParticleFilter filter = make();
  drive(filter, {});
  const std::vector<BiasHypothesis> before = filter.hypotheses();
  FixMeasurement fix = fix_of({kNaN, 0.0}, 1.0, 121.0);
  EXPECT_EQ(filter.correct(fix).decision, FixDecision::kRejectedNonFinite);
  fix = fix_of({1.0, 0.0}, 1.0, kNaN);
  EXPECT_EQ(filter.correct(fix).decision, FixDecision::kRejectedNonFinite);
  fix.time_s = 121.0;
  fix.covariance.setZero();
  EXPECT_EQ(filter.correct(fix).decision, FixDecision::kRejectedNonFinite);
  filter.move({kNaN, 0.0}, 0.1);
  filter.move({1.0, 0.0}, -1.0);
  ASSERT_EQ(filter.hypotheses().size(), before.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(filter.hypotheses()[i].state.mean, before[i].state.mean);
    EXPECT_EQ(filter.hypotheses()[i].weight, before[i].weight);
  }
  EXPECT_THROW(filter.initialize(pose_with_sigma({0.0, kNaN, 0.0}, 1.0, 1.0)), std::invalid_argument);

  drive(filter, {});
  for (const double time_s : {1e6, 1e6 - 100.0, 1e12}) {
    filter.correct(fix_of(filter.pose().position() + Eigen::Vector2d(1.0, 0.0), 0.5, time_s));
    EXPECT_TRUE(is_finite(filter.pose()) && filter.estimate().covariance.allFinite()) << time_s;
    EXPECT_NEAR(filter.mode_probabilities().sum(), 1.0, 1e-9);
  }
}

TEST(SwitchingParticleFilter, FixThatNoParticleExplainsDoesNotAbort) {
  SwitchingParticleFilter filter = make("outlier_share: 0.0");
  filter.initialize(pose_with_sigma({}, 0.1, 0.1));
  filter.correct(fix_of({1e200, 0.0}, 1.0, 1.0));
  EXPECT_TRUE(is_finite(filter.pose()));
  filter.correct(fix_of({0.0, 0.0}, 1.0, 2.0));
  EXPECT_TRUE(is_finite(filter.pose()));
}

TEST(SwitchingParticleFilter, EveryParameterHasAnEffect) {
  std::vector<ParameterChange> changes = switching_model_changes();
  changes.insert(changes.end(), {
                                    {"max_particles: 3", "{}"},
                                    {"merge_distance: 5.0", "{}"},
                                    {"seed: 2", "{}"},
                                    {"velocity_scale_rate: 0.1", "{}"},
                                    {"velocity_scale_limit: 1.05", "{}"},
                                    {"first_velocity_scale: 1.0", "{}"},
                                    {"velocity_dof: 5.0", "{}"},
                                    {"velocity_correlation_time: 2.0", "{}"},
                                    {"estimate: mean", kOftenBiased},
                                    {"cluster_cell: 20.0", kOftenBiased},
                                });
  // Those of a parked robot, of changing declarations, and of the covariance alone; elsewhere,
  // those of ranges.
  EXPECT_EQ(changes.size() + 3 + parameter_names(CommonErrorParameters{}).size() +
                parameter_names(ReacquisitionParameters{}).size() + parameter_names(RangeFixParameters{}).size(),
            parameter_names(SwitchingParticleFilterParameters{}).size());
  SwitchingDrive d;
  d.bias = bias_between(10.0, 20.0, {4.0, 3.0});
  d.duration_s = 30.0;
  const auto last = [&](const SwitchingParticleFilterParameters& p) {
    SwitchingParticleFilter filter(p, {});
    drive(filter, d);
    VelocityMeasurement velocity;
    velocity.antenna_velocity_in_body = {1.5, 0.0};
    velocity.covariance = isotropic(0.1);
    for (int k = 0; k < 10; ++k) {
      velocity.velocity = {1.5 + 0.05 * k, -0.3};
      filter.correct_velocity(velocity);
    }
    const double x = filter.pose().x;
    see_two_places(filter);
    return Pose2{x, filter.pose().x, filter.pose().y};
  };
  for (const auto& [change, base] : changes) {
    const SwitchingParticleFilterParameters before = with(switching(), base);
    EXPECT_FALSE(last(with(before, change)) == last(before)) << change;
  }
}

}  // namespace
}  // namespace urban_gnss
