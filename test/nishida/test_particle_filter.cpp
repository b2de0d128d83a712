#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <new>
#include <utility>

#include "matchers.hpp"
#include "urban_gnss_localization/gnss/chi_squared.hpp"
#include "urban_gnss_localization/localizers/nishida/particle_filter.hpp"

namespace {
std::atomic<std::size_t> allocations{0};  ///< of this program so far
}

void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace urban_gnss {
namespace {

constexpr Twist2 kTwist{2.0, 0.3};
constexpr double kStep_s = 0.1;

FixMeasurement fix_at(double time_s, const Eigen::Vector2d& position, double sigma, double radius_m = 0.0) {
  FixMeasurement fix;
  fix.position = position;
  fix.covariance = isotropic(sigma);
  fix.bias_radius_m = radius_m;
  fix.time_s = time_s;
  return fix;
}

/// Ten seconds on an arc with a fix of 2 m every half second, the same for every filter: its estimates after each.
/// From 6 s on the fixes lie 30 m aside.
std::vector<Pose2> drive(ParticleFilter& filter, const Pose2& frame = {}) {
  RandomEngine noise = make_engine(99);
  Pose2 truth{1.0, -2.0, 0.5};
  filter.initialize(pose_with_sigma(compose(frame, truth), 1.0, 0.2));
  std::vector<Pose2> estimates;
  for (int k = 1; k <= 100; ++k) {
    truth = move(truth, kTwist, kStep_s);
    filter.move(kTwist, kStep_s);
    if (k % 5 == 0) {
      const double east = draw_normal(noise), north = draw_normal(noise);
      const double aside = k >= 60 ? 30.0 : 0.0;
      const Eigen::Vector2d place = truth.position() + Eigen::Vector2d(2.0 * east + aside, 2.0 * north);
      filter.correct(fix_at(k * kStep_s, transform_point(frame, place), 2.0, k >= 60 ? 30.0 : 1.0));
    }
    estimates.push_back(filter.pose());
  }
  return estimates;
}

std::vector<Pose2> drive(const ParticleFilterParameters& parameters, const MotionParameters& motion = {}) {
  ParticleFilter filter(parameters, motion);
  return drive(filter);
}

ParticleFilterParameters small(const std::string& yaml = "{}") {
  ParticleFilterParameters parameters;
  parameters.particle_count = 300;
  return with(parameters, yaml);
}

TEST(ParticleFilter, SameSeedSameNumbers) {
  for (const char* mode : {"mode: literal", "mode: paper", "mode: conventional"}) {
    ParticleFilter filter(small(mode), {});
    const std::vector<Pose2> first = drive(filter);
    EXPECT_TRUE(drive(filter) == first) << mode;  // initialize starts the random numbers anew, too
    EXPECT_TRUE(drive(small(mode)) == first) << mode;
    ParticleFilterParameters other = small(mode);
    other.seed = 2;
    EXPECT_FALSE(drive(other) == first) << mode;
  }
}

TEST(ParticleFilter, ModesMeanWhatTheySay) {
  const auto form = [](const std::string& yaml) { return with(ParticleFilterParameters{}, yaml).likelihood_form(); };
  const auto heading = [](const std::string& yaml) {
    return with(ParticleFilterParameters{}, yaml).uses_gps_heading();
  };
  EXPECT_EQ(form("mode: literal"), LikelihoodForm::kPrinted);
  EXPECT_EQ(form("mode: conventional"), LikelihoodForm::kPrinted);
  EXPECT_EQ(form("mode: paper"), LikelihoodForm::kProduct);
  EXPECT_EQ(form("{mode: paper, likelihood: sum}"), LikelihoodForm::kSum);
  EXPECT_TRUE(heading("mode: literal"));
  EXPECT_TRUE(heading("{mode: paper, likelihood: sum}"));
  EXPECT_FALSE(heading("mode: paper"));
  EXPECT_TRUE(heading("{mode: paper, use_gps_heading: always}"));
  EXPECT_FALSE(heading("{mode: literal, use_gps_heading: never}"));
  EXPECT_FALSE(ParticleFilter(small("mode: conventional"), {}).wants_bias());
  EXPECT_TRUE(ParticleFilter(small("mode: paper"), {}).wants_bias());
  EXPECT_EQ(ParticleFilter(small("mode: literal"), {}).mode(), "literal");
  const auto averages = [](const std::string& yaml) { return with(ParticleFilterParameters{}, yaml).averages_all(); };
  EXPECT_TRUE(averages("mode: literal"));
  EXPECT_TRUE(averages("mode: conventional"));
  EXPECT_FALSE(averages("mode: paper"));
  EXPECT_TRUE(averages("{mode: paper, estimate: mean}"));
  EXPECT_FALSE(averages("{mode: literal, estimate: heaviest_cluster}"));
  const auto printed = [](const std::string& yaml) { return ParticleFilter(small(yaml), {}).is_as_printed(); };
  EXPECT_TRUE(printed("mode: literal"));
  EXPECT_TRUE(printed("mode: conventional"));
  EXPECT_FALSE(printed("{mode: conventional, likelihood: product}"));
  EXPECT_FALSE(printed("{mode: paper, likelihood: printed}"));
}

/// Eq. (27) to (33), or (47) without a radius, typed out from the text.
double printed_likelihood(const Pose2& p, const Eigen::Vector2d& fix, double fix_heading, double radius, double sb,
                          double ss, double sp, bool with_shadow) {
  const auto term = [](double d, double sigma) {
    return std::exp(-d * d / (2.0 * sigma * sigma)) / (2.0 * M_PI * sigma * sigma);
  };
  const double heading = std::remainder(p.yaw - fix_heading, 2.0 * M_PI);
  const double direct = 2.0 / 3.0 * (term(p.x - fix.x(), sb) + term(p.y - fix.y(), sb)) + 1.0 / 3.0 * term(heading, sp);
  const double shadow = 2.0 / 3.0 * term((p.position() - fix).norm() - radius, ss) + 1.0 / 3.0 * term(heading, sp);
  return with_shadow ? 0.5 * direct + 0.5 * shadow : direct;
}

// Lines 5 to 9 of Algorithm 1 from the text: the defaults of a robot, with a mode alone.
TEST(ParticleFilter, LiteralAndConventionalAreAlgorithm1AsPrinted) {
  for (const char* mode : {"mode: literal", "mode: conventional"}) {
    ParticleFilterParameters parameters = small(mode);
    parameters.ring_share = 0.0;  // whose draws a test of the ring examines
    MotionParameters motion;
    motion.odom_noise_scale = 0.0;
    ParticleFilter filter(parameters, motion);
    filter.initialize(pose_with_sigma({3.0, 4.0, 0.8}, 2.0, 0.3));
    std::vector<Pose2> poses;
    for (std::size_t i = 0; i < filter.particles().size(); ++i) poses.push_back(filter.particles().pose(i));
    std::vector<double> weights(poses.size(), 1.0 / static_cast<double>(poses.size()));
    Eigen::Vector2d last = filter.pose().position();
    for (int k = 1; k <= 3; ++k) {
      filter.move(kTwist, kStep_s);
      const Eigen::Vector2d fix(3.0 + 0.4 * k, 4.3);
      const double radius = 1.5 * k;
      // A fix that claims to be far better, or farther off than a gate would let pass, changes nothing.
      filter.correct(fix_at(k * kStep_s, fix, k == 2 ? 0.01 : 100.0, radius));
      const double fix_heading = std::atan2(fix.y() - last.y(), fix.x() - last.x()) + kTwist.yaw_rate_radps * kStep_s;
      double sum = 0.0;
      for (std::size_t i = 0; i < poses.size(); ++i) {
        poses[i] = move(poses[i], kTwist, kStep_s);
        weights[i] *= printed_likelihood(poses[i], fix, fix_heading, radius, 3.0, 3.0, 0.1, filter.wants_bias());
        sum += weights[i];
      }
      Pose2 mean;
      double squares = 0.0;
      for (std::size_t i = 0; i < poses.size(); ++i) {
        const double w = weights[i] /= sum;
        mean.x += w * poses[i].x;
        mean.y += w * poses[i].y;
        mean.yaw += w * poses[i].yaw;  // none is near +-pi
        squares += w * w;
      }
      // Places and weights are floats: roundings of 1e-6 of the 10 m within which the particles lie, and of 1.
      EXPECT_TRUE(near(filter.pose(), mean, 1e-5)) << mode << ' ' << k;
      EXPECT_NEAR(filter.effective_sample_size() * squares, 1.0, 1e-5) << mode << ' ' << k;
      last = mean.position();
    }
    EXPECT_GT(filter.effective_sample_size(), 5.0);  // or it was drawn anew
  }
}

TEST(ParticleFilter, AsPrintedHasNoGate) {
  for (const char* mode : {"mode: literal", "mode: conventional"}) {
    ParticleFilter filter(small(mode), {});
    filter.initialize(pose_with_sigma({0.0, 0.0, 1.0}, 1.0, 0.1));
    for (int k = 1; k <= 10; ++k) {
      EXPECT_FALSE(is_rejected(filter.correct(fix_at(k, {300.0, 400.0}, 2.0, 500.0)).decision)) << mode;
    }
  }
}

TEST(ParticleFilter, DoubtSpreadsTheParticles) {
  ParticleFilter filter(small("mode: paper"), {});
  filter.initialize(pose_with_sigma({0.0, 0.0, 1.0}, 1.0, 0.1));
  const std::vector<float> before = filter.particles().x;
  filter.doubt({9.0, 1.0});
  EXPECT_NE(filter.particles().x, before);
}

TEST(ParticleFilter, EveryParameterHasAnEffect) {
  // What is changed, and against which other parameters.
  const std::vector<std::pair<std::string, std::string>> changes = {
      {"mode: literal", "{}"},
      {"particle_count: 290", "{}"},
      {"ring_share: 0.2", "{}"},
      {"likelihood: sum", "{}"},
      {"use_gps_heading: always", "{}"},
      {"use_fix_covariance: false", "{}"},
      {"direct_sigma: 1.0", "use_fix_covariance: false"},
      {"shadow_sigma: 1.0", "{}"},
      {"gps_heading_sigma: 1.0", "use_gps_heading: always"},
      {"ess_threshold: 150.0", "{}"},
      {"resampling: systematic", "ess_threshold: 150.0"},
      {"estimate: mean", "{}"},
      {"cluster_cell: 0.3", "{}"},
      {"gate_probability: 0.5", "{mode: conventional, likelihood: product}"},
      {"gate_timeout: 2.0", "{mode: conventional, likelihood: product}"},
      {"seed: 2", "{}"},
  };
  EXPECT_EQ(changes.size(), parameter_names(ParticleFilterParameters{}).size());
  for (const auto& [change, base] : changes) {
    EXPECT_FALSE(drive(with(small(base), change)) == drive(small(base))) << change;
  }
}

TEST(ParticleFilter, EveryMotionParameterHasAnEffect) {
  const std::vector<std::pair<std::string, std::string>> changes = {
      {"motion_model: bicycle", "{}"}, {"wheelbase: 2.0", "motion_model: bicycle"},
      {"odom_alpha1: 0.002", "{}"},    {"odom_alpha2: 0.002", "{}"},
      {"odom_alpha3: 0.002", "{}"},    {"odom_alpha4: 0.002", "{}"},
      {"odom_alpha5: 0.002", "{}"},    {"odom_alpha6: 0.002", "{}"},
      {"odom_noise_scale: 2.0", "{}"}, {"odom_noise_interval: 0.5", "{}"}};
  EXPECT_EQ(changes.size(), parameter_names(MotionParameters{}).size());
  for (const auto& [change, base] : changes) {
    const MotionParameters motion = with(MotionParameters{}, base);
    EXPECT_FALSE(drive(small(), with(motion, change)) == drive(small(), motion)) << change;
  }
}

TEST(ParticleFilter, ParkedRobotWithGoodFixesStaysWhereItIs) {
  for (const char* mode : {"{mode: conventional, likelihood: product}", "{mode: paper, shadow_sigma: 1.0}"}) {
    ParticleFilterParameters parameters = with(ParticleFilterParameters{}, mode);
    ParticleFilter filter(parameters, {});
    RandomEngine noise = make_engine(7);
    const Pose2 truth{10.0, 20.0, 1.0};
    filter.initialize(pose_with_sigma(truth, 1.0, 0.1));
    for (int k = 1; k <= 20; ++k) {
      filter.move({0.0, 0.0}, 1.0);
      const double east = 0.5 * draw_normal(noise), north = 0.5 * draw_normal(noise);
      EXPECT_FALSE(
          is_rejected(filter.correct(fix_at(k, truth.position() + Eigen::Vector2d(east, north), 0.5)).decision));
    }
    // Twenty fixes of 0.5 m leave 0.11 m; 4.5 of that, and the heading nothing but its start.
    EXPECT_LT((filter.pose().position() - truth.position()).norm(), 0.5) << mode;
    EXPECT_LT(std::abs(angle_difference(filter.pose().yaw, 1.0)), 0.45) << mode;
    EXPECT_LT(std::sqrt(filter.estimate().covariance(0, 0)), 1.0);
    EXPECT_GT(filter.health().cluster_mass, 0.5);
  }
}

/// Root mean square error over 20 s in a shadow whose bias grows to 4 m along x in 4 s and stays; its length is known.
double error_in_shadow(const std::string& mode, std::uint64_t seed) {
  ParticleFilterParameters parameters = with(ParticleFilterParameters{}, mode);
  parameters.fix.direct_sigma = 0.1;
  parameters.fix.shadow_sigma = 0.3;
  parameters.cluster_cell = 0.5;
  parameters.seed = static_cast<int>(seed);
  MotionParameters motion;
  ParticleFilter filter(parameters, motion);
  RandomEngine noise = make_engine(seed, 1);
  Pose2 truth;
  filter.initialize(pose_with_sigma(truth, 0.1, 0.02));
  double squares = 0.0;
  for (int k = 1; k <= 200; ++k) {
    truth = move(truth, kTwist, kStep_s);
    filter.move(kTwist, kStep_s);
    const double bias = std::min(0.1 * k, 4.0);
    const double east = draw_normal(noise), north = draw_normal(noise);
    filter.correct(fix_at(k * kStep_s, truth.position() + Eigen::Vector2d(bias + 0.3 * east, 0.3 * north), 0.1, bias));
    squares += (filter.pose().position() - truth.position()).squaredNorm() / 200.0;
  }
  return std::sqrt(squares);
}

TEST(ParticleFilter, KeepsTheTruthInABiasedShadowWhereTheConventionalFilterFollowsTheFix) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const double conventional =
        error_in_shadow("{mode: conventional, likelihood: product, gate_probability: 1.0}", seed);
    const double paper = error_in_shadow("{mode: paper, ring_share: 0.01}", seed);
    EXPECT_GT(conventional, 2.0) << seed;  // it follows the fix, which is 4 m off for 16 of 20 s
    EXPECT_LT(paper, 0.5 * conventional) << seed;
  }
}

