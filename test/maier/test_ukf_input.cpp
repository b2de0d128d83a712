#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <sstream>

#include "ukf_rig.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(UkfInput, BadInputChangesNothing) {
  Ukf ukf(UkfParameters(), {});
  ukf.initialize(pose_with_sigma({1.0, 2.0, 0.5}, 1.0, 0.1));
  ukf.move({1.0, 0.1}, 0.1);
  const Ukf::State state = ukf.state();
  const Ukf::Covariance covariance = ukf.covariance();
  for (const double bad : {kNaN, kInfinity, -kInfinity}) {
    ukf.move({bad, 0.0}, 0.1);
    ukf.move({1.0, bad}, 0.1);
    ukf.move({1.0, 0.0}, bad);
    for (int field = 0; field < 6; ++field) {
      FixMeasurement fix = fix_at({1.0, 2.0}, 1.0, 1.0);
      double* const fields[] = {&fix.position.x(),     &fix.antenna_in_body.y(), &fix.time_s,
                                &fix.covariance(0, 0), &fix.covariance(0, 1),    &fix.covariance(1, 1)};
      *fields[field] = bad;
      const FixOutcome outcome = ukf.correct(fix);
      EXPECT_TRUE(is_rejected(outcome.decision)) << field;
      EXPECT_FALSE(outcome.reason.empty());
    }
  }
  ukf.move({1.0, 0.0}, 0.0);
  ukf.move({1.0, 0.0}, -0.1);
  ukf.move({1e308, 0.0}, 1e3);
  for (const double variance : {0.0, -1.0}) {
    FixMeasurement fix = fix_at({1.0, 2.0}, 1.0, 1.0);
    fix.covariance(1, 1) = variance;
    EXPECT_EQ(ukf.correct(fix).decision, FixDecision::kRejectedNonFinite);
  }
  EXPECT_EQ(ukf.state(), state);
  EXPECT_EQ(ukf.covariance(), covariance);

  PoseEstimate start;
  start.pose.x = kNaN;
  EXPECT_THROW(ukf.initialize(start), std::invalid_argument);
  start = {};
  start.covariance(0, 0) = kInfinity;
  EXPECT_THROW(ukf.initialize(start), std::invalid_argument);
  EXPECT_EQ(ukf.state(), state);
}

TEST(UkfInput, ParkedRobotStays) {
  Ukf ukf(UkfParameters(), {});
  ukf.initialize(pose_with_sigma({1.0, 2.0, 0.5}, 0.5, 0.1));
  for (int i = 0; i < 36000; ++i) ukf.move({0.0, 0.002}, 0.1);  // an hour, with a gyroscope's bias
  EXPECT_TRUE(near(ukf.pose(), {1.0, 2.0, 0.5}, 0.0));
  EXPECT_NEAR(ukf.health().heading_sigma_rad, 0.1, 1e-12);
  EXPECT_NEAR(ukf.covariance()(0, 0), 0.25 + 0.03 * 0.03 * 3600.0, 1e-6);
  double sigma = 0.0;
  for (int i = 0; i < 7200; ++i) {
    ukf.move({}, 1.0);
    ukf.correct(fix_at({1.5, 2.0}, 3.0, i));
    if (i == 3600) sigma = ukf.health().position_spread_m;
  }
  EXPECT_GT(ukf.health().position_spread_m, 0.3) << "two hours of fixes with one error say no more than a few";
  EXPECT_NEAR(ukf.health().position_spread_m, sigma, 1e-3);
}

Ukf settled(OutlierPolicy policy) {
  UkfParameters p = published_ukf();
  p.outliers = policy;
  Ukf ukf(p, {});
  ukf.initialize(pose_with_sigma({}, 1.0, 0.05));
  for (int i = 1; i <= 60; ++i) {
    for (int k = 0; k < 10; ++k) ukf.move({1.0, 0.0}, 0.1);
    ukf.correct(fix_at({1.0 * i, 0.0}, 2.0, i));
  }
  return ukf;
}

