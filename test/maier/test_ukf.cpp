#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "ukf_rig.hpp"

namespace urban_gnss {
namespace {

// Straight ahead with a known heading, the motion and the fix are linear in x, y and the speed scale.

TEST(Ukf, LinearCaseEqualsTheKalmanFilter) {
  const auto motion =
      with(MotionParameters(),
           "{odom_alpha1: 0.01, odom_alpha2: 0.0, odom_alpha3: 0.0, odom_alpha4: 0.0, odom_alpha5: 0.0, "
           "odom_alpha6: 0.0, odom_noise_interval: 0.5}");
  auto p = plain();
  p.odometry.yaw_rate_bias_sigma = p.odometry.yaw_rate_bias_walk = 0.0;
  for (const double alpha : {1.0, 0.5, 0.1}) {
    p.ukf_alpha = alpha;
    Ukf ukf(p, motion);
    ukf.initialize(pose_with_sigma({1.0, 2.0, 0.0}, 3.0, 0.0));

    Eigen::Vector3d mean(1.0, 2.0, 0.0);
    Eigen::Matrix3d covariance = Eigen::Vector3d(9.0, 9.0, 0.03 * 0.03).asDiagonal();
    RandomEngine engine = make_engine(1);
    for (int step = 0; step < 400; ++step) {
      const double speed = uniform_between(0.5, 3.0, engine);
      const double dt = uniform_between(0.05, 0.2, engine);
      ukf.move({speed, 0.0}, dt);
      Eigen::Matrix3d f = Eigen::Matrix3d::Identity();
      f(0, 2) = speed * dt;
      mean.x() += (1.0 + mean.z()) * speed * dt;
      covariance = f * covariance * f.transpose();
      covariance(0, 0) += 0.01 * speed * speed * 0.5 / dt * dt * dt;
      covariance(2, 2) += 2e-4 * 2e-4 * dt;
      if (step % 7 != 0) continue;
      const Eigen::Vector2d position = mean.head<2>() + Eigen::Vector2d(draw_normal(engine), draw_normal(engine));
      const Eigen::Matrix2d r = (Eigen::Matrix2d() << 4.0, 1.0, 1.0, 2.0).finished();
      FixMeasurement fix = fix_at(position, 1.0, step);
      fix.covariance = r;
      const FixOutcome outcome = ukf.correct(fix);
      const Eigen::Matrix2d s = covariance.topLeftCorner<2, 2>() + r;
      const Eigen::Vector2d innovation = position - mean.head<2>();
      ASSERT_NEAR(outcome.nis, innovation.dot(s.inverse() * innovation), 1e-5 * (1.0 + outcome.nis));
      const Eigen::Matrix<double, 3, 2> gain = covariance.leftCols<2>() * s.inverse();
      mean += gain * innovation;
      covariance -= gain * s * gain.transpose();
    }
    const Eigen::Vector3d state(ukf.state()[0], ukf.state()[1], ukf.speed_scale());
    EXPECT_TRUE(state.isApprox(mean, 1e-6)) << alpha << ": " << state.transpose() << " / " << mean.transpose();
    Eigen::Matrix3d of_ukf;
    const int index[] = {0, 1, 3};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) of_ukf(i, j) = ukf.covariance()(index[i], index[j]);
    EXPECT_TRUE(of_ukf.isApprox(covariance, 1e-5)) << of_ukf << "\n\n" << covariance;
  }
}

TEST(Ukf, MomentsOfACurveAgreeWithMonteCarlo) {
  MotionParameters motion;
  motion.odom_noise_scale = 3.0;
  for (const auto model : {MotionModel::kVelocity, MotionModel::kBicycle}) {
    motion.motion_model = model;
    Ukf ukf(plain(), motion);
    const auto start = pose_with_sigma({3.0, -4.0, 3.0}, 0.5, 0.15);
    ukf.initialize(start);
    const Twist2 twist{2.0, 0.3};
    constexpr double kStep_s = 0.1;
    constexpr int kSteps = 50;
    for (int i = 0; i < kSteps; ++i) ukf.move(twist, kStep_s);

    RandomEngine engine = make_engine(2);
    constexpr int kDraws = 20000;
    Eigen::Matrix3Xd draws(3, kDraws);
    for (int d = 0; d < kDraws; ++d) {
      Pose2 pose{3.0 + 0.5 * draw_normal(engine), -4.0 + 0.5 * draw_normal(engine), 3.0 + 0.15 * draw_normal(engine)};
      const Twist2 real{twist.speed_mps * (1.0 + 0.03 * draw_normal(engine)),
                        twist.yaw_rate_radps + 0.005 * draw_normal(engine)};
      MotionStep step = make_motion_step(twist, kStep_s, motion);
      step.twist = real;
      step.steering_rad = bicycle_input(real, step.wheelbase_m).steering_rad;
      for (int i = 0; i < kSteps; ++i) pose = move_noisily(pose, step, draw_motion_noise(engine));
      draws.col(d) << pose.x, pose.y, angle_difference(pose.yaw, ukf.pose().yaw);
    }
    const Eigen::Vector3d mean = draws.rowwise().mean();
    const Eigen::Matrix3Xd centred = draws.colwise() - mean;
    const Eigen::Matrix3d covariance = centred * centred.transpose() / kDraws;
    EXPECT_NEAR(ukf.pose().x, mean.x(), 0.05);
    EXPECT_NEAR(ukf.pose().y, mean.y(), 0.05);
    EXPECT_NEAR(0.0, mean.z(), 0.01);
    // 20 000 draws know a variance to 1 %; the transform is exact to the third order only.
    const Eigen::Matrix3d estimated = ukf.estimate().covariance;
    EXPECT_TRUE(estimated.isApprox(covariance, 0.06)) << estimated << "\n\n" << covariance;
  }
}

// The same drive in a turned map gives the same estimate, turned: at every yaw, and so across the wrap, too.

TEST(Ukf, TurnsWithTheMapAcrossTheWrapOfTheYaw) {
  const auto drive = [](double turn) {
    const Pose2 map{10.0, -20.0, turn};
    Ukf ukf(plain(), {});
    auto start = pose_with_sigma(compose(map, {0.0, 0.0, 0.0}), 2.0, 0.3);
    ukf.initialize(start);
    RandomEngine engine = make_engine(3);
    Pose2 truth;
    for (int i = 0; i < 600; ++i) {
      const Twist2 twist{1.5, 0.4};
      truth = move(truth, twist, 0.1);
      ukf.move(twist, 0.1);
      if (i % 10 != 0) continue;
      const Eigen::Vector2d noise(draw_normal(engine), draw_normal(engine));
      ukf.correct(fix_at(transform_point(map, truth.position() + noise), 1.0, 0.1 * i));
    }
    EXPECT_TRUE(near(ukf.pose(), compose(map, truth), 1.0));
    return relative_pose(map, ukf.pose());
  };
  // Not to rounding: a Cholesky root, and with it what the sigma points leave of the higher orders, depends on the
  // axes.
  const Pose2 expected = drive(0.0);
  for (const double turn : {0.5, 1.5, 2.5, kPi, -2.5, -1.0}) EXPECT_TRUE(near(drive(turn), expected, 2e-3)) << turn;
}

// Sigma points farther from the centre than half a turn must not count as near it from the other side.
TEST(Ukf, UnknownYawStaysUnknownWithoutFixes) {
  for (const double alpha : {0.1, 0.5, 1.0}) {
    auto p = plain();
    p.ukf_alpha = alpha;
    Ukf ukf(p, {});
    ukf.initialize(pose_with_sigma({0.0, 0.0, 3.0}, 1.0, kPi / std::sqrt(3.0)));
    for (int i = 0; i < 100; ++i) ukf.move({1.0, 0.5}, 0.1);
    EXPECT_NEAR(ukf.health().heading_sigma_rad, kPi / std::sqrt(3.0), 1e-6) << alpha;
  }
}

/// A drive in the open with the noise that the filter is told: the errors of the end over their covariance.
struct Nees {
  double pose;
  double all;
};
Nees nees_of_drive(const UkfParameters& p, std::uint64_t seed) {
  RandomEngine engine = make_engine(seed, 4);
  const MotionParameters motion;
  const double scale = p.odometry.speed_scale_sigma * draw_normal(engine);
  const double bias = p.odometry.yaw_rate_bias_sigma * draw_normal(engine);
  constexpr double kSigma_m = 1.5;
  Pose2 truth{0.0, 0.0, uniform_between(-kPi, kPi, engine)};
  Ukf ukf(p, motion);
  auto start = pose_with_sigma(truth, 1.0, 0.1);
  start.pose.x += draw_normal(engine);
  start.pose.y += draw_normal(engine);
  start.pose.yaw = wrap_angle(truth.yaw + 0.1 * draw_normal(engine));
  ukf.initialize(start);
  for (int i = 1; i <= 600; ++i) {
    const Twist2 twist{1.5, 0.3 * std::sin(0.01 * i)};
    MotionStep step = make_motion_step(twist, 0.1, motion);
    const double factor = std::sqrt(p.odometry.motion_noise_factor);
    step.speed_sigma *= factor;
    step.input_sigma *= factor;
    step.yaw_rate_sigma *= factor;
    step.twist = {twist.speed_mps * (1.0 + scale), twist.yaw_rate_radps + bias};
    truth = move_noisily(truth, step, draw_motion_noise(engine));
    ukf.move(twist, 0.1);
    if (i % 10 != 0) continue;
    const Eigen::Vector2d noise(kSigma_m * draw_normal(engine), kSigma_m * draw_normal(engine));
    ukf.correct(fix_at(truth.position() + noise, kSigma_m, 0.1 * i));
  }
  Ukf::State error = ukf.state();
  error -= (Ukf::State() << truth.x, truth.y, truth.yaw, scale, bias).finished();
  error[2] = wrap_angle(error[2]);
  const Eigen::Vector3d pose_error = error.head<3>();
  return {pose_error.dot(ukf.estimate().covariance.inverse() * pose_error),
          error.dot(ukf.covariance().inverse() * error)};
}

TEST(Ukf, IsConsistentInTheOpen) {
  constexpr int kSeeds = 200;
  Nees mean{0.0, 0.0};
  for (int seed = 0; seed < kSeeds; ++seed) {
    const Nees nees = nees_of_drive(plain(), seed);
    mean.pose += nees.pose / kSeeds;
    mean.all += nees.all / kSeeds;
  }
  // Mean of as many chi-squared values of n degrees of freedom: n, with a variance of 2 n / kSeeds.
  EXPECT_NEAR(mean.pose, 3.0, 3.0 * std::sqrt(6.0 / kSeeds));
  EXPECT_NEAR(mean.all, 5.0, 3.0 * std::sqrt(10.0 / kSeeds));
}

TEST(Ukf, DefaultsAreNotOverconfidentInTheOpen) {
  constexpr int kSeeds = 50;
  double mean = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) mean += nees_of_drive(published_ukf(), 100 + seed).pose / kSeeds;
  // Robust weights and inflation for correlation, where neither is called for, make it careful, but not useless.
  EXPECT_LT(mean, 3.0 + 3.0 * std::sqrt(6.0 / kSeeds));
  EXPECT_GT(mean, 0.9);
}