TEST(ParticleFilter, ConventionalGateRejectsAJumpThenRestartsOnIt) {
  ParticleFilter filter(with(ParticleFilterParameters{}, "{mode: conventional, likelihood: product}"), {});
  filter.initialize(pose_with_sigma({0.0, 0.0, 1.0}, 1.0, 0.1));
  for (int k = 1; k <= 10; ++k) EXPECT_EQ(filter.correct(fix_at(k, {0.0, 0.0}, 2.0)).decision, FixDecision::kAccepted);
  const Pose2 before = filter.pose();
  for (int k = 11; k < 15; ++k) {
    const FixOutcome outcome = filter.correct(fix_at(k, {300.0, 400.0}, 2.0));
    EXPECT_EQ(outcome.decision, FixDecision::kRejectedGate);
    EXPECT_NEAR(outcome.nis_threshold, chi_squared_quantile(0.99, 2), 1e-9);
    EXPECT_GT(outcome.nis, outcome.nis_threshold);
    EXPECT_EQ(filter.pose(), before);
  }
  const FixOutcome outcome = filter.correct(fix_at(15, {300.0, 400.0}, 2.0));
  EXPECT_FALSE(is_rejected(outcome.decision));
  EXPECT_NE(outcome.reason, "");
  EXPECT_LT((filter.pose().position() - Eigen::Vector2d(300.0, 400.0)).norm(), 1.0);
  EXPECT_NEAR(filter.pose().yaw, 1.0, 0.1);  // the heading is kept
}

