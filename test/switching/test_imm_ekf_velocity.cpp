// What imm_ekf makes of the receiver's velocity.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "switching_rig.hpp"
#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"

namespace urban_gnss {
namespace {

ImmEkf make(const std::string& changes = "{}") {
  const ImmEkfParameters plain = with(ImmEkfParameters{}, "yaw_rate_scale_sigma: 0.0");
  return ImmEkf(with(with(plain, kTextbookNoise), changes), {});
}

VelocityMeasurement velocity_of(const Eigen::Vector2d& velocity, const Twist2& twist, double sigma = 0.1) {
  VelocityMeasurement measurement;
  measurement.velocity = velocity;
  measurement.covariance = isotropic(sigma);
  measurement.antenna_velocity_in_body = {twist.speed_mps, 0.0};
  return measurement;
}

/// Drives a loop with velocities only, one a second, from a heading that is wrong by `yaw_error`, a share of them off
/// by 20 m/s in any direction. The error of the heading at the end.
double heading_after_loop(ImmEkf& imm, double yaw_error, double outlier_share, double duration_s = 60.0) {
  constexpr Twist2 kTwist{3.0, 0.05};
  RandomEngine engine = make_engine(21);
  Pose2 truth{5.0, -3.0, 1.0};
  imm.initialize(pose_with_sigma({5.0, -3.0, 1.0 + yaw_error}, 1.0, 0.3));
  for (int k = 1; k <= 10.0 * duration_s; ++k) {
    truth = move(truth, kTwist, 0.1);
    imm.move(kTwist, 0.1);
    if (k % 10 != 0) continue;
    const Eigen::Vector2d noise(0.1 * draw_normal(engine), 0.1 * draw_normal(engine));
    Eigen::Vector2d velocity = kTwist.speed_mps * Eigen::Vector2d(std::cos(truth.yaw), std::sin(truth.yaw)) + noise;
    const double direction = uniform_between(-kPi, kPi, engine);
    if (draw_uniform(engine) < outlier_share)
      velocity += 20.0 * Eigen::Vector2d(std::cos(direction), std::sin(direction));
    imm.correct_velocity(velocity_of(velocity, kTwist));
  }
  return std::abs(angle_difference(imm.pose().yaw, truth.yaw));
}

TEST(ImmEkfVelocity, MakesAWrongHeadingRight) {
  ImmEkf imm = make();
  EXPECT_TRUE(imm.takes_velocity());
  EXPECT_LT(heading_after_loop(imm, 0.3, 0.0), 0.03);
  EXPECT_LT(imm.health().heading_sigma_rad, 0.03);
}

TEST(ImmEkfVelocity, OutliersSayLittle) {
  ImmEkf imm = make();
  EXPECT_LT(heading_after_loop(imm, 0.3, 0.2), 0.05);
  ImmEkf gaussian = make("velocity_dof: 1.0e+9");
  EXPECT_GT(heading_after_loop(gaussian, 0.3, 0.2), 0.05);
}

TEST(ImmEkfVelocity, LearnsTheReceiversScale) {
  const auto sigma_after = [](double declared) {
    ImmEkf imm = make("velocity_scale_rate: 0.1");
    RandomEngine engine = make_engine(4);
    imm.initialize(pose_with_sigma({}, 1.0, 0.01));
    for (int k = 0; k < 300; ++k) {
      imm.move({3.0, 0.0}, 1.0);
      const Eigen::Vector2d noise(draw_normal(engine), draw_normal(engine));
      imm.correct_velocity(velocity_of(Eigen::Vector2d(3.0, 0.0) + 0.5 * noise, {3.0, 0.0}, declared));
    }
    return imm.health().heading_sigma_rad;
  };
  const double honest = sigma_after(0.5);
  EXPECT_NEAR(sigma_after(0.05) / honest, 1.0, 0.25);
  EXPECT_NEAR(sigma_after(5.0) / honest, 1.0, 0.25);
}

TEST(ImmEkfVelocity, ChangesNothingOfAParkedRobot) {
  ImmEkf imm = make();
  drive(imm, {});
  imm.move({0.0, 0.0}, 1.0);
  const ImmEkf::Gaussian before = imm.mixture();
  RandomEngine engine = make_engine(5);
  for (int k = 0; k < 100; ++k) {
    imm.correct_velocity(velocity_of({0.3 * draw_normal(engine), 0.3 * draw_normal(engine)}, {0.0, 0.0}));
  }
  EXPECT_LT((imm.mixture().mean - before.mean).norm(), 1e-12);
  EXPECT_LT((imm.mixture().covariance - before.covariance).norm(), 1e-12);
}

TEST(ImmEkfVelocity, RefusesWhatCannotBeUsed) {
  ImmEkf imm = make();
  drive(imm, {});
  const ImmEkf::Gaussian before = imm.mixture();
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double bad : {kNaN, kInfinity, -kInfinity}) {
    for (int field = 0; field < 5; ++field) {
      VelocityMeasurement velocity = velocity_of({1.0, 0.0}, {1.0, 0.0});
      double* const fields[] = {&velocity.velocity.x(), &velocity.velocity.y(), &velocity.covariance(0, 0),
                                &velocity.antenna_velocity_in_body.x(), &velocity.antenna_velocity_in_body.y()};
      *fields[field] = bad;
      imm.correct_velocity(velocity);
    }
  }
  VelocityMeasurement velocity = velocity_of({1.0, 0.0}, {1.0, 0.0});
  velocity.covariance.setZero();
  imm.correct_velocity(velocity);
  velocity.covariance = Eigen::Vector2d(1.0, -1.0).asDiagonal();
  imm.correct_velocity(velocity);
  EXPECT_EQ(imm.mixture().mean, before.mean);
  EXPECT_EQ(imm.mixture().covariance, before.covariance);
}

/// The update by the textbook, with the Jacobian of an independent measurement function by differences.
TEST(ImmEkfVelocity, IsTheKalmanUpdateOfItsMeasurement) {
  ImmEkf imm = make("{direct_time: 1.0e+15, outlier_share: 0.0, velocity_dof: 1.0e+12, velocity_scale_rate: 0.0}");
  drive(imm, {});
  const ImmEkf::Gaussian before = imm.given(BiasMode::kDirect);
  const Eigen::Vector2d in_body(4.0, -0.7);
  const auto measure = [&](const BiasEkfState& state) {
    const double yaw = state[2];
    const double factor = 1.0 + state[3];
    return Eigen::Vector2d(factor * (in_body.x() * std::cos(yaw) - in_body.y() * std::sin(yaw)),
                           factor * (in_body.x() * std::sin(yaw) + in_body.y() * std::cos(yaw)));
  };
  Eigen::Matrix<double, 2, kBiasStates> h;
  constexpr double kStep = 1e-5;
  for (int i = 0; i < kBiasStates; ++i) {
    BiasEkfState up = before.mean;
    BiasEkfState down = before.mean;
    up[i] += kStep;
    down[i] -= kStep;
    h.col(i) = (measure(up) - measure(down)) / (2.0 * kStep);
  }
  VelocityMeasurement velocity;
  velocity.antenna_velocity_in_body = in_body;
  velocity.velocity = measure(before.mean) + Eigen::Vector2d(0.05, -0.03);
  velocity.covariance << 0.01, 0.004, 0.004, 0.02;
  const Eigen::Matrix2d s = h * before.covariance * h.transpose() + velocity.covariance;
  const Eigen::Matrix<double, kBiasStates, 2> gain = before.covariance * h.transpose() * s.inverse();
  const BiasEkfState mean = before.mean + gain * Eigen::Vector2d(0.05, -0.03);
  const BiasEkfCovariance covariance = before.covariance - gain * s * gain.transpose();
  imm.correct_velocity(velocity);
  const ImmEkf::Gaussian after = imm.given(BiasMode::kDirect);
  EXPECT_GT((after.mean - before.mean).norm(), 1e-4);
  EXPECT_LT((after.mean - mean).norm(), 1e-8);
  EXPECT_LT((after.covariance - covariance).norm(), 1e-8);
}

TEST(ImmEkfVelocity, EveryParameterHasAnEffect) {
  const auto heading = [](const std::string& changes) {
    ImmEkf imm = make(changes);
    heading_after_loop(imm, 0.3, 0.2);
    return imm.pose().yaw;
  };
  const double base = heading("{}");
  for (const char* change : {"velocity_scale_rate: 0.1", "velocity_scale_limit: 1.01", "velocity_dof: 5.0",
                             "first_velocity_scale: 1.0", "velocity_correlation_time: 2.0"}) {
    EXPECT_NE(heading(change), base) << change;
  }
  EXPECT_EQ(parameter_names(VelocityNoiseParameters{}).size(), 5u);
}

}  // namespace
}  // namespace urban_gnss