TEST(UkfInput, OutlierDoesNotCorruptHeadingOrBias) {
  const auto shift = [](OutlierPolicy policy, FixDecision expected) {
    Ukf ukf = settled(policy);
    const Ukf::State before = ukf.state();
    const FixOutcome outcome = ukf.correct(fix_at({60.0, 100.0}, 2.0, 61.0));
    EXPECT_EQ(outcome.decision, expected);
    EXPECT_GT(outcome.nis, 500.0);
    EXPECT_NEAR(outcome.nis_threshold, 9.2103, 1e-4);
    EXPECT_EQ(outcome.nis_dof, 2);
    return Ukf::State((ukf.state() - before).cwiseAbs());
  };
  const auto none = shift(OutlierPolicy::kNone, FixDecision::kAccepted);
  const auto student = shift(OutlierPolicy::kStudentT, FixDecision::kInflated);
  EXPECT_GT(none[1], 3.0);
  EXPECT_LT(student[1], 0.1);
  EXPECT_LT(student[2], 0.003);
  EXPECT_LT(student[4], 1e-4);
  EXPECT_EQ(shift(OutlierPolicy::kGate, FixDecision::kRejectedGate), Ukf::State::Zero());
}

TEST(UkfInput, GoodFixIsAccepted) {
  for (const auto policy : {OutlierPolicy::kNone, OutlierPolicy::kStudentT, OutlierPolicy::kGate}) {
    Ukf ukf = settled(policy);
    const FixOutcome outcome = ukf.correct(fix_at({60.5, 0.5}, 2.0, 61.0));
    EXPECT_EQ(outcome.decision, FixDecision::kAccepted);
    EXPECT_LT(outcome.nis, 1.0);
    EXPECT_GT(outcome.nis, 0.0);
  }
}

TEST(UkfInput, GateRestartsOnTheFixAfterTheTimeout) {
  Ukf ukf = settled(OutlierPolicy::kGate);
  const double yaw = ukf.pose().yaw;
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(ukf.correct(fix_at({60.0, 100.0}, 2.0, 61.0 + i)).decision, FixDecision::kRejectedGate) << i;
  }
  const FixOutcome outcome = ukf.correct(fix_at({60.0, 100.0}, 2.0, 66.0));
  EXPECT_EQ(outcome.decision, FixDecision::kAccepted);
  EXPECT_NE(outcome.reason.find("restarted"), std::string::npos);
  EXPECT_TRUE(near(ukf.pose(), {60.0, 100.0, yaw}, 1e-9));
  EXPECT_NEAR(ukf.health().position_spread_m, 2.0 * std::sqrt(2.0), 1e-9);

  // One fix in between that passes: the time starts anew.
  ukf = settled(OutlierPolicy::kGate);
  for (const double t : {61.0, 64.0}) ukf.correct(fix_at({60.0, 100.0}, 2.0, t));
  EXPECT_EQ(ukf.correct(fix_at(ukf.pose().position(), 2.0, 65.0)).decision, FixDecision::kAccepted);
  EXPECT_EQ(ukf.correct(fix_at({60.0, 100.0}, 2.0, 67.0)).decision, FixDecision::kRejectedGate);
}

TEST(UkfInput, InfiniteCovarianceLeavesTheEstimate) {
  Ukf ukf = settled(OutlierPolicy::kStudentT);
  const Ukf::State before = ukf.state();
  ukf.correct(fix_at({90.0, 30.0}, 600.0, 61.0));
  EXPECT_LT((ukf.state() - before).head<2>().norm(), 0.01);
}

TEST(UkfInput, LeverArmAndLatenessAreInThePrediction) {
  Ukf ukf(plain(), noise_free());
  const Pose2 pose{5.0, -3.0, 1.2};
  ukf.initialize(pose_with_sigma(pose, 0.3, 0.01));
  FixMeasurement fix = fix_at(transform_point(pose, {-8.0, 0.5}), 1.0);
  fix.antenna_in_body = {-8.0, 0.5};
  EXPECT_LT(ukf.correct(fix).nis, 1e-4);
  EXPECT_TRUE(near(ukf.pose(), pose, 1e-3));
  // A fix beside the one that a long lever arm predicts turns the robot.
  const double yaw = ukf.pose().yaw;
  fix.position += transform_point({0.0, 0.0, pose.yaw}, {0.0, -1.0});
  ukf.correct(fix);
  EXPECT_GT(ukf.pose().yaw, yaw + 1e-4);
}