TEST(ParticleFilter, LeverArmAndLatenessAreInTheAntennasPlace) {
  // Two metres ahead of the base is where the fix belongs: the base is two metres behind it, whatever the heading.
  for (const double yaw : {0.0, 2.0, -2.5}) {
    ParticleFilter filter(with(ParticleFilterParameters{}, "{mode: conventional, likelihood: product}"), {});
    filter.initialize(pose_with_sigma({0.0, 0.0, yaw}, 3.0, 0.01));
    FixMeasurement fix = fix_at(1.0, {1.0, 1.0}, 0.3);
    fix.antenna_in_body = {2.0, 0.0};
    filter.correct(fix);
    const Pose2& pose = filter.pose();
    // 1000 particles of 3 m, of which some ten lie within the fix's 0.3 m: their mean has a sigma of 0.1 m.
    EXPECT_NEAR(pose.x + 2.0 * std::cos(yaw), 1.0, 0.45);
    EXPECT_NEAR(pose.y + 2.0 * std::sin(yaw), 1.0, 0.45);
  }
}

TEST(ParticleFilter, HeadingOfTheFixCountsTheTurnSinceTheLastEq12) {
  MotionParameters no_noise;
  no_noise.odom_noise_scale = 0.0;
  ParticleFilter filter(
      with(ParticleFilterParameters{}, "{mode: conventional, likelihood: product, use_gps_heading: always}"), no_noise);
  filter.initialize(pose_with_sigma({0.0, 0.0, 0.3}, 0.01, 0.5));
  for (int k = 0; k < 5; ++k) filter.move({0.0, 1.0}, 0.1);
  filter.correct(fix_at(1.0, {2.0, 0.0}, 10.0));
  // Prior 0.8 +- 0.5 rad, and 0 + 0.5 rad +- 0.1 from the fix. The mean of some 200 particles has a sigma of 0.007.
  EXPECT_NEAR(filter.pose().yaw, (0.8 / 0.25 + 0.5 / 0.01) / (1.0 / 0.25 + 1.0 / 0.01), 0.035);
}

