#include <gtest/gtest.h>

#include "matchers.hpp"
#include "urban_gnss_localization/motion/dead_reckoning.hpp"

namespace urban_gnss {
namespace {

/// The pose after a step from a start that is wrong by `error`.
Pose2 moved_with(const Pose2& pose, const OdometryErrors& errors, const ErrorState& error, const Twist2& twist,
                 double duration_s) {
  const Pose2 start{pose.x + error(0), pose.y + error(1), pose.yaw + error(2)};
  return dead_reckon(start, {errors.speed_scale + error(3), errors.yaw_rate_bias_radps + error(4)}, twist, duration_s,
                     {})
      .pose;
}

TEST(DeadReckoning, TransitionIsTheNumericJacobian) {
  RandomEngine engine = make_engine(1);
  for (int k = 0; k < 50; ++k) {
    const Pose2 pose = random_pose(engine);
    const OdometryErrors errors{0.05 * draw_normal(engine), 0.02 * draw_normal(engine)};
    const Twist2 twist{5.0 * draw_normal(engine), draw_normal(engine)};
    const double duration = uniform_between(0.001, 0.1, engine);
    const DeadReckoningStep step = dead_reckon(pose, errors, twist, duration, {});
    for (int i = 0; i < kErrorStates; ++i) {
      constexpr double kDelta = 1e-5;
      const Pose2 plus = moved_with(pose, errors, kDelta * ErrorState::Unit(i), twist, duration);
      const Pose2 minus = moved_with(pose, errors, -kDelta * ErrorState::Unit(i), twist, duration);
      // The chord shortens with the turn by |v| dt (w dt)^2 / 24, which the Jacobian leaves out.
      const double tolerance =
          1e-8 + std::abs(twist.speed_mps) * (std::abs(twist.yaw_rate_radps) + 0.1) * std::pow(duration, 3);
      EXPECT_NEAR((plus.x - minus.x) / (2.0 * kDelta), step.transition(0, i), tolerance) << i;
      EXPECT_NEAR((plus.y - minus.y) / (2.0 * kDelta), step.transition(1, i), tolerance) << i;
      EXPECT_NEAR(angle_difference(plus.yaw, minus.yaw) / (2.0 * kDelta), step.transition(2, i), 1e-8) << i;
    }
    EXPECT_TRUE((step.transition.bottomRows<2>().rightCols<2>().isIdentity()));
  }
}

TEST(DeadReckoning, NoiseIsThatOfNoisyTwists) {
  DeadReckoningParameters parameters;
  parameters.odom_position_noise = parameters.odom_heading_noise = 0.0;
  const Pose2 start{1.0, 2.0, 0.7};
  const Twist2 twist{3.0, 0.8};
  const double duration = 0.1;
  const DeadReckoningStep step = dead_reckon(start, {}, twist, duration, parameters);
  RandomEngine engine = make_engine(2);
  std::vector<double> turned;
  std::vector<double> along;
  for (int k = 0; k < 4000; ++k) {
    const Twist2 noisy{
        twist.speed_mps * (1.0 + parameters.odom_speed_noise * draw_normal(engine) / std::sqrt(duration)),
        twist.yaw_rate_radps * (1.0 + parameters.odom_yaw_rate_noise * draw_normal(engine) / std::sqrt(duration))};
    const Pose2 pose = move(start, noisy, duration);
    turned.push_back(pose.yaw - step.pose.yaw);
    along.push_back((pose.position() - step.pose.position()).x());
  }
  EXPECT_TRUE(has_moments(turned, 0.0, step.noise(2, 2)));
  EXPECT_TRUE(has_moments(along, 0.0, step.noise(0, 0)));
}

TEST(DeadReckoning, NoiseDoesNotDependOnTheLengthOfSteps) {
  const Twist2 twist{2.0, 0.0};
  ErrorCovariance fine = ErrorCovariance::Zero();
  Pose2 pose;
  for (int k = 0; k < 200; ++k) {
    const DeadReckoningStep step = dead_reckon(pose, {}, twist, 0.005, {});
    fine = step.transition * fine * step.transition.transpose() + step.noise;
    pose = step.pose;
  }
  ErrorCovariance coarse = ErrorCovariance::Zero();
  pose = {};
  for (int k = 0; k < 20; ++k) {
    const DeadReckoningStep step = dead_reckon(pose, {}, twist, 0.05, {});
    coarse = step.transition * coarse * step.transition.transpose() + step.noise;
    pose = step.pose;
  }
  for (int i = 0; i < kErrorStates; ++i) EXPECT_NEAR(fine(i, i) / coarse(i, i), 1.0, 0.01) << i;
}

// The motion model's step, against the very motion of the particles: its Jacobian by differences, its noise by draws.
TEST(DeadReckoning, LinearisesTheMotionModel) {
  for (const MotionModel model : {MotionModel::kBicycle, MotionModel::kVelocity}) {
    MotionParameters motion;
    motion.motion_model = model;
    motion.wheelbase = 1.3;
    OdometryErrorParameters parameters;
    parameters.motion_noise_factor = 0.5;
    parameters.position_walk = 0.0;
    parameters.heading_walk = 0.0;
    const MotionStep moved = make_motion_step({2.0, 0.4}, 0.1, motion, parameters);
    const Pose2 start{3.0, -2.0, 2.9};
    const OdometryErrors errors{0.04, -0.02};
    const DeadReckoningStep step = dead_reckon(start, errors, moved, parameters);
    EXPECT_TRUE(near(step.pose, move_noisily(start, moved, {}, errors), 1e-12));
    const double h = 1e-6;  // and the chord's length hardly depends on the turn: 2e-4
    for (int i = 0; i < kErrorStates; ++i) {
      ErrorState d = ErrorState::Zero();
      d(i) = h;
      const Pose2 after = move_noisily({start.x + d(0), start.y + d(1), start.yaw + d(2)}, moved, {},
                                       {errors.speed_scale + d(3), errors.yaw_rate_bias_radps + d(4)});
      EXPECT_NEAR(step.transition(0, i), (after.x - step.pose.x) / h, 2e-4) << i;
      EXPECT_NEAR(step.transition(1, i), (after.y - step.pose.y) / h, 2e-4) << i;
      EXPECT_NEAR(step.transition(2, i), angle_difference(after.yaw, step.pose.yaw) / h, 2e-4) << i;
    }
    const Pose2 turned = move_noisily(start, moved, {}, {errors.speed_scale, errors.yaw_rate_bias_radps, h});
    EXPECT_NEAR(step.yaw_rate_scale.x(), (turned.x - step.pose.x) / h, 2e-4);
    EXPECT_NEAR(step.yaw_rate_scale.y(), (turned.y - step.pose.y) / h, 2e-4);
    EXPECT_NEAR(step.yaw_rate_scale.z(), angle_difference(turned.yaw, step.pose.yaw) / h, 2e-4);
    RandomEngine engine = make_engine(9);
    std::vector<double> x, y, yaw;
    for (int k = 0; k < 20000; ++k) {
      const Pose2 drawn = move_noisily(start, moved, draw_motion_noise(engine), errors);
      x.push_back(drawn.x - step.pose.x);
      y.push_back(drawn.y - step.pose.y);
      yaw.push_back(angle_difference(drawn.yaw, step.pose.yaw));
    }
    EXPECT_TRUE(has_moments(x, 0.0, step.noise(0, 0)));
    EXPECT_TRUE(has_moments(y, 0.0, step.noise(1, 1)));
    EXPECT_TRUE(has_moments(yaw, 0.0, step.noise(2, 2)));
    EXPECT_EQ(step.noise(3, 3), 0.1 * parameters.speed_scale_walk * parameters.speed_scale_walk);
    EXPECT_EQ(step.noise(4, 4), 0.1 * parameters.yaw_rate_bias_walk * parameters.yaw_rate_bias_walk);
  }
}

TEST(DeadReckoning, ParkedRobotWalksAsMuchAsItsPlaceMayBeWrong) {
  const MotionStep parked = make_motion_step({0.0, 0.005}, 4.0, {}, {});  // what a gyroscope says at a standstill
  const DeadReckoningStep step = dead_reckon({1.0, 2.0, 3.0}, {0.1, 0.01}, parked, {});
  EXPECT_TRUE((step.pose == Pose2{1.0, 2.0, 3.0}));
  EXPECT_TRUE(step.transition.isIdentity());
  EXPECT_TRUE(step.yaw_rate_scale.isZero());
  EXPECT_NEAR(step.noise(0, 0), 4.0 * 0.03 * 0.03, 1e-12);
  EXPECT_EQ(step.noise(2, 2), 0.0);
}

// Wheels that stand have no yaw-rate bias: a parked robot does not turn.
TEST(DeadReckoning, StandingRobotStays) {
  const DeadReckoningStep step = dead_reckon({1.0, 2.0, 3.0}, {0.1, 0.01}, {0.0, 0.0}, 10.0, {});
  EXPECT_TRUE((step.pose == Pose2{1.0, 2.0, 3.0}));
  EXPECT_TRUE(step.transition.isIdentity());
  EXPECT_TRUE((step.noise.topLeftCorner<3, 3>().isZero()));
  EXPECT_FALSE(is_standstill({0.0, 0.01}));
  EXPECT_FALSE(is_standstill({-0.01, 0.0}));
}

TEST(DeadReckoning, PaperFormHasNoOdometryErrors) {
  DeadReckoningParameters parameters;
  parameters.estimate_odometry_errors = false;
  const DeadReckoningStep step = dead_reckon({}, {}, {2.0, 0.3}, 0.1, parameters);
  EXPECT_TRUE((step.transition.topRightCorner<3, 2>().isZero()));
  EXPECT_TRUE((step.noise.bottomRows<2>().isZero()));
  const ErrorCovariance start = initial_error_covariance(Eigen::Matrix3d::Identity(), parameters);
  EXPECT_TRUE((start.bottomRows<2>().isZero()));
  EXPECT_TRUE((start.topLeftCorner<3, 3>().isIdentity()));
}

}  // namespace
}  // namespace urban_gnss