TEST(UkfInput, CorrelatedErrorsTellLess) {
  const auto variance_after = [](double tau_s, double interval_s, double sigma) {
    auto p = plain();
    p.fix_noise.errors.time = tau_s;
    Ukf ukf(p, noise_free());
    ukf.initialize(pose_with_sigma({}, 1.0, 0.0));
    ukf.correct(fix_at({0.0, 0.0}, 1.0, 100.0));
    EXPECT_NEAR(ukf.covariance()(0, 0), 0.5, 1e-6) << "the first counts in full";
    ukf.correct(fix_at({0.0, 0.0}, sigma, 100.0 + interval_s));
    return ukf.covariance()(0, 0);
  };
  const double a = std::exp(-0.5);
  const double inflated = std::sqrt((1.0 + a) / (1.0 - a));
  EXPECT_NEAR(variance_after(10.0, 5.0, 1.0), variance_after(0.0, 5.0, inflated), 1e-9);
  EXPECT_NEAR(variance_after(0.1, 5.0, 1.0), 1.0 / 3.0, 1e-6);
  EXPECT_NEAR(variance_after(10.0, 0.0, 1.0), 0.5, 1e-5) << "the same fix twice";
}

TEST(UkfInput, EveryParameterHasAnEffect) {
  const auto outcome = [](const UkfParameters& p) {
    Ukf ukf(p, {});
    ukf.initialize(pose_with_sigma({}, 1.0, 0.5));
    RandomEngine engine = make_engine(8);
    std::ostringstream text;
    text.precision(17);
    for (int i = 1; i <= 300; ++i) {
      ukf.move(i % 100 < 90 ? Twist2{2.0, 0.2} : Twist2{}, 0.1);
      const double off = i > 200 ? 60.0 : 1.0;
      if (i % 10 == 0 && (i < 130 || i > 180)) {
        const Eigen::Vector2d aside = off * Eigen::Vector2d(draw_normal(engine), 1.0);
        const double sigma = i > 100 ? 2.0 : 3.0;
        const FixOutcome outcome = ukf.correct(fix_at(ukf.pose().position() + aside, sigma, 0.1 * i));
        text << static_cast<int>(outcome.decision);
      }
    }
    text << ukf.state() << ukf.covariance() << ukf.estimate().covariance;
    return text.str();
  };
  for (const std::string& name : parameter_names(UkfParameters())) {
    const bool is_of_gate = name.rfind("gate_", 0) == 0;
    auto base = with(UkfParameters(), is_of_gate ? "outliers: gate" : "outliers: student_t");
    base.reacquisition.reacquisition_gap = 4.0;
    if (name == "common_error_max") base.common_error.common_error_min = 0.1;
    const std::string value = name == "mode"               ? "as_printed"
                              : name == "outliers"         ? "none"
                              : name == "gate_probability" ? "0.05"
                              : name == "gate_timeout"     ? "2.0"
                              : name == "ukf_alpha"        ? "0.9"
                              : name == "ukf_beta"         ? "0.0"
                              : name == "fix_scale_limit"  ? "1.1"
                              : name == "fix_scale_lag"    ? "25.0"
                              : name == "common_error_min" ? "3.0"
                                                           : "0.2";
    EXPECT_NE(outcome(with(base, name + ": " + value)), outcome(base)) << name;
  }
}

TEST(UkfInput, IsALocalizer) {
  Ukf ukf(UkfParameters(), {});
  const Localizer& localizer = ukf;
  EXPECT_STREQ(localizer.name(), "ukf");
  EXPECT_EQ(localizer.mode(), "student_t");
  EXPECT_FALSE(localizer.wants_bias());
  ukf.initialize(pose_with_sigma({1.0, 2.0, 0.3}, 2.0, 0.1));
  EXPECT_EQ(ukf.pose(), (Pose2{1.0, 2.0, 0.3}));
  EXPECT_NEAR(localizer.health().heading_sigma_rad, 0.1, 1e-12);
  EXPECT_NEAR(localizer.health().position_spread_m, 2.0 * std::sqrt(2.0), 1e-12);
  EXPECT_EQ(localizer.health().particle_count, 0u);
}

}  // namespace
}  // namespace urban_gnss