TEST(ParticleFilter, FixThatNoParticleExplainsDoesNotAbort) {
  ParticleFilter filter(small(), {});
  filter.initialize(pose_with_sigma({1.0, 2.0, 0.5}, 1.0, 0.1));
  const FixOutcome outcome = filter.correct(fix_at(1.0, {1e200, 0.0}, 1.0));
  EXPECT_EQ(outcome.decision, FixDecision::kRejectedDegenerate);
  EXPECT_TRUE(is_finite(filter.pose()));
  EXPECT_TRUE(filter.estimate().covariance.allFinite());
  EXPECT_FALSE(is_rejected(filter.correct(fix_at(2.0, {1.0, 2.0}, 1.0)).decision));
  EXPECT_LT((filter.pose().position() - Eigen::Vector2d(1.0, 2.0)).norm(), 1.5);
}

TEST(ParticleFilter, ResamplesBelowItsThresholdOnly) {
  for (const double threshold : {0.0, 300.0}) {
    ParticleFilterParameters parameters = small();
    parameters.ess_threshold = threshold;
    ParticleFilter filter(parameters, {});
    filter.initialize(pose_with_sigma({}, 1.0, 0.1));
    filter.correct(fix_at(1.0, {0.5, 0.0}, 1.0));
    EXPECT_GT(filter.effective_sample_size(), 1.0);
    EXPECT_LT(filter.effective_sample_size(), 299.0);
    EXPECT_EQ(effective_sample_size(filter.particles()) > 299.999, threshold > 0.0);
    EXPECT_EQ(filter.health().effective_sample_size, filter.effective_sample_size());
    EXPECT_EQ(filter.health().particle_count, 300u);
  }
}

