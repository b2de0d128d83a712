#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <functional>

#include "complementary_rig.hpp"
#include "matchers.hpp"
#include "pipeline_rig.hpp"
#include "urban_gnss_localization/localizers/kim/complementary_ekf.hpp"

namespace urban_gnss {
namespace {

/// A Kalman filter of pose and odometry errors themselves, not of an error that is fed back: Jacobians by differences.
struct DirectEkf {
  OdometryErrorParameters odometry;
  MotionParameters motion;
  ErrorState state{ErrorState::Zero()};
  ErrorCovariance covariance{ErrorCovariance::Zero()};

  ErrorState moved(const ErrorState& s, const Twist2& twist, double duration_s) const {
    const Pose2 pose =
        urban_gnss::move({s(0), s(1), s(2)}, {(1.0 + s(3)) * twist.speed_mps, twist.yaw_rate_radps + s(4)}, duration_s);
    ErrorState result;
    result << pose.x, pose.y, pose.yaw, s(3), s(4);
    return result;
  }
  void move(const Twist2& twist, double duration_s) {
    ErrorCovariance jacobian;
    for (int i = 0; i < kErrorStates; ++i) {
      constexpr double kDelta = 1e-6;
      ErrorState difference = moved(state + kDelta * ErrorState::Unit(i), twist, duration_s) -
                              moved(state - kDelta * ErrorState::Unit(i), twist, duration_s);
      difference(2) = wrap_angle(difference(2));
      jacobian.col(i) = difference / (2.0 * kDelta);
    }
    const DeadReckoningStep step = dead_reckon({state(0), state(1), state(2)}, {state(3), state(4)},
                                               make_motion_step(twist, duration_s, motion, odometry), odometry);
    state = moved(state, twist, duration_s);
    covariance = jacobian * covariance * jacobian.transpose() + step.noise;
  }
  void correct(const Eigen::Vector2d& fix, const Eigen::Matrix2d& noise, const Eigen::Vector2d& antenna) {
    const Pose2 pose{state(0), state(1), state(2)};
    const Eigen::Vector2d lever = transform_point(pose, antenna) - pose.position();
    Eigen::Matrix<double, 2, kErrorStates> h = Eigen::Matrix<double, 2, kErrorStates>::Zero();
    h.leftCols<2>().setIdentity();
    h.col(2) << -lever.y(), lever.x();
    const Eigen::Matrix2d s = h * covariance * h.transpose() + noise;
    const Eigen::Matrix<double, kErrorStates, 2> gain = covariance * h.transpose() * s.inverse();
    state += gain * (fix - pose.position() - lever);
    state(2) = wrap_angle(state(2));
    covariance = ((ErrorCovariance::Identity() - gain * h) * covariance).eval();
  }
};

TEST(ComplementaryEkf, EqualsADirectFilterOfThePose) {
  ComplementaryEkfParameters parameters =
      with(ComplementaryEkfParameters(), "{mode: standard, adapt_fix_noise: false}");
  ComplementaryEkf filter(parameters);
  DirectEkf direct{parameters.odometry, parameters.motion};
  const PoseEstimate start = pose_with_sigma({3.0, -2.0, 3.0}, 1.0, 0.1);
  filter.initialize(start);
  direct.state << 3.0, -2.0, 3.0, 0.0, 0.0;
  direct.covariance = initial_error_covariance(start.covariance, parameters.odometry);
  RandomEngine engine = make_engine(1);
  for (int k = 1; k <= 2000; ++k) {
    const Twist2 twist{1.5 + 0.3 * draw_normal(engine), 0.2 + 0.1 * draw_normal(engine)};
    filter.move(twist, 0.02);
    direct.move(twist, 0.02);
    if (k % 50 != 0) continue;
    FixMeasurement fix;
    fix.position = {direct.state(0) + 2.0 * draw_normal(engine), direct.state(1) + 2.0 * draw_normal(engine)};
    fix.covariance << 4.0, 1.0, 1.0, 3.0;
    fix.antenna_in_body = {0.4, -0.2};
    fix.time_s = 0.02 * k;
    filter.correct(fix);
    direct.correct(fix.position, fix.covariance, fix.antenna_in_body);
    ASSERT_TRUE(near(filter.pose(), {direct.state(0), direct.state(1), direct.state(2)}, 1e-4)) << k;
    ASSERT_NEAR(filter.odometry_errors().speed_scale, direct.state(3), 1e-5);
    ASSERT_NEAR(filter.odometry_errors().yaw_rate_bias_radps, direct.state(4), 1e-5);
    ASSERT_LT((filter.error_covariance() - direct.covariance).cwiseAbs().maxCoeff(), 1e-4) << k;
  }
}

TEST(ComplementaryEkf, CorrectionJoinsOdometryAndPose) {
  Drive drive(1);
  Pose2 before = drive.filter.dead_reckoned();
  drive.run(30.0, [&](const FixMeasurement&) {
    EXPECT_TRUE(near(compose(drive.filter.correction(), drive.filter.dead_reckoned()), drive.filter.pose(), 1e-9));
    EXPECT_LT((drive.filter.dead_reckoned().position() - before.position()).norm(), 2.5) << "odometry jumped";
    before = drive.filter.dead_reckoned();
  });
  EXPECT_GT(drive.filter.correction().position().norm(), 0.1);
}

// White errors, everything as the filter is told: the squared normalised error has its expectation.
TEST(ComplementaryEkf, CovarianceIsHonestInTheOpen) {
  constexpr int kSeeds = 50;
  const double low = chi_squared_quantile(0.025, 3 * kSeeds) / kSeeds;
  const double high = chi_squared_quantile(0.975, 3 * kSeeds) / kSeeds;
  for (const char* mode : {"standard", "gated", "compensated"}) {
    std::map<int, double> sums;
    for (int seed = 1; seed <= kSeeds; ++seed) {
      Drive drive(static_cast<std::uint64_t>(seed), std::string("{mode: ") + mode + "}");
      drive.start_with_errors();
      for (const int until : {30, 60, 120}) {
        drive.run(until - drive.time_s);
        const PoseEstimate estimate = drive.filter.estimate();
        Eigen::Vector3d error;
        error << drive.truth.position() - estimate.pose.position(),
            angle_difference(drive.truth.yaw, estimate.pose.yaw);
        sums[until] += error.dot(estimate.covariance.ldlt().solve(error)) / kSeeds;
      }
    }
    for (const auto& [time, nees] : sums) {
      RecordProperty(std::string("nees_") + mode + "_" + std::to_string(time), std::to_string(nees));
      EXPECT_GT(nees, low) << mode << " after " << time << " s";
      EXPECT_LT(nees, high) << mode << " after " << time << " s";
    }
  }
}

// Under the open sky, with white errors as declared, compensation must not cost much.
TEST(ComplementaryEkf, CompensationCostsLittleInTheOpen) {
  const auto mean_error = [](const char* mode) {
    double sum = 0.0;
    int count = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      Drive drive(seed, std::string("{mode: ") + mode + "}");
      drive.start_with_errors();
      drive.run(600.0, [&](const FixMeasurement&) {
        sum += drive.error_m();
        ++count;
      });
    }
    return sum / count;
  };
  const double standard = mean_error("standard");
  const double compensated = mean_error("compensated");
  RecordProperty("standard", std::to_string(standard));
  RecordProperty("compensated", std::to_string(compensated));
  RecordProperty("of_false_alarms", std::to_string(mean_error("compensated, adapt_fix_noise: false") / standard));
  RecordProperty("of_adaptation", std::to_string(standard / mean_error("standard_as_printed")));
  EXPECT_LT(compensated / standard, 1.05);
}

TEST(ComplementaryEkf, FalseAlarmsComeAtTheirRate) {
  Drive drive(7, "{}", 5.0);
  int tested = 0;
  int alarms = 0;
  bool was_open = false;
  drive.run(20000.0, [&](const FixMeasurement&) {
    tested += !was_open;
    alarms += !was_open && drive.filter.is_bias_open();
    was_open = drive.filter.is_bias_open();
  });
  RecordProperty("false_alarms", alarms);
  RecordProperty("tested", tested);
  EXPECT_GT(tested, 15000);
  EXPECT_NEAR(alarms, 0.01 * tested, 0.2 * 0.01 * tested);
}

/// Errors (m) of the modes over a stretch of bias of 30 s.
struct Errors {
  double during{0.0};
  double after{0.0};
};
Errors errors_with_bias(const std::string& mode, const std::function<Eigen::Vector2d(double)>& bias) {
  Errors errors;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Drive drive(seed, "{mode: " + mode + "}");
    drive.run(60.0);
    drive.bias = bias;
    drive.run(30.0, [&](const FixMeasurement&) { errors.during += drive.error_m() / 300.0; });
    drive.bias = {};
    bool closed = false;
    drive.run(20.0, [&](const FixMeasurement&) { closed = closed || !drive.filter.is_bias_open(); });
    EXPECT_TRUE(closed) << mode << ", seed " << seed << ": 20 s after the end";
    drive.run(10.0, [&](const FixMeasurement&) { errors.after += drive.error_m() / 100.0; });
  }
  return errors;
}

