#include <gtest/gtest.h>

#include <cmath>

#include "matchers.hpp"
#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/gnss/fix_noise_model.hpp"

namespace urban_gnss {
namespace {

FixNoiseModelParameters make(const std::string& changes = "{}") {
  return with(with(FixNoiseModelParameters{}, "first_fix_scale: 1.0"), changes);
}

/// Where the factor settles for fixes whose errors are `sigma` times the declared, a share of them outliers.
double settled_scale(double sigma, double outlier_share, const FixNoiseModelParameters& parameters) {
  FixNoiseModel model(parameters);
  RandomEngine engine = make_engine(3);
  double log_sum = 0.0;
  constexpr int kCount = 20000;
  for (int k = 0; k < kCount; ++k) {
    double x = sigma * draw_normal(engine);
    if (draw_uniform(engine) < outlier_share) x += 1e6;
    const double y = sigma * draw_normal(engine);
    model.learn(k, (x * x + y * y) / model.scale() > LearntScale::kMedianNis ? 1.0 : 0.0);
    if (k >= kCount / 2) log_sum += std::log(model.scale());
  }
  return std::exp(log_sum / (kCount / 2));
}

TEST(FixNoiseModel, LearnsTheReceiversFactorWhateverTheOutliers) {
  const FixNoiseModelParameters parameters = make("fix_scale_rate: 0.01");
  for (const double sigma : {0.2, 1.0, 5.0}) {
    EXPECT_NEAR(settled_scale(sigma, 0.0, parameters) / (sigma * sigma), 1.0, 0.05) << sigma;
    // With a fifth of outliers, half of all is 0.625 of the others: their quantile, 1.96, over the median.
    EXPECT_NEAR(settled_scale(sigma, 0.2, parameters) / (sigma * sigma), 1.96 / 1.386, 0.08) << sigma;
  }
}

TEST(FixNoiseModel, StaysWithinItsLimit) {
  EXPECT_NEAR(settled_scale(100.0, 0.0, make("fix_scale_limit: 3.0")), 9.0, 1e-3);
  EXPECT_NEAR(settled_scale(0.01, 0.0, make("fix_scale_limit: 3.0")), 1.0 / 9.0, 0.02);
  EXPECT_EQ(settled_scale(100.0, 0.0, make("fix_scale_rate: 0.0")), 1.0);
}

TEST(FixNoiseModel, BeginsWithItsFirstScaleWhereItLearns) {
  EXPECT_DOUBLE_EQ(FixNoiseModel(make("first_fix_scale: 4.0")).scale(), 4.0);
  EXPECT_DOUBLE_EQ(FixNoiseModel(make("{first_fix_scale: 4.0, fix_scale_rate: 0.0}")).scale(), 1.0);
}

TEST(FixNoiseModel, BelievesDeclaredUpsAndDownsByItsWeight) {
  Eigen::Matrix2d usual;
  usual << 4.0, 1.0, 1.0, 9.0;
  for (const double weight : {0.0, 0.5, 1.0}) {
    FixNoiseModel model(make("fix_covariance_weight: " + std::to_string(weight)));
    for (int k = 0; k < 50; ++k) EXPECT_NEAR((model.effective_covariance(usual) - usual).norm(), 0.0, 1e-9);
    // A fix that declares three times that moves the mean a little itself; the ellipse keeps its shape.
    const Eigen::Matrix2d raised = model.effective_covariance(3.0 * usual);
    const double expected = std::pow(3.0, weight + (1.0 - weight) * 0.03);
    EXPECT_NEAR((raised - expected * usual).norm() / raised.norm(), 0.0, 1e-9) << weight;
    // One that is worth nothing stays worth next to nothing.
    EXPECT_GT(model.effective_covariance(1e6 * usual).trace(), 0.24e6 * usual.trace()) << weight;
    model.reset();
    EXPECT_NEAR((model.effective_covariance(3.0 * usual) - 3.0 * usual).norm(), 0.0, 1e-9);
  }
}

TEST(FixNoiseModel, CorrelatedFixesAreWorthLess) {
  FixNoiseModel model(make("{correlation_time: 2.0, correlation_distance: 4.0}"));
  EXPECT_EQ(model.correlation_inflation(0.0), 1.0);  // nothing to be correlated with
  model.learn(0.0, 0.5);
  model.move({5.0, 0.0}, 1.0);
  const double a = std::exp(-0.5 - 5.0 / 4.0);
  EXPECT_NEAR(model.correlation_inflation(1.0), (1.0 + a) / (1.0 - a), 1e-9);
  EXPECT_NEAR(model.correlation_inflation(1000.0), 1.0, 1e-9);
  EXPECT_TRUE(std::isfinite(model.correlation_inflation(-5.0)));
  model.learn(1.0, 0.5);
  EXPECT_GT(model.correlation_inflation(1.0), 1e3);  // the same instant and place say nothing new
  EXPECT_TRUE(std::isfinite(model.correlation_inflation(1.0)));
  model.move({0.0, 0.0}, 1.0);
  const double b = std::exp(-0.5);  // who stands meets the same reflections
  EXPECT_NEAR(model.correlation_inflation(2.0), (1.0 + b) / (1.0 - b), 1e-6);
  model.reset();
  EXPECT_EQ(model.correlation_inflation(2.0), 1.0);
}

/// The factor after fixes each second whose errors are a Markov process of standard deviation `sigma` m, declared as
/// 1 m, to a filter that follows them: its innovations say nothing. The odometry is off by `drift` m/s.
double followed_scale(double sigma, double correlation_s, double lag_s, double drift, double walk_m2_per_s) {
  FixNoiseModel model(make("{fix_scale_rate: 0.01, fix_scale_lag: " + std::to_string(lag_s) + "}"));
  RandomEngine engine = make_engine(4);
  const double a = std::exp(-1.0 / correlation_s);
  const auto draw = [&] { return Eigen::Vector2d(sigma * draw_normal(engine), sigma * draw_normal(engine)); };
  Eigen::Vector2d error = draw();
  double log_sum = 0.0;
  constexpr int kCount = 20000;
  for (int k = 0; k < kCount; ++k) {
    error = a * error + std::sqrt(1.0 - a * a) * draw();
    model.learn(k, 0.0);
    DeadReckonedFix fix;
    fix.misfit = error + Eigen::Vector2d(drift * k, 0.0);
    fix.covariance.setIdentity();
    fix.place = {5.0 * k, 0.0};
    fix.walk_m2 = walk_m2_per_s * k;
    fix.time_s = k;
    fix.way_m = 5.0 * k;
    model.compare(fix);
    if (k >= kCount / 2) log_sum += std::log(model.scale());
  }
  return std::exp(log_sum / (kCount / 2));
}

TEST(FixNoiseModel, FixesFartherApartThanTheReceiverSmoothsTellTheirErrors) {
  const double limit = FixNoiseModelParameters{}.fix_scale_limit;
  const double least = 1.0 / (limit * limit);
  EXPECT_NEAR(followed_scale(2.0, 5.0, 0.0, 0.0, 0.0), least, 0.1 * least);  // nothing to stop it
  for (const double sigma : {0.3, 1.0, 3.0}) {
    EXPECT_NEAR(followed_scale(sigma, 5.0, 30.0, 0.0, 0.0) / (sigma * sigma), 1.0, 0.15) << sigma;
    // Closer together they share 1 - exp(-10 / 8) of their variance.
    EXPECT_NEAR(followed_scale(sigma, 8.0, 10.0, 0.0, 0.0) / (sigma * sigma), 0.71, 0.15) << sigma;
  }
}

TEST(FixNoiseModel, WhatTheOdometryIsUnsureOfIsNoErrorOfTheFixes) {
  EXPECT_GT(followed_scale(2.0, 2.0, 20.0, 0.2, 0.0), 4.5);
  EXPECT_NEAR(followed_scale(2.0, 2.0, 20.0, 0.2, 5.0), 1.0, 0.3) << "says nothing: what it was at first";
}

TEST(FixNoiseModel, AResetForgetsTheFactor) {
  FixNoiseModel model(make());
  for (int k = 0; k < 50; ++k) model.learn(k, 1.0);
  EXPECT_GT(model.scale(), 2.0);
  model.reset();
  EXPECT_EQ(model.scale(), 1.0);
}

}  // namespace
}  // namespace urban_gnss