// Without a ring (its angles are drawn in the map) and with a start that is a point, every draw is in the robot's
// frame: the whole run turns and shifts with the map.
TEST(ParticleFilter, CommutesWithRotationAndTranslation) {
  ParticleFilterParameters parameters = small("{ring_share: 0.0, estimate: mean}");
  const auto run = [&](const Pose2& frame) {
    ParticleFilter filter(parameters, {});
    RandomEngine noise = make_engine(98);
    Pose2 truth{1.0, -2.0, 0.5};
    filter.initialize(pose_with_sigma(compose(frame, truth), 0.0, 0.3));
    Eigen::Matrix2d covariance;
    covariance << 4.0, 1.0, 1.0, 2.0;
    const Eigen::Matrix2d rotation = Eigen::Rotation2Dd(frame.yaw).toRotationMatrix();
    for (int k = 1; k <= 40; ++k) {
      truth = move(truth, kTwist, 0.5);
      filter.move(kTwist, 0.5);
      const double east = draw_normal(noise), north = draw_normal(noise);
      const Eigen::Vector2d place = truth.position() + Eigen::Vector2d(east, north);
      FixMeasurement fix = fix_at(0.5 * k, transform_point(frame, place), 1.0, 1.0);
      fix.covariance = rotation * covariance * rotation.transpose();
      filter.correct(fix);
    }
    return filter.pose();
  };
  const Pose2 plain = run({});
  RandomEngine engine = make_engine(5);
  for (int trial = 0; trial < 5; ++trial) {
    const Pose2 frame = random_pose(engine, 100.0);
    EXPECT_TRUE(near(run(frame), compose(frame, plain), 1e-4));  // 40 roundings of floats of 16 m
  }
}

