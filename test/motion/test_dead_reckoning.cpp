#include <gtest/gtest.h>

#include <cmath>

#include "matchers.hpp"
#include "urban_gnss_localization/motion/dead_reckoning.hpp"

namespace urban_gnss {
namespace {

DeadReckoningStep dead_reckon(const Pose2& pose, const Twist2& twist, double duration_s) {
  const OdometryErrorParameters parameters;
  return urban_gnss::dead_reckon(pose, {}, make_motion_step(twist, duration_s, {}, parameters), parameters);
}

TEST(DeadReckoning, NoiseDoesNotDependOnTheLengthOfSteps) {
  const Twist2 twist{2.0, 0.0};
  ErrorCovariance fine = ErrorCovariance::Zero();
  Pose2 pose;
  for (int k = 0; k < 200; ++k) {
    const DeadReckoningStep step = dead_reckon(pose, twist, 0.005);
    fine = step.transition * fine * step.transition.transpose() + step.noise;
    pose = step.pose;
  }
  ErrorCovariance coarse = ErrorCovariance::Zero();
  pose = {};
  for (int k = 0; k < 20; ++k) {
    const DeadReckoningStep step = dead_reckon(pose, twist, 0.05);
    coarse = step.transition * coarse * step.transition.transpose() + step.noise;
    pose = step.pose;
  }
  for (int i = 0; i < kErrorStates; ++i) EXPECT_NEAR(fine(i, i) / coarse(i, i), 1.0, 0.01) << i;
}

// The motion model's step, against the very motion of the particles: its Jacobian by differences, its noise by draws.
TEST(DeadReckoning, LinearisesTheMotionModel) {
  for (const auto& [model, twist] : {std::pair{MotionModel::kBicycle, Twist2{2.0, 0.4}},
                                     {MotionModel::kVelocity, Twist2{2.0, 0.4}},
                                     {MotionModel::kVelocity, Twist2{-1.5, 0.4, 1.1}},
                                     {MotionModel::kVelocity, Twist2{0.0, -0.3, -2.0}}}) {
    MotionParameters motion;
    motion.motion_model = model;
    motion.wheelbase = 1.3;
    OdometryErrorParameters parameters;
    parameters.motion_noise_factor = 0.5;
    parameters.position_walk = 0.0;
    parameters.heading_walk = 0.0;
    const MotionStep moved = make_motion_step(twist, 0.1, motion, parameters);
    const Pose2 start{3.0, -2.0, 2.9};
    const OdometryErrors errors{0.04, -0.02};
    const DeadReckoningStep step = urban_gnss::dead_reckon(start, errors, moved, parameters);
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
    EXPECT_DOUBLE_EQ(step.noise(3, 3), 0.1 * parameters.speed_scale_walk * parameters.speed_scale_walk);
    EXPECT_DOUBLE_EQ(step.noise(4, 4), 0.1 * parameters.yaw_rate_bias_walk * parameters.yaw_rate_bias_walk);
  }
}

// The noise of Kim et al., eq. (2): K Sigma_v K' + Sigma_N, with shares of the speed and of the yaw rate.
TEST(DeadReckoning, NoiseOfKimIsASpecialCase) {
  MotionParameters motion;
  motion.odom_alpha1 = 0.02 * 0.02;
  motion.odom_alpha4 = 0.03 * 0.03;
  motion.odom_alpha2 = motion.odom_alpha3 = motion.odom_alpha5 = motion.odom_alpha6 = 0.0;
  OdometryErrorParameters parameters;
  parameters.motion_noise_factor = 1.0;
  parameters.position_walk = 0.05;
  parameters.heading_walk = 0.003;
  const Twist2 twist{3.0, 0.8};
  const double dt = 0.1;
  const DeadReckoningStep step =
      urban_gnss::dead_reckon({1.0, 2.0, 0.7}, {}, make_motion_step(twist, dt, motion, parameters), parameters);
  const double chord_yaw = 0.7 + 0.5 * 0.8 * dt;
  Eigen::Matrix<double, 3, 2> k;
  k << std::cos(chord_yaw), -0.5 * (step.pose.y - 2.0), std::sin(chord_yaw), 0.5 * (step.pose.x - 1.0), 0.0, 1.0;
  const Eigen::Vector2d sigma_v(std::pow(0.02 * twist.speed_mps, 2), std::pow(0.03 * twist.yaw_rate_radps, 2));
  Eigen::Matrix3d expected = dt * k * sigma_v.asDiagonal() * k.transpose();
  expected.diagonal() += dt * Eigen::Vector3d(0.05 * 0.05, 0.05 * 0.05, 0.003 * 0.003);
  EXPECT_TRUE((step.noise.topLeftCorner<3, 3>().isApprox(expected, 1e-12)));
}

// Kim et al. eq. (1), and J and K of eq. (2), as printed.
TEST(DeadReckoning, TangentIsThePrintedStep) {
  OdometryErrorParameters parameters;
  parameters.motion_noise_factor = 1.0;
  parameters.position_walk = 0.05;
  parameters.heading_walk = 0.003;
  MotionParameters motion;
  motion.odom_alpha1 = 4e-4;
  motion.odom_alpha4 = 9e-4;
  motion.odom_alpha2 = motion.odom_alpha3 = motion.odom_alpha5 = motion.odom_alpha6 = 0.0;
  const double v = 3.0, omega = 0.8, theta = 0.7, tau = 0.1;
  const MotionStep moved = make_motion_step({v, omega}, tau, motion, parameters);
  const Pose2 start{1.0, 2.0, theta};
  const DeadReckoningStep step = urban_gnss::dead_reckon(start, {}, moved, parameters, StepPath::kTangent);
  const Pose2 printed{1.0 + tau * v * std::cos(theta), 2.0 + tau * v * std::sin(theta), theta + tau * omega};
  EXPECT_TRUE(near(step.pose, printed, 1e-12));
  EXPECT_FALSE(near(step.pose, urban_gnss::dead_reckon(start, {}, moved, parameters).pose, 1e-3)) << "not the chord";
  Eigen::Matrix3d j = Eigen::Matrix3d::Identity();
  j(0, 2) = -tau * v * std::sin(theta);
  j(1, 2) = tau * v * std::cos(theta);
  EXPECT_TRUE((step.transition.topLeftCorner<3, 3>().isApprox(j, 1e-12)));
  Eigen::Matrix<double, 3, 2> k;
  k << tau * std::cos(theta), 0.0, tau * std::sin(theta), 0.0, 0.0, tau;
  const Eigen::Vector2d sigma_v(4e-4 * v * v / tau, 9e-4 * omega * omega / tau);
  Eigen::Matrix3d noise = k * sigma_v.asDiagonal() * k.transpose();
  noise.diagonal() += tau * Eigen::Vector3d(0.05 * 0.05, 0.05 * 0.05, 0.003 * 0.003);
  EXPECT_TRUE((step.noise.topLeftCorner<3, 3>().isApprox(noise, 1e-12)));
}

// Wheels that stand have no yaw-rate bias: a parked robot does not turn.
TEST(DeadReckoning, ParkedRobotWalksAsMuchAsItsPlaceMayBeWrong) {
  const MotionStep parked = make_motion_step({0.0, 0.005}, 4.0, {}, {});  // what a gyroscope says at a standstill
  const DeadReckoningStep step = urban_gnss::dead_reckon({1.0, 2.0, 3.0}, {0.1, 0.01}, parked, {});
  EXPECT_TRUE((step.pose == Pose2{1.0, 2.0, 3.0}));
  EXPECT_TRUE(step.transition.isIdentity());
  EXPECT_TRUE(step.yaw_rate_scale.isZero());
  EXPECT_NEAR(step.noise(0, 0), 4.0 * 0.03 * 0.03, 1e-12);
  EXPECT_EQ(step.noise(2, 2), 0.0);
}

TEST(DeadReckoning, StartHasTheOdometrysErrors) {
  OdometryErrorParameters parameters;
  parameters.speed_scale_sigma = 0.03;
  parameters.yaw_rate_bias_sigma = 0.004;
  const ErrorCovariance start = initial_error_covariance(2.0 * Eigen::Matrix3d::Identity(), parameters);
  ErrorState expected;
  expected << 2.0, 2.0, 2.0, 0.03 * 0.03, 0.004 * 0.004;
  EXPECT_TRUE(start.isApprox(ErrorCovariance(expected.asDiagonal())));
}

}  // namespace
}  // namespace urban_gnss
