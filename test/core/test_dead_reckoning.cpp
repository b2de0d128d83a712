#include <gtest/gtest.h>

#include "matchers.hpp"
#include "urban_gnss_localization/filters/dead_reckoning.hpp"

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