TEST(ParticleFilter, RingCommutesWithTranslation) {
  ParticleFilter here(small("estimate: mean"), {}), there(small("estimate: mean"), {});
  const Pose2 frame{1000.0, -2000.0, 0.0};
  const std::vector<Pose2> plain = drive(here);
  const std::vector<Pose2> moved = drive(there, frame);
  for (std::size_t k = 0; k < plain.size(); ++k) ASSERT_TRUE(near(moved[k], compose(frame, plain[k]), 1e-4)) << k;
}

// A float of 10 km has steps of 1 mm: particles that counted from the datum would stand still at 0.05 mm a step.
TEST(ParticleFilter, CreepsTenKilometresFromTheDatum) {
  MotionParameters no_noise;
  no_noise.odom_noise_scale = 0.0;
  ParticleFilter filter(small("estimate: mean"), no_noise);
  const Pose2 start{10000.0, -10000.0, 0.5};
  filter.initialize(pose_with_sigma(start, 1.0, 0.0));
  const Pose2 before = circular_mean(filter.particles());
  for (int k = 0; k < 1000; ++k) filter.move({0.005, 0.0}, 0.01);
  // A thousand roundings of at most 2e-7, in places of up to 4 m.
  EXPECT_TRUE(near(circular_mean(filter.particles()), move(before, {0.05, 0.0}, 1.0), 2e-4));
  for (int k = 0; k < 1000; ++k) filter.move({10.0, 0.0}, 0.01);
  EXPECT_LT(filter.particles().origin.x(), 10100.0);
  EXPECT_LT((filter.particles().origin - filter.pose().position()).norm(), 16.2);  // it came along
  EXPECT_TRUE(near(circular_mean(filter.particles()), move(before, {100.05, 0.0}, 1.0), 2e-3));
}