// A receiver that declares 5 m and is good to 0.5 m, and one that declares 1 m and is good to 8 m; errors last 20 s.
TEST(Ukf, LearnsHowGoodFixesAre) {
  for (const auto& [declared_m, sigma_m] : {std::pair{5.0, 0.5}, {1.0, 8.0}}) {
    double nees = 0.0;
    constexpr int kSeeds = 20;
    for (int seed = 0; seed < kSeeds; ++seed) {
      RandomEngine engine = make_engine(seed, 9);
      Ukf ukf(UkfParameters(), {});
      Pose2 truth;
      ukf.initialize(pose_with_sigma(truth, 1.0, 0.1));
      Eigen::Vector2d error(sigma_m * draw_normal(engine), sigma_m * draw_normal(engine));
      const double kept = std::exp(-1.0 / 20.0);
      for (int i = 1; i <= 6000; ++i) {
        const Twist2 twist{1.5, 0.2 * std::sin(0.005 * i)};
        truth = move(truth, twist, 0.1);
        ukf.move(twist, 0.1);
        if (i % 10 != 0) continue;
        const Eigen::Vector2d fresh(draw_normal(engine), draw_normal(engine));
        error = kept * error + sigma_m * std::sqrt(1.0 - kept * kept) * fresh;
        ukf.correct(fix_at(truth.position() + error, declared_m, 0.1 * i));
      }
      const Eigen::Vector2d off = ukf.pose().position() - truth.position();
      nees += off.dot(ukf.estimate().covariance.topLeftCorner<2, 2>().inverse() * off) / kSeeds;
    }
    EXPECT_LT(nees, 2.0 + 3.0 * std::sqrt(4.0 / kSeeds)) << declared_m << ' ' << sigma_m;
    EXPECT_GT(nees, 0.05) << declared_m << ' ' << sigma_m;
  }
}

