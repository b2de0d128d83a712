#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "matchers.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"

namespace urban_gnss {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

/// Eq. (3) as printed, which needs a yaw rate.
Pose2 closed_form(const Pose2& p, const Twist2& t, double dt) {
  const double radius = t.speed_mps / t.yaw_rate_radps;
  const double yaw = p.yaw + t.yaw_rate_radps * dt;
  return {p.x + radius * (std::sin(yaw) - std::sin(p.yaw)), p.y - radius * (std::cos(yaw) - std::cos(p.yaw)),
          wrap_angle(yaw)};
}

TEST(MotionModel, ChordFormIsThePrintedFormForEveryYawRateEq3) {
  RandomEngine engine = make_engine(1);
  for (double rate = 20.0; rate > 1e-6; rate /= 1.7) {
    for (const double sign : {-1.0, 1.0}) {
      const Pose2 pose = random_pose(engine);
      const Twist2 twist{uniform_between(-30.0, 30.0, engine), sign * rate};
      const double duration = uniform_between(0.001, 2.0, engine);
      // The printed form subtracts sines of size 1, each rounded, and multiplies by the radius.
      const double tolerance = 8.0 * kEpsilon * (100.0 + 10.0 * std::abs(twist.speed_mps / rate));
      EXPECT_TRUE(near(move(pose, twist, duration), closed_form(pose, twist, duration), tolerance)) << rate;
    }
  }
}

TEST(MotionModel, SidewaysIsForwardsOfARobotThatIsTurnedToTheLeft) {
  RandomEngine engine = make_engine(3);
  for (int trial = 0; trial < 100; ++trial) {
    const Pose2 pose = random_pose(engine);
    const double speed = uniform_between(-3.0, 3.0, engine);
    const double rate = uniform_between(-2.0, 2.0, engine);
    const Pose2 sideways = move(pose, {0.0, rate, speed}, 0.3);
    const Pose2 turned = move({pose.x, pose.y, pose.yaw + 0.5 * kPi}, {speed, rate}, 0.3);
    EXPECT_TRUE(near(sideways, {turned.x, turned.y, turned.yaw - 0.5 * kPi}, 1e-12));
  }
}

TEST(MotionModel, TwistBetweenTwoPosesMovesFromTheOneToTheOther) {
  RandomEngine engine = make_engine(4);
  for (double rate = 20.0; rate > 1e-9; rate /= 3.0) {
    const Pose2 pose = random_pose(engine);
    const Twist2 twist{uniform_between(-9.0, 9.0, engine), rate, uniform_between(-9.0, 9.0, engine)};
    const Twist2 found = twist_between(pose, move(pose, twist, 0.1), 0.1);
    EXPECT_NEAR(found.speed_mps, twist.speed_mps, 1e-9) << rate;
    EXPECT_NEAR(found.lateral_mps, twist.lateral_mps, 1e-9) << rate;
    EXPECT_NEAR(found.yaw_rate_radps, twist.yaw_rate_radps, 1e-9) << rate;
  }
}

TEST(MotionModel, IsRegularAtYawRateZero) {
  const Pose2 pose{3.0, -2.0, 0.7};
  const double way = 5.0 * 0.4;
  EXPECT_TRUE(near(move(pose, {5.0, 0.0}, 0.4), {3.0 + way * std::cos(0.7), -2.0 + way * std::sin(0.7), 0.7}, 1e-15));
  // The Taylor series of eq. (3) in the angle turned; what it leaves out is way * turn^3 / 24.
  for (double turn = 1e-3; turn > 1e-16; turn /= 3.0) {
    const double along = way * (1.0 - turn * turn / 6.0);
    const double across = way * turn / 2.0;
    const Pose2 series{pose.x + along * std::cos(0.7) - across * std::sin(0.7),
                       pose.y + along * std::sin(0.7) + across * std::cos(0.7), 0.7 + turn};
    EXPECT_TRUE(near(move(pose, {5.0, turn / 0.4}, 0.4), series, way * turn * turn * turn + 16.0 * kEpsilon)) << turn;
  }
}

TEST(MotionModel, TwoHalfStepsAreOneStep) {
  RandomEngine engine = make_engine(2);
  for (int trial = 0; trial < 200; ++trial) {
    const Pose2 pose = random_pose(engine);
    const Twist2 twist{uniform_between(-20.0, 20.0, engine), uniform_between(-4.0, 4.0, engine)};
    const Pose2 half = move(pose, twist, 0.5);
    EXPECT_TRUE(near(move(half, twist, 0.5), move(pose, twist, 1.0), 1e-12));  // 70 m, a dozen roundings
    EXPECT_TRUE(near(move(half, twist, -0.5), pose, 1e-12));
  }
}

TEST(MotionModel, MovingCommutesWithRotationAndTranslation) {
  RandomEngine engine = make_engine(3);
  for (int trial = 0; trial < 200; ++trial) {
    const Pose2 frame = random_pose(engine);
    const Pose2 pose = random_pose(engine);
    const Twist2 twist{uniform_between(-20.0, 20.0, engine), uniform_between(-4.0, 4.0, engine)};
    EXPECT_TRUE(near(move(compose(frame, pose), twist, 0.3), compose(frame, move(pose, twist, 0.3)), 1e-12));
  }
}

TEST(MotionModel, SteeringAndYawRateAreInverseEq4) {
  for (double steering = -1.5; steering <= 1.5; steering += 0.1) {
    for (const double speed : {-10.0, -0.01, 0.002, 3.0}) {
      for (const double wheelbase : {0.5, 2.7}) {
        const BicycleInput input{speed, steering};
        EXPECT_NEAR(yaw_rate(input, wheelbase), speed * std::tan(steering) / wheelbase, 1e-12 * std::abs(speed) * 15.0);
        const BicycleInput back = bicycle_input({speed, yaw_rate(input, wheelbase)}, wheelbase);
        EXPECT_EQ(back.speed_mps, speed);
        EXPECT_NEAR(back.steering_rad, steering, 1e-14);
      }
    }
  }
  EXPECT_EQ(bicycle_input({0.0, 1.0}, 1.0).steering_rad, 0.0);
}

MotionParameters all_different(MotionModel model) {
  MotionParameters p;
  p.motion_model = model;
  p.wheelbase = 1.3;
  p.odom_alpha1 = 0.010;
  p.odom_alpha2 = 0.020;
  p.odom_alpha3 = 0.0003;
  p.odom_alpha4 = 0.040;
  p.odom_alpha5 = 0.0005;
  p.odom_alpha6 = 0.060;
  p.odom_noise_scale = 0.5;
  p.odom_noise_interval = 0.1;
  return p;
}

TEST(MotionModel, VariancesAreThoseOfEq5To7) {
  const Twist2 twist{2.0, 0.8};
  for (const MotionModel model : {MotionModel::kBicycle, MotionModel::kVelocity}) {
    const MotionStep step = make_motion_step(twist, 0.1, all_different(model));
    const double i = model == MotionModel::kBicycle ? std::atan(1.3 * 0.8 / 2.0) : 0.8;
    EXPECT_NEAR(step.speed_sigma, std::sqrt(0.5 * (0.010 * 4.0 + 0.020 * i * i)), 1e-15);
    EXPECT_NEAR(step.input_sigma, std::sqrt(0.5 * (0.0003 * 4.0 + 0.040 * i * i)), 1e-15);
    EXPECT_NEAR(step.yaw_rate_sigma, std::sqrt(0.5 * (0.0005 * 4.0 + 0.060 * i * i)), 1e-15);
  }
}

// Eq. (5)-(8) by draws, seen in where the robot ends: speed and yaw rate are those that lead there.
TEST(MotionModel, DrawsHaveThePrintedVariances) {
  constexpr int kDraws = 40000;
  const double dt = 0.1;
  const Twist2 twist{2.0, 0.8};
  for (const MotionModel model : {MotionModel::kBicycle, MotionModel::kVelocity}) {
    const MotionParameters p = all_different(model);
    const double i = model == MotionModel::kBicycle ? std::atan(1.3 * 0.8 / 2.0) : 0.8;
    const double speed_variance = 0.5 * (p.odom_alpha1 * 4.0 + p.odom_alpha2 * i * i);
    const double input_variance = 0.5 * (p.odom_alpha3 * 4.0 + p.odom_alpha4 * i * i);
    const double rate_variance = 0.5 * (p.odom_alpha5 * 4.0 + p.odom_alpha6 * i * i);
    RandomEngine engine = make_engine(4);
    const MotionStep step = make_motion_step(twist, dt, p);
    std::vector<double> speeds, inputs, disturbances;
    for (int k = 0; k < kDraws; ++k) {
      const Pose2 end = move_noisily({}, step, draw_motion_noise(engine));
      // The way from the origin leaves in the direction of half the turn that curved it; the rest is the disturbance.
      const double turn = 2.0 * std::atan2(end.y, end.x);
      const double speed = std::hypot(end.x, end.y) * (0.5 * turn) / std::sin(0.5 * turn) / dt;
      speeds.push_back(speed);
      inputs.push_back(model == MotionModel::kBicycle ? bicycle_input({speed, turn / dt}, p.wheelbase).steering_rad
                                                      : turn / dt);
      disturbances.push_back(angle_difference(end.yaw, turn) / dt);
    }
    EXPECT_TRUE(has_moments(speeds, 2.0, speed_variance));
    EXPECT_TRUE(has_moments(inputs, i, input_variance));
    EXPECT_TRUE(has_moments(disturbances, 0.0, rate_variance));
  }
}

TEST(MotionModel, DiffusionPerSecondDoesNotDependOnTheStep) {
  const Twist2 twist{2.0, 0.8};
  for (const MotionModel model : {MotionModel::kBicycle, MotionModel::kVelocity}) {
    const MotionParameters p = all_different(model);
    const MotionStep one = make_motion_step(twist, 1.0, p);
    for (const double dt : {0.001, 0.02, 0.25}) {
      const MotionStep step = make_motion_step(twist, dt, p);
      // Independent steps: the variance of what a second adds is that of one step times 1 / dt.
      EXPECT_NEAR(std::pow(step.speed_sigma * dt, 2) / dt, std::pow(one.speed_sigma, 2), 1e-15);
      EXPECT_NEAR(std::pow(step.input_sigma * dt, 2) / dt, std::pow(one.input_sigma, 2), 1e-15);
      EXPECT_NEAR(std::pow(step.yaw_rate_sigma * dt, 2) / dt, std::pow(one.yaw_rate_sigma, 2), 1e-15);
    }
  }
}

TEST(MotionModel, StandingStillAddsNoNoise) {
  const Pose2 pose{1.0, 2.0, 3.0};
  for (const MotionModel model : {MotionModel::kBicycle, MotionModel::kVelocity}) {
    MotionParameters p = all_different(model);
    p.odom_noise_scale = 1e6;
    EXPECT_TRUE(near(move_noisily(pose, make_motion_step({0.0, 0.0}, 0.1, p), {3.0, -3.0, 3.0}), pose, 1e-15));
    EXPECT_TRUE(near(move_noisily(pose, make_motion_step({2.0, 0.5}, 0.0, p), {3.0, -3.0, 3.0}), pose, 1e-15));
  }
}

TEST(MotionModel, BicycleCanTurnOnTheSpotWhereTheOdometrySaysSo) {
  const MotionStep step = make_motion_step({0.0, 0.5}, 2.0, all_different(MotionModel::kBicycle));
  EXPECT_TRUE(near(move_noisily({1.0, 2.0, 0.0}, step, {}), {1.0, 2.0, 1.0}, 1e-15));
  EXPECT_GT(step.input_sigma, 0.0);
}

}  // namespace
}  // namespace urban_gnss
