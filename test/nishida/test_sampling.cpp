#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "matchers.hpp"
#include "urban_gnss_localization/localizers/nishida/sampling.hpp"

namespace urban_gnss {
namespace {

// Eq. (4) to (8), typed out from the text; a straight line where omega is 0, where (3) is 0/0.
Pose2 printed_step(const Pose2& pose, const MotionStep& step, const MotionNoise& noise) {
  const double v = step.twist.speed_mps + step.speed_sigma * noise.speed;  // (5)
  const double second = step.input_sigma * noise.input;                    // (6)
  const double omega = step.model == MotionModel::kBicycle
                           ? v / step.wheelbase_m * std::tan(step.steering_rad + second)  // (4)
                           : step.twist.yaw_rate_radps + second;
  const double turn = omega * step.duration_s;
  const double gamma = step.yaw_rate_sigma * noise.yaw_rate;  // (7)
  Pose2 moved = pose;
  moved.x += omega == 0.0 ? v * step.duration_s * std::cos(pose.yaw)
                          : v / omega * (std::sin(pose.yaw + turn) - std::sin(pose.yaw));
  moved.y += omega == 0.0 ? v * step.duration_s * std::sin(pose.yaw)
                          : -v / omega * (std::cos(pose.yaw + turn) - std::cos(pose.yaw));
  moved.yaw = wrap_angle(pose.yaw + (omega + gamma) * step.duration_s);
  return moved;
}

/// Floats of a few metres and radians, after a dozen roundings of 2e-7.
constexpr double kFloats = 1e-6;

/// Particles before and after sample_motion(), and the stream that it drew from.
struct Moved {
  MotionStep step;
  ParticleSet before, after;
  RandomStream stream{2};

  Moved(MotionModel model, const Twist2& twist)
      : step(make_step(model, twist)), before(some_particles()), after(before) {
    sample_motion(after, step, stream);
  }