TEST(ComplementaryEkf, BiasIsCompensated) {
  const auto bias = [](double) { return Eigen::Vector2d(12.0, -9.0); };
  const Errors standard = errors_with_bias("standard", bias);
  const Errors gated = errors_with_bias("gated", bias);
  const Errors compensated = errors_with_bias("compensated", bias);
  RecordProperty("standard", std::to_string(standard.during));
  RecordProperty("gated", std::to_string(gated.during));
  RecordProperty("compensated", std::to_string(compensated.during));
  EXPECT_LT(compensated.during, 0.5 * standard.during);
  EXPECT_LT(compensated.during, gated.during);
  EXPECT_LT(compensated.after, 2.0);
}

TEST(ComplementaryEkf, EstimatedBiasIsPublished) {
  Drive drive(3);
  drive.run(60.0);
  drive.filter.take_bias_estimates();
  drive.bias = [](double) { return Eigen::Vector2d(12.0, -9.0); };
  drive.run(10.0);
  const std::vector<BiasEstimate> estimates = drive.filter.take_bias_estimates();
  ASSERT_EQ(estimates.size(), 10u);
  const BiasEstimate& last = estimates.back();
  EXPECT_EQ(last.stamp, from_seconds(drive.time_s));
  EXPECT_EQ(last.outcome.decision, FixDecision::kBiasCompensated);
  EXPECT_TRUE(last.in_shadow);
  EXPECT_NEAR(last.radius_m, 15.0, 3.0);
  const Eigen::Vector2d error = last.bias - Eigen::Vector2d(12.0, -9.0);
  EXPECT_LT(error.dot(last.covariance.ldlt().solve(error)), chi_squared_quantile(0.999, 2));
  drive.bias = {};
  drive.run(20.0);
  EXPECT_FALSE(drive.filter.take_bias_estimates().back().in_shadow);
}