TEST(Ukf, LearnsSpeedScaleAndYawRateBias) {
  RandomEngine engine = make_engine(5);
  Ukf ukf(published_ukf(), {});
  constexpr double kScale = 0.025;
  constexpr double kBias_radps = -0.004;
  Pose2 truth;
  ukf.initialize(pose_with_sigma(truth, 1.0, 0.1));
  for (int i = 1; i <= 6000; ++i) {
    const Twist2 measured{1.5, 0.2 * std::sin(0.005 * i)};
    truth = move(truth, {measured.speed_mps * (1.0 + kScale), measured.yaw_rate_radps + kBias_radps}, 0.1);
    ukf.move(measured, 0.1);
    if (i % 10 == 0) {
      const Eigen::Vector2d noise(1.5 * draw_normal(engine), 1.5 * draw_normal(engine));
      ukf.correct(fix_at(truth.position() + noise, 1.5, 0.1 * i));
    }
  }
  EXPECT_NEAR(ukf.speed_scale(), kScale, 0.01);
  EXPECT_NEAR(ukf.yaw_rate_bias_radps(), kBias_radps, 0.001);
  EXPECT_LT(std::sqrt(ukf.covariance()(3, 3)), 0.01);
  EXPECT_LT(std::sqrt(ukf.covariance()(4, 4)), 0.001);
  EXPECT_TRUE(near(ukf.pose(), truth, 1.5));
}