  static MotionStep make_step(MotionModel model, const Twist2& twist) {
    MotionParameters parameters;
    parameters.motion_model = model;
    parameters.wheelbase = 1.7;
    return make_motion_step(twist, 0.05, parameters);
  }
  static ParticleSet some_particles() {
    RandomEngine engine = make_engine(1);
    return random_particles(500, engine);
  }
};

TEST(SampleMotion, IsMoveNoisilyDrawByDraw) {
  for (const MotionModel model : {MotionModel::kBicycle, MotionModel::kVelocity}) {
    for (const Twist2 twist : {Twist2{3.0, 0.7}, Twist2{-1.0, 0.0}, Twist2{0.0, 0.4}, Twist2{0.0, 0.0},
                               Twist2{-1.0, 0.3, 2.0}, Twist2{0.0, 0.0, -1.0}}) {
      Moved moved(model, twist);
      for (std::size_t i = 0; i < moved.after.size(); ++i) {
        const Pose2 plain = move_noisily(moved.before.pose(i), moved.step, motion_noise(moved.stream, i));
        ASSERT_TRUE(near(moved.after.pose(i), plain, kFloats)) << i;
      }
      EXPECT_EQ(moved.after.log_weight, moved.before.log_weight);
    }
  }
}

TEST(SampleMotion, MovesEachParticleByEq8DrawByDraw) {
  for (const MotionModel model : {MotionModel::kBicycle, MotionModel::kVelocity}) {
    for (const Twist2 twist : {Twist2{3.0, 0.7}, Twist2{-1.0, 0.4}, Twist2{0.0, 0.4}, Twist2{0.0, 0.0}}) {
      Moved moved(model, twist);
      for (std::size_t i = 0; i < moved.after.size(); ++i) {
        const Pose2 printed = printed_step(moved.before.pose(i), moved.step, motion_noise(moved.stream, i));
        ASSERT_TRUE(near(moved.after.pose(i), printed, kFloats)) << i;
      }
      EXPECT_EQ(moved.after.log_weight, moved.before.log_weight);
    }
  }
}

TEST(SampleMotion, NoiseOfAParticleIsItsOwn) {
  // Neither the number of particles nor how many are moved at once matters.
  const Moved all(MotionModel::kVelocity, {3.0, 0.7});
  ParticleSet some(300);
  for (std::size_t i = 0; i < some.size(); ++i) some.set_pose(i, all.before.pose(i));
  sample_motion(some, all.step, all.stream);
  for (std::size_t i = 0; i < some.size(); ++i) {
    ASSERT_EQ(some.x[i], all.after.x[i]);
    ASSERT_EQ(some.y[i], all.after.y[i]);
    ASSERT_EQ(some.yaw[i], all.after.yaw[i]);
  }
}

TEST(SampleMotion, FollowsAnyTurnAndAnyNoise) {
  const Moved turns(MotionModel::kVelocity, {3.0, 400.0});  // three turns in a step
  for (std::size_t i = 0; i < turns.after.size(); ++i) {
    const Pose2 plain = move_noisily(turns.before.pose(i), turns.step, motion_noise(turns.stream, i));
    ASSERT_TRUE(near(turns.after.pose(i), plain, 1e-5)) << i;  // floats of 20 rad have roundings of 2e-6
  }
  for (const double wild : {1.0, 1e3, 1e30}) {
    ParticleSet particles = turns.before;
    MotionStep step = Moved::make_step(MotionModel::kBicycle, {3.0, 0.7});
    step.input_sigma = wild;  // any angle of the front wheel, also across the robot
    step.yaw_rate_sigma = wild;
    sample_motion(particles, step, RandomStream(3));
    for (std::size_t i = 0; i < particles.size(); ++i) {
      ASSERT_TRUE(is_finite(particles.pose(i))) << wild;
      ASSERT_LT((particles.pose(i).position() - turns.before.pose(i).position()).norm(), 1.0) << wild;
    }
  }
}

struct Ring {
  static constexpr std::size_t kCount = 20000;
  static constexpr double kRadius = 4.0;
  static constexpr double kRadiusSigma = 0.05;
  static constexpr double kWeightSigma = 2.5;
  Pose2 predicted{7.0, -3.0, 0.9};
};

TEST(RingSampler, ReplacesExactlyItsShareEq22) {
  for (const double share : {0.0, 0.01, 0.05, 0.333, 1.0}) {
    RandomEngine engine = make_engine(3);
    ParticleSet particles = random_particles(1000, engine, 0.5);
    const ParticleSet before = particles;
    RingSampler ring(particles.size(), share);
    const auto expected = static_cast<std::size_t>(std::lround(share * 1000.0));
    EXPECT_EQ(ring.count(), expected);
    ring.sample(particles, {100.0, 100.0, 0.3}, 4.0, 0.05, 1.0, RandomStream(engine()));
    std::size_t replaced = 0;
    for (std::size_t i = 0; i < particles.size(); ++i) {
      if (particles.x[i] != before.x[i]) {
        ++replaced;
      } else {
        EXPECT_EQ(particles.log_weight[i], before.log_weight[i]);
        EXPECT_EQ(particles.yaw[i], before.yaw[i]);
      }
    }
    EXPECT_EQ(replaced, expected) << share;  // distinct: none was drawn twice
  }
}

TEST(RingSampler, ChoosesEveryParticleEquallyOften) {
  // 400 calls of 5 % of 200: binomial with mean 20 and sigma 4.36 each. The sum of the squared deviations over 200
  // particles, whose total is fixed, is chi-square with 199 degrees of freedom (sigma 20).
  RandomEngine engine = make_engine(4);
  RingSampler ring(200, 0.05);
  std::vector<double> chosen(200, 0.0);
  for (int call = 0; call < 400; ++call) {
    ParticleSet particles(200);
    ring.sample(particles, {}, 4.0, 0.05, 1.0, RandomStream(engine()));
    for (std::size_t i = 0; i < 200; ++i) chosen[i] += particles.x[i] != 0.0;
  }
  double statistic = 0.0;
  for (const double count : chosen) statistic += (count - 20.0) * (count - 20.0) / (20.0 * 0.95);
  EXPECT_NEAR(statistic, 199.0, 4.5 * 20.0);
}

TEST(RingSampler, DrawsRadiusAngleHeadingAndWeightOfEq23To26) {
  const Ring r;
  ParticleSet particles(Ring::kCount);
  RingSampler ring(Ring::kCount, 1.0);
  ring.sample(particles, r.predicted, Ring::kRadius, Ring::kRadiusSigma, Ring::kWeightSigma, RandomStream(5));
  std::vector<double> radii, angles;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const Eigen::Vector2d way = particles.pose(i).position() - r.predicted.position();
    const double rho = way.norm();
    radii.push_back(rho);
    angles.push_back(std::atan2(way.y(), way.x()));
    ASSERT_EQ(particles.yaw[i], static_cast<float>(r.predicted.yaw));
    const double s2 = Ring::kWeightSigma * Ring::kWeightSigma;
    const double weight = 1.0 / (Ring::kCount * std::sqrt(2.0 * kPi * s2)) * std::exp(-0.5 * rho * rho / s2);
    // A float of -11 has a rounding of 5e-7, and rho of 4 m, at 8 m from the origin, as much.
    ASSERT_NEAR(std::exp(particles.log_weight[i]), weight, 3e-6 * weight);
  }
  EXPECT_TRUE(has_moments(radii, Ring::kRadius, Ring::kRadiusSigma * Ring::kRadiusSigma));
  // Kolmogorov-Smirnov against the uniform distribution; 1.95 / sqrt(n) is exceeded once in a thousand.
  std::sort(angles.begin(), angles.end());
  double largest = 0.0;
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const double expected = (angles[i] + kPi) / (2.0 * kPi);
    largest = std::max(
        {largest, std::abs(expected - i / double(Ring::kCount)), std::abs(expected - (i + 1) / double(Ring::kCount))});
  }
  EXPECT_LT(largest, 1.95 / std::sqrt(double(Ring::kCount)));
}

}  // namespace
}  // namespace urban_gnss