TEST(ComplementaryEkf, SlowRampIsFoundAndCompensated) {
  const auto error_of = [](const char* mode, int& opened) {
    Drive drive(4, std::string("{mode: ") + mode + "}");
    drive.run(60.0);
    drive.bias = [](double since) { return Eigen::Vector2d(0.4 * since, 0.0); };
    drive.run(60.0, [&](const FixMeasurement&) { opened += drive.filter.is_bias_open(); });
    return drive.error_m();
  };
  int opened = 0;
  const double standard = error_of("standard", opened);
  EXPECT_EQ(opened, 0);
  const double compensated = error_of("compensated", opened);
  EXPECT_GT(opened, 20);
  EXPECT_LT(compensated, 0.6 * standard);
}

// A wrong fix below the smallest detectable jump is fused; the estimate moves by no more than the gain allows, and what
// was fused is unlearned when the bias ends.
TEST(ComplementaryEkf, BiasThatWasFusedIsUnlearned) {
  Drive drive(5);
  drive.run(60.0);
  const double smallest = drive.filter.smallest_detectable_jump_m();
  EXPECT_GT(smallest, 2.0 * Drive::kFixSigma_m);
  EXPECT_LT(smallest, 6.0 * Drive::kFixSigma_m);
  const double jump = 0.5 * smallest;
  drive.bias = [jump](double) { return Eigen::Vector2d(jump, 0.0); };
  double worst = 0.0;
  bool opened = false;
  drive.run(30.0, [&](const FixMeasurement&) {
    worst = std::max(worst, drive.error_m());
    opened = opened || drive.filter.is_bias_open();
  });
  EXPECT_TRUE(opened) << "the run of innovations shows what one fix does not";
  EXPECT_LT(worst, jump + 1.5);
  drive.bias = {};
  drive.run(60.0);
  EXPECT_LT(drive.error_m(), 1.5);
}