TEST(Ukf, AnyCovarianceToStartFromBecomesPositiveDefinite) {
  Ukf ukf(UkfParameters(), {});
  PoseEstimate start;
  for (const double off : {0.0, 5.0, -1e6}) {
    start.covariance = Eigen::Vector3d(1.0, 0.0, off < 0.0 ? -1.0 : 1e-9).asDiagonal();
    start.covariance(0, 1) = off;
    ukf.initialize(start);
    EXPECT_TRUE(is_sound(ukf)) << off;
    ukf.move({1.0, 0.1}, 0.1);
    ukf.correct(fix_at({1.0, 1.0}, 1.0));
    EXPECT_TRUE(is_sound(ukf)) << off;
  }
}

TEST(Ukf, StaysSoundOverManyStepsOfAnyKind) {
  RandomEngine engine = make_engine(6);
  for (const auto policy : {OutlierPolicy::kStudentT, OutlierPolicy::kGate, OutlierPolicy::kNone}) {
    UkfParameters p;
    p.outliers = policy;
    Ukf ukf(p, {});
    ukf.initialize(pose_with_sigma({}, 1.0, 0.5));
    for (int i = 0; i < 100000; ++i) {
      const bool is_parked = (i / 2000) % 5 == 4;
      const bool is_wild = (i / 1000) % 17 == 16;
      Twist2 twist{uniform_between(-2.0, 15.0, engine), uniform_between(-1.0, 1.0, engine)};
      if (is_parked) twist = {};
      if (is_wild) twist = {uniform_between(-150.0, 150.0, engine), uniform_between(-50.0, 50.0, engine)};
      ukf.move(twist, is_wild ? uniform_between(1e-6, 2.0, engine) : 0.02);
      if (i % 20 != 0) continue;
      const double sigmas[] = {1e-3, 0.3, 3.0, 600.0, 1e6};
      FixMeasurement fix = fix_at(ukf.pose().position(), sigmas[engine() % 5], 0.02 * i);
      const double off = draw_uniform(engine) < 0.05 ? 1e5 : 3.0;
      fix.position += off * Eigen::Vector2d(draw_normal(engine), draw_normal(engine));
      fix.antenna_in_body = {draw_normal(engine), draw_normal(engine)};
      ukf.correct(fix);
      ASSERT_TRUE(is_sound(ukf)) << i << '\n' << ukf.covariance();
    }
    EXPECT_LE(ukf.health().heading_sigma_rad, kPi / std::sqrt(3.0) + 1e-9);
  }
}

TEST(Ukf, FindsAHeadingThatIsUnknown) {
  int found = 0;
  for (int seed = 0; seed < 20; ++seed) {
    RandomEngine engine = make_engine(seed, 7);
    Pose2 truth{0.0, 0.0, uniform_between(-kPi, kPi, engine)};
    Ukf ukf(UkfParameters(), {});
    ukf.initialize(pose_with_sigma({}, 2.0, kPi / std::sqrt(3.0)));
    for (int i = 1; i <= 1200; ++i) {
      const Twist2 twist{1.5, 0.1};
      truth = move(truth, twist, 0.1);
      ukf.move(twist, 0.1);
      const Eigen::Vector2d noise(draw_normal(engine), draw_normal(engine));
      if (i % 10 == 0) ukf.correct(fix_at(truth.position() + noise, 1.0, 0.1 * i));
    }
    if (near(ukf.pose(), truth, 1.5)) ++found;
  }
  EXPECT_GE(found, 18);
}

}  // namespace
}  // namespace urban_gnss