TEST(ParticleFilter, AllocatesNothingInAStep) {
  for (const char* yaml : {"mode: literal", "mode: conventional", "mode: paper", "resampling: systematic",
                           "{use_gps_heading: always, estimate: mean}"}) {
    ParticleFilterParameters parameters = small(yaml);
    parameters.ess_threshold = 300.0;  // drawn anew at each fix
    ParticleFilter filter(parameters, {});
    filter.initialize(pose_with_sigma({}, 1.0, 0.1));
    filter.move(kTwist, kStep_s);
    FixMeasurement fix = fix_at(1.0, {0.5, 0.0}, 1.0, 1.0);
    fix.antenna_in_body = {0.3, 0.1};
    filter.correct(fix);
    const std::size_t before = allocations;
    for (int k = 0; k < 10; ++k) {
      filter.move(kTwist, kStep_s);
      fix.time_s += 1.0;
      filter.correct(fix);
      filter.estimate();
      filter.health();
    }
    EXPECT_EQ(allocations, before) << yaml;
    EXPECT_LT(filter.effective_sample_size(), 299.0) << yaml;
  }
}

// What one processor computes is what all compute, with vectors of any width: of arithmetic whose roundings are those
// of the standard, in an order that does not depend on the width.
TEST(ParticleFilter, SameNumbersOnEveryProcessor) {
  ParticleSet particles(1001);
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const double part = static_cast<double>(i) / 1024.0;
    particles.set_pose(i, {4.0 * part - 2.0, 1.0 - 2.0 * part, 6.0 * part - 3.0});
  }
  MotionStep step;
  step.twist = {2.0, 0.25, 0.5};
  step.duration_s = 0.125;
  step.speed_sigma = step.input_sigma = step.yaw_rate_sigma = 0.25;
  FixLikelihood fix;
  fix.fix = {1.0, 0.5};
  fix.antenna_in_body = {0.5, 0.25};
  fix.radius = 2.0;
  fix.with_heading = true;
  RingSampler ring(particles.size(), 0.05);
  Resampler resampler(particles.size(), ResamplingScheme::kMultinomial);
  for (std::uint64_t k = 0; k < 20; ++k) {
    step.model = k % 2 == 0 ? MotionModel::kVelocity : MotionModel::kBicycle;
    sample_motion(particles, step, RandomStream(3 * k));
    ring.sample(particles, {0.5 * static_cast<double>(k), 0.0, 0.25}, 2.0, 0.25, 2.0, RandomStream(3 * k + 1));
    weigh(particles, fix);
    particles.normalise();
    if (effective_sample_size(particles) < 100.0) resampler.resample(particles, RandomStream(3 * k + 2));
  }
  std::uint64_t hash = 14695981039346656037ULL;  // FNV-1a of all bits
  for (const std::vector<float>* values : {&particles.x, &particles.y, &particles.yaw, &particles.weight}) {
    for (const float value : *values) {
      std::uint32_t bits = 0;
      std::memcpy(&bits, &value, sizeof bits);
      hash = (hash ^ bits) * 1099511628211ULL;
    }
  }
  EXPECT_EQ(hash, 15736267486673107512ULL);
}

}  // namespace
}  // namespace urban_gnss