TEST(ComplementaryEkf, SmallestDetectableJumpIsFoundAtOnceWithItsPower) {
  constexpr int kSeeds = 300;
  double found = 0.0;
  double smallest = 0.0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    Drive drive(seed);
    drive.run(60.0);
    const double jump = drive.filter.smallest_detectable_jump_m();
    const double direction = 0.1 * static_cast<double>(seed);
    drive.bias = [=](double) { return Eigen::Vector2d(jump * std::cos(direction), jump * std::sin(direction)); };
    drive.run(1.0);
    found += drive.last.decision == FixDecision::kBiasCompensated;
    smallest += jump / kSeeds;
  }
  RecordProperty("found", std::to_string(found / kSeeds));
  RecordProperty("smallest_m", std::to_string(smallest));
  EXPECT_NEAR(found / kSeeds, 0.9, 0.05);  // 0.017 is one sigma; easier to find in most directions
}

// 2.5 km, as raw least-squares fixes have them.
TEST(ComplementaryEkf, SpikeTouchesNothing) {
  for (const char* mode : {"gated", "compensated"}) {
    Drive drive(6, std::string("{mode: ") + mode + "}");
    drive.run(60.0);
    const Pose2 pose = drive.filter.pose();
    const OdometryErrors errors = drive.filter.odometry_errors();
    const ErrorCovariance covariance = drive.filter.error_covariance();
    FixMeasurement fix = drive.make_fix();
    fix.position.x() += 2500.0;
    fix.time_s += 0.1;
    EXPECT_EQ(drive.filter.correct(fix).decision, FixDecision::kRejectedGate) << mode;
    EXPECT_TRUE(drive.filter.pose() == pose) << mode;
    EXPECT_EQ(drive.filter.odometry_errors().speed_scale, errors.speed_scale);
    EXPECT_EQ(drive.filter.odometry_errors().yaw_rate_bias_radps, errors.yaw_rate_bias_radps);
    EXPECT_TRUE(drive.filter.error_covariance() == covariance) << mode;
  }
}

// A jump of 40 m that the bias filter takes must not turn the robot.
TEST(ComplementaryEkf, JumpDoesNotTurnTheRobot) {
  Drive drive(7);
  drive.run(60.0);
  drive.bias = [](double) { return Eigen::Vector2d(0.0, 40.0); };
  double worst = 0.0;
  drive.run(20.0, [&](const FixMeasurement&) {
    worst = std::max(worst, std::abs(angle_difference(drive.filter.pose().yaw, drive.truth.yaw)));
  });
  EXPECT_LT(worst, 0.1);
}

TEST(ComplementaryEkf, ModeIsSwitchedWhileRunning) {
  Drive drive(8);
  drive.run(60.0);
  drive.bias = [](double) { return Eigen::Vector2d(15.0, 0.0); };
  drive.run(3.0);
  ASSERT_TRUE(drive.filter.is_bias_open());
  const Pose2 pose = drive.filter.pose();
  drive.filter.set_mode(ComplementaryMode::kGated);
  EXPECT_FALSE(drive.filter.is_bias_open());
  EXPECT_TRUE(near(drive.filter.pose(), pose, 1e-9)) << "the estimate keeps what was compensated";
  EXPECT_EQ(drive.filter.mode(), "gated");
  drive.run(3.0);
  EXPECT_EQ(drive.last.decision, FixDecision::kRejectedGate);
  drive.filter.set_mode(ComplementaryMode::kStandard);
  drive.run(3.0);
  EXPECT_EQ(drive.last.decision, FixDecision::kAccepted);
}

// The lever arm and a late fix are one thing to the filter: a fix of 0.5 s ago counts as one of then.
TEST(ComplementaryEkf, LateFixIsComparedWithThePastPose) {
  const auto run = [](double delay_s) {
    LocalizationParameters parameters = with(LocalizationParameters{}, kGiven);
    Rig rig(parameters, std::make_unique<ComplementaryEkf>(ComplementaryEkfParameters()));
    for (int k = 0; k <= 300; ++k) {
      const double time = 0.1 * k;
      rig.drive(time);
      const double fix_time = time - delay_s;
      if (k % 10 == 5 && fix_time > 0.0) rig.fix(fix_time, {std::sin(7.0 * k), std::cos(11.0 * k)});
    }
    EXPECT_EQ(rig.pipeline.report().fixes_rejected, 0u);
    return rig.pipeline.localizer().pose();
  };
  EXPECT_TRUE(near(run(0.0), Rig::truth(30.0), 1.0));
  EXPECT_TRUE(near(run(0.5), Rig::truth(30.0), 1.0)) << "2 m/s times 0.5 s would be 1 m behind";
}

}  // namespace
}  // namespace urban_gnss
