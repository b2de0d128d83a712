// The modes as Kim et al. print them, against the equations of the paper written out plainly.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "complementary_rig.hpp"
#include "matchers.hpp"
#include "urban_gnss_localization/localizers/registry.hpp"
#include "urban_gnss_localization/parameters/parameter_list.hpp"

namespace urban_gnss {
namespace {

using Matrix32 = Eigen::Matrix<double, 3, 2>;
using Matrix23 = Eigen::Matrix<double, 2, 3>;

/// The paper's equations with three states, and nothing else. The state x(k|k) of section 3.2 A is the error of the
/// fed-back pose.
struct PrintedFilter {
  enum class Use { kStandard, kGated, kCompensated };
  Use use;
  double alpha1, alpha4;               ///< Sigma_v: variances per squared speed and yaw rate, per Hz
  double position_walk, heading_walk;  ///< Sigma_N, as densities
  double m0;                           ///< m^2
  Eigen::Vector3d pose{Eigen::Vector3d::Zero()};
  Eigen::Vector3d x{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d p{Eigen::Vector3d(1.0, 1.0, 0.01).asDiagonal()};
  Matrix32 v{Matrix32::Zero()};  ///< V_x, and U_x between the fixes
  Eigen::Vector2d b{Eigen::Vector2d::Zero()};
  Eigen::Matrix2d m{Eigen::Matrix2d::Zero()};
  bool is_open{false};

  void predict(double speed, double yaw_rate, double tau) {
    const double c = std::cos(pose(2));
    const double s = std::sin(pose(2));
    Eigen::Matrix3d j = Eigen::Matrix3d::Identity();  // eq. (2)
    j(0, 2) = -tau * speed * s;
    j(1, 2) = tau * speed * c;
    Matrix32 k;
    k << tau * c, 0.0, tau * s, 0.0, 0.0, tau;
    const Eigen::Matrix2d sigma_v =
        Eigen::Vector2d(alpha1 * speed * speed, alpha4 * yaw_rate * yaw_rate).asDiagonal().toDenseMatrix() / tau;
    const Eigen::Vector3d sigma_n(position_walk * position_walk, position_walk * position_walk,
                                  heading_walk * heading_walk);
    pose += tau * Eigen::Vector3d(speed * c, speed * s, yaw_rate);  // eq. (1)
    x = j * x;                                                      // A.2
    p = j * p * j.transpose() + k * sigma_v * k.transpose();        // A.1
    p.diagonal() += tau * sigma_n;
    v = j * v;  // B.1, B = 0
  }

  /// Whether the fix was taken for biased.
  bool correct(const Eigen::Vector2d& fix, const Eigen::Matrix2d& r) {
    Matrix23 h = Matrix23::Zero();
    h.leftCols<2>().setIdentity();
    const Eigen::Vector2d difference = fix - pose.head<2>();  // figure 4: DGPS minus odometry
    const Eigen::Matrix2d tested = h * (p + v * m * v.transpose()) * h.transpose() + r;
    const bool is_biased = difference.dot(tested.inverse() * difference) > 7.81;  // section 4.2
    if (use == Use::kGated && is_biased) return true;
    if (use == Use::kCompensated && is_biased && !is_open) {
      m = m0 * Eigen::Matrix2d::Identity();
      v.setZero();
    }
    if (is_open && !is_biased) {
      x += v * b;
      p += v * m * v.transpose();
      v.setZero();
      b.setZero();
      m.setZero();
    }
    is_open = use == Use::kCompensated && is_biased;

    const Eigen::Vector2d innovation = difference - h * x;  // A.3, A.7
    const Eigen::Matrix2d s = h * p * h.transpose() + r;    // A.5
    const Matrix32 k_x = p * h.transpose() * s.inverse();   // A.4
    const Eigen::Matrix2d c = Eigen::Matrix2d::Identity();
    const Eigen::Matrix2d t = h * v + c;                                                            // B.2
    v -= k_x * t;                                                                                   // B.3
    m -= m * t.transpose() * (s + t * m * t.transpose()).inverse() * t * m;                         // B.4
    const Eigen::Matrix2d k_b = m * (v.transpose() * h.transpose() + c.transpose()) * r.inverse();  // B.5
    p -= k_x * s * k_x.transpose();                                                                 // A.5
    x += k_x * innovation;                                                                          // A.8
    b = (Eigen::Matrix2d::Identity() - k_b * t) * b + k_b * innovation;                             // B.6
    const Eigen::Vector3d estimate = x + v * b;                                                     // B.7, B.8
    pose += estimate;                                                                               // fed back
    x -= estimate;
    return is_biased;
  }
};

/// A drive with a bias from 60 to 90 s, and the filter of `mode` beside the plain one.
void expect_equal(ComplementaryMode mode, PrintedFilter::Use use, double rate_hz) {
  const std::string name = [&] {
    for (const auto& [text, value] : enum_names(ComplementaryMode())) {
      if (value == mode) return std::string(text);
    }
    return std::string();
  }();
  Drive drive(11, "{mode: " + name + "}", rate_hz);
  PrintedFilter plain{use,
                      drive.parameters.motion.odom_alpha1,
                      drive.parameters.motion.odom_alpha4,
                      drive.parameters.odometry.position_walk,
                      drive.parameters.odometry.heading_walk,
                      drive.parameters.fix_bias_sigma * drive.parameters.fix_bias_sigma};
  int biased = 0;
  int changes = 0;
  const long per_fix = std::lround(rate_hz);
  for (long k = 1; k <= 150 * per_fix; ++k) {
    if (k > 140 * per_fix) drive.speed_mps = 0.0;  // as printed a standstill is no exception
    drive.step();
    plain.predict(drive.speed_mps, drive.speed_mps > 0.0 ? 0.2 * std::sin(0.1 * drive.time_s) : 0.0, 1.0 / rate_hz);
    if (k % per_fix != 0) continue;
    drive.bias = [&](double) { return Eigen::Vector2d(k > 60 * per_fix && k <= 90 * per_fix ? 12.0 : 0.0, 0.0); };
    const FixMeasurement fix = drive.make_fix();
    const bool was_open = plain.is_open;
    const bool is_biased = plain.correct(fix.position, fix.covariance);
    const FixOutcome outcome = drive.filter.correct(fix);
    biased += is_biased;
    changes += was_open != plain.is_open;
    const std::string when = name + " at " + std::to_string(drive.time_s);
    ASSERT_EQ(outcome.nis > outcome.nis_threshold, is_biased) << when;
    ASSERT_EQ(is_rejected(outcome.decision), is_biased && use == PrintedFilter::Use::kGated) << when;
    ASSERT_EQ(outcome.decision == FixDecision::kBiasCompensated, plain.is_open) << when;
    ASSERT_EQ(drive.filter.is_bias_open(), plain.is_open) << when;
    ASSERT_TRUE(near(drive.filter.pose(), {plain.pose(0), plain.pose(1), wrap_angle(plain.pose(2))}, 1e-7)) << when;
    const Eigen::Matrix3d covariance = plain.p + plain.v * plain.m * plain.v.transpose();
    ASSERT_LT((drive.filter.estimate().covariance - covariance).cwiseAbs().maxCoeff(), 1e-7) << when;
    ASSERT_LT((drive.filter.bias() - plain.b).norm(), 1e-6) << when;
    ASSERT_LT((drive.filter.bias_covariance() - plain.m).norm(), 1e-6) << when;
    const ErrorCovariance errors = drive.filter.error_covariance();
    ASSERT_EQ(errors.bottomRows<2>().norm(), 0.0) << "three states";
    ASSERT_EQ(drive.filter.odometry_errors().speed_scale, 0.0);
    ASSERT_EQ(drive.filter.odometry_errors().yaw_rate_bias_radps, 0.0);
  }
  EXPECT_GT(biased, 0) << name;
  if (use == PrintedFilter::Use::kCompensated) {
    EXPECT_GE(changes, 2) << "it opened and closed";
  }
}

TEST(ComplementaryEkfAsPrinted, StandardIsSection2_3) {
  expect_equal(ComplementaryMode::kStandardAsPrinted, PrintedFilter::Use::kStandard, 10.0);
}
TEST(ComplementaryEkfAsPrinted, GatedAddsTheThreshold) {
  expect_equal(ComplementaryMode::kGatedAsPrinted, PrintedFilter::Use::kGated, 10.0);
}
TEST(ComplementaryEkfAsPrinted, CompensatedIsSection3) {
  expect_equal(ComplementaryMode::kCompensatedAsPrinted, PrintedFilter::Use::kCompensated, 10.0);
  expect_equal(ComplementaryMode::kCompensatedAsPrinted, PrintedFilter::Use::kCompensated, 200.0);
}

/// A fix whose NIS has the given value.
FixOutcome outcome_at(const std::string& mode, double nis) {
  ComplementaryEkf filter(with(ComplementaryEkfParameters(), "{mode: " + mode + "}"));
  filter.initialize(pose_with_sigma({}, 1.0, 0.1));
  FixMeasurement fix;
  fix.covariance = isotropic(2.0);
  fix.position.x() = std::sqrt(nis * 5.0);
  return filter.correct(fix);
}

TEST(ComplementaryEkfAsPrinted, ThresholdIs7_81) {
  EXPECT_EQ(outcome_at("gated_as_printed", 7.80).decision, FixDecision::kAccepted)
      << "above 5.99, the quantile for two";
  EXPECT_EQ(outcome_at("gated_as_printed", 7.82).decision, FixDecision::kRejectedGate);
  EXPECT_EQ(outcome_at("compensated_as_printed", 7.80).decision, FixDecision::kAccepted);
  EXPECT_EQ(outcome_at("compensated_as_printed", 7.82).decision, FixDecision::kBiasCompensated);
  EXPECT_EQ(outcome_at("standard_as_printed", 1000.0).decision, FixDecision::kAccepted);
  EXPECT_EQ(outcome_at("compensated_as_printed", 1.0).nis_threshold, 7.81);
  EXPECT_EQ(outcome_at("gated", 7.82).decision, FixDecision::kAccepted) << "ours: 9.21";
  EXPECT_NEAR(kPrintedThreshold, chi_squared_quantile(0.95, 3), 0.005);
}

/// What is ours is in these parameters.
const char* const kOurs =
    "fix_bias_time: 1.0, close_probability: 0.5, close_count: 1, detection_horizon: 0.0, parked_correlation_time: "
    "1000.0, "
    "lockout_policy: dead_reckoning, lockout_timeout: 1.0, bias_open_timeout: 1.0, lockout_gap: 0.5, "
    "estimate_odometry_errors: false, gate_probability: 0.6, ramp_slack: 0.0, ramp_threshold: 0.5, "
    "adapt_fix_noise: false, fix_noise_horizon: 5.0, fix_noise_memory: 20.0, "
    "correlation_distance: 100.0, correlation_time: 100.0, reacquisition_gap: 0.5, reacquisition_sigma: 50.0, "
    "reacquisition_time: 9.0, "
    "common_error_share: 1.0, common_error_min: 3.0, common_error_max: 9.0, motion_noise_factor: 2.0, "
    "speed_scale_sigma: 0.3, speed_scale_walk: 0.01, yaw_rate_bias_sigma: 0.1, yaw_rate_bias_walk: 0.01, "
    "parked_walk: 1.0";

/// Position, its variance and the decisions of a drive with a ramp, a jump and a stop.
std::vector<double> trace_of(const std::string& mode, const std::string& yaml) {
  Drive drive(9);  // its truth and its fixes are the same whatever the filter's parameters
  ComplementaryEkf filter(with(ComplementaryEkfParameters(), "{mode: " + mode + yaml + "}"));
  filter.initialize(pose_with_sigma({}, 1.0, 0.1));
  std::vector<double> trace;
  drive.bias = [](double since) {
    return since < 40.0   ? Eigen::Vector2d::Zero().eval()
           : since < 80.0 ? Eigen::Vector2d(0.4 * (since - 40.0), 0.0)
                          : Eigen::Vector2d(0.0, -20.0);
  };
  for (int k = 1; k <= 1500; ++k) {
    drive.speed_mps = k > 1300 ? 0.0 : 1.5;
    const Twist2 measured{drive.speed_mps, drive.speed_mps > 0.0 ? 0.2 * std::sin(0.1 * (drive.time_s + 0.1)) : 0.0};
    drive.step();
    filter.move(measured, 0.1);
    if (k % 10 != 0 || (k > 1000 && k < 1200)) continue;  // an outage
    const FixOutcome outcome = filter.correct(drive.make_fix(0.1 * k));
    const PoseEstimate estimate = filter.estimate();
    trace.insert(trace.end(),
                 {estimate.pose.x, estimate.pose.y, estimate.pose.yaw, estimate.covariance(0, 0),
                  estimate.covariance(2, 2), filter.bias().x(), outcome.nis, static_cast<double>(outcome.decision)});
  }
  return trace;
}

TEST(ComplementaryEkfAsPrinted, NothingOfOursHasAnEffect) {
  const std::string open = "mode fix_bias_sigma position_walk heading_walk motion_model wheelbase odom_";
  ParameterList list;
  list.add(ComplementaryEkfParameters());
  for (const ListedParameter& listed : list.parameters()) {
    const bool is_ours = std::string(kOurs).find(listed.name + ":") != std::string::npos ||
                         listed.name == "fix_noise_max_inflation";  // adapt_fix_noise is off
    const bool is_open = open.find(listed.name.substr(0, 5)) != std::string::npos;
    EXPECT_TRUE(is_ours || is_open) << listed.name << ": neither the paper's nor left out as printed";
  }
  for (const char* mode : {"standard_as_printed", "gated_as_printed", "compensated_as_printed"}) {
    EXPECT_EQ(trace_of(mode, ""), trace_of(mode, std::string(", ") + kOurs)) << mode;
  }
  for (const char* mode : {"standard", "gated", "compensated"}) {
    EXPECT_NE(trace_of(mode, ""), trace_of(mode, std::string(", ") + kOurs)) << mode << ": but has in ours";
  }
}

TEST(ComplementaryEkfAsPrinted, WhatThePaperLeavesOpenHasAnEffect) {
  for (const char* yaml : {", fix_bias_sigma: 5.0", ", position_walk: 0.5", ", heading_walk: 0.05",
                           ", odom_alpha1: 0.01", ", odom_alpha4: 0.1"}) {
    EXPECT_NE(trace_of("compensated_as_printed", ""), trace_of("compensated_as_printed", yaml)) << yaml;
  }
}

/// How many of 50 fixes are taken for biased that are all off to the same side, with a NIS of 5.
int biased_of_a_drift(const std::string& mode) {
  ComplementaryEkf filter(with(published_complementary_ekf(), "{mode: " + mode + "}"));
  filter.initialize(pose_with_sigma({}, 1.0, 0.1));
  int biased = 0;
  for (int k = 1; k <= 50; ++k) {
    filter.move({1.0, 0.0}, 1.0);
    FixMeasurement fix;
    fix.time_s = k;
    fix.covariance = isotropic(2.0);
    fix.position = filter.pose().position();
    fix.position.x() += std::sqrt(5.0 * (filter.error_covariance()(0, 0) + 4.0));
    biased += filter.correct(fix).decision == FixDecision::kBiasCompensated;
  }
  return biased;
}

TEST(ComplementaryEkfAsPrinted, DriftIsNotFoundAndBiasNeitherFadesNorWalks) {
  EXPECT_EQ(biased_of_a_drift("compensated_as_printed"), 0) << "no single fix is above the threshold";
  EXPECT_GT(biased_of_a_drift("compensated"), 0) << "ours sums them up";

  Drive jump(5, "{mode: compensated_as_printed}");
  jump.run(60.0);
  jump.bias = [](double) { return Eigen::Vector2d(15.0, 0.0); };
  double smallest = 1e9;
  int open = 0;
  jump.run(40.0, [&](const FixMeasurement&) {
    if (!jump.filter.is_bias_open()) return;
    ++open;
    EXPECT_LE(jump.filter.bias_covariance()(0, 0), smallest) << "M(k) only shrinks";
    smallest = jump.filter.bias_covariance()(0, 0);
  });
  EXPECT_EQ(open, 40) << "no fix of 40 is taken for the bias's end, no time-out";
  EXPECT_LT(smallest, 0.5);
}

TEST(ComplementaryEkfAsPrinted, LockedOutItStaysSo) {
  for (const char* mode : {"gated_as_printed", "compensated_as_printed"}) {
    Drive drive(6, std::string("{mode: ") + mode + "}");
    drive.run(60.0);
    drive.bias = [](double) { return Eigen::Vector2d(300.0, 0.0); };
    drive.run(150.0);
    EXPECT_LT(drive.error_m(), 60.0) << mode << ": not started anew on the fixes";
    EXPECT_TRUE(drive.last.decision == FixDecision::kRejectedGate || drive.filter.is_bias_open()) << mode;
  }
}

TEST(ComplementaryEkfAsPrinted, SwitchingToAndFroChangesTheStates) {
  Drive drive(8);
  drive.run(60.0);
  EXPECT_NE(drive.filter.odometry_errors().speed_scale, 0.0);
  const Pose2 pose = drive.filter.pose();
  drive.filter.set_mode(ComplementaryMode::kCompensatedAsPrinted);
  EXPECT_TRUE(near(drive.filter.pose(), pose, 1e-12));
  EXPECT_EQ(drive.filter.mode(), "compensated_as_printed");
  EXPECT_EQ(drive.filter.odometry_errors().speed_scale, 0.0);
  EXPECT_EQ(drive.filter.error_covariance().bottomRows<2>().norm(), 0.0);
  drive.run(10.0);
  EXPECT_EQ(drive.filter.error_covariance().bottomRows<2>().norm(), 0.0);
  drive.filter.set_mode(ComplementaryMode::kCompensated);
  const double sigma = drive.parameters.odometry.speed_scale_sigma;
  EXPECT_DOUBLE_EQ(drive.filter.error_covariance()(3, 3), sigma * sigma) << "as at a start";
  drive.run(60.0);
  EXPECT_LT(drive.error_m(), 5.0);
}

TEST(ComplementaryEkfAsPrinted, EveryModeHasANameInComparisons) {
  const LocalizerRegistry registry = standard_localizers();
  for (const auto& [name, mode] :
       {std::pair("ekf_as_printed", "standard_as_printed"), std::pair("gated_ekf_as_printed", "gated_as_printed"),
        std::pair("complementary_ekf_as_printed", "compensated_as_printed")}) {
    const LocalizerChoice choice = registry.choose(name);
    EXPECT_EQ(choice.entry->name, "complementary_ekf");
    EXPECT_EQ(choice.assignments, std::vector<std::string>{std::string("mode=") + mode});
    for (const LocalizerVariant& variant : registry.variants()) EXPECT_NE(variant.name, name) << "only where named";
  }
}

}  // namespace
}  // namespace urban_gnss
