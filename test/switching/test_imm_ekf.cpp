#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "switching_rig.hpp"
#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

ImmEkfParameters textbook(const std::string& changes = "{}") {
  const ImmEkfParameters plain = with(ImmEkfParameters{}, "yaw_rate_scale_sigma: 0.0");
  return with(with(plain, kTextbookNoise), changes);
}
ImmEkf make(const std::string& changes = "{}") { return ImmEkf(textbook(changes), {}); }

/// The extended Kalman filter of pose and odometry errors, without anything else.
class PlainEkf : public Localizer {
 public:
  const char* name() const override { return "plain"; }
  std::string mode() const override { return ""; }
  bool wants_bias() const override { return false; }
  void initialize(const PoseEstimate& start) override {
    pose_ = start.pose;
    errors_ = {};
    covariance_ = initial_error_covariance(start.covariance, parameters_);
  }
  void move(const Twist2& twist, double duration_s) override {
    const auto step = dead_reckon(pose_, errors_, make_motion_step(twist, duration_s, {}, parameters_), parameters_);
    pose_ = step.pose;
    covariance_ = step.transition * covariance_ * step.transition.transpose() + step.noise;
  }
  FixOutcome correct(const FixMeasurement& fix) override {
    Eigen::Matrix<double, 2, kErrorStates> h = Eigen::Matrix<double, 2, kErrorStates>::Zero();
    h.leftCols<2>().setIdentity();
    const Eigen::Matrix2d s = h * covariance_ * h.transpose() + fix.covariance;
    const Eigen::Matrix<double, kErrorStates, 2> gain = covariance_ * h.transpose() * s.inverse();
    const ErrorState change = gain * (fix.position - pose_.position());
    pose_ = {pose_.x + change[0], pose_.y + change[1], wrap_angle(pose_.yaw + change[2])};
    errors_.speed_scale += change[3];
    errors_.yaw_rate_bias_radps += change[4];
    covariance_ = (ErrorCovariance::Identity() - gain * h) * covariance_;
    return {};
  }
  Pose2 pose() const override { return pose_; }
  PoseEstimate estimate() const override { return {pose_, covariance_.topLeftCorner<3, 3>()}; }
  LocalizerHealth health() const override { return {}; }

 private:
  OdometryErrorParameters parameters_ = textbook().odometry;
  Pose2 pose_;
  OdometryErrors errors_;
  ErrorCovariance covariance_;
};

TEST(ImmEkf, IsThePlainEkfWhereNoBiasIsExpected) {
  ImmEkf imm = make("{direct_time: 1.0e+15, outlier_share: 0.0}");
  PlainEkf plain;
  const auto with_modes = drive(imm, {});
  const auto without = drive(plain, {});
  ASSERT_EQ(with_modes.size(), 240u);
  for (std::size_t i = 0; i < without.size(); ++i) {
    EXPECT_TRUE(near(with_modes[i].estimate.pose, without[i].estimate.pose, 1e-6)) << i;
    EXPECT_TRUE(with_modes[i].estimate.covariance.isApprox(without[i].estimate.covariance, 1e-6)) << i;
    EXPECT_EQ(with_modes[i].outcome.decision, FixDecision::kAccepted);
  }
}

TEST(ImmEkf, NoBiasCostsLittle) {
  ImmEkf imm = make();
  PlainEkf plain;
  EXPECT_LT(rmse_between(drive(imm, {}), 20.0, 120.0), 1.1 * rmse_between(drive(plain, {}), 20.0, 120.0));
}

/// One fix, by Bayes' rule over all that may have happened.
TEST(ImmEkf, ProbabilitiesOfOneFixAreBayes) {
  ImmEkfParameters p = textbook();
  p.fix.shadow_sigma = 2.0 * p.fix.direct_sigma;
  const double elapsed = 2.0;
  ImmEkf imm(p, {});
  imm.initialize(pose_with_sigma({}, 0.7, 0.0));
  imm.correct(fix_of({0.0, 0.0}, 1e6, 0.0));  // tells nothing but the time
  const FixMeasurement fix = fix_of({3.0, -2.0}, 0.5, elapsed);
  imm.correct(fix);

  const ModeTransition t = mode_transition(elapsed, p.modes);
  const double own = 0.49;
  double weight[kContinuations];
  double sum = 0.0;
  for (int j = 0; j < 4; ++j) {
    const BiasStep step = bias_steps(elapsed, p.modes)[index_of(BiasMode::kDirect)][static_cast<std::size_t>(j)];
    const double variance = own + (j == 0 ? 0.25 : 1.0) + step.growth_m2;
    const double density = std::exp(-0.5 * 13.0 / variance) / (2.0 * kPi * variance);
    weight[j] = t(0, j) * ((1.0 - p.modes.outlier_share) * density + p.modes.outlier_density());
    sum += weight[j];
  }
  EXPECT_NEAR(imm.mode_probabilities()[0], weight[0] / sum, 1e-6);
  EXPECT_NEAR(imm.mode_probabilities()[1], (weight[1] + weight[3]) / sum, 1e-6);
  EXPECT_NEAR(imm.mode_probabilities()[2], weight[2] / sum, 1e-6);
  // The pose takes from the fix what direct reception, and little of what a jump, has to say.
  const double used = 0.49 / (0.49 + 0.25);
  EXPECT_GT(imm.pose().x, 0.0);
  EXPECT_LT(imm.pose().x, used * 3.0);
}

TEST(ImmEkf, FindsABiasThatComesAtOnceAndItsEnd) {
  ImmEkf imm = make();
  PlainEkf plain;
  SwitchingDrive d;
  d.bias = bias_between(40.0, 80.0, {15.0, -8.0});
  const auto steps = drive(imm, d);
  EXPECT_LT(rmse_between(steps, 20.0, 40.0), 0.5);
  EXPECT_LT(rmse_between(steps, 40.0, 80.0), 1.5);
  EXPECT_LT(rmse_between(steps, 90.0, 120.0), 0.6);
  EXPECT_GT(rmse_between(drive(plain, d), 40.0, 80.0), 8.0);
  for (const auto& step : steps) {
    if (step.time_s > 41.0 && step.time_s < 79.0) {
      EXPECT_EQ(step.outcome.decision, FixDecision::kBiasCompensated) << step.time_s;
    }
  }
}

TEST(ImmEkf, FollowsASlowRampLessThanAPlainEkf) {
  SwitchingDrive d;
  d.duration_s = 100.0;
  d.bias = ramp_between(40.0, 90.0, {0.0, 10.0});
  ImmEkf imm = make();
  PlainEkf plain;
  EXPECT_LT(rmse_between(drive(imm, d), 60.0, 100.0), 0.5 * rmse_between(drive(plain, d), 60.0, 100.0));
}

TEST(ImmEkf, LearnsTheOdometrysErrors) {
  ImmEkf imm = make();
  SwitchingDrive d;
  d.duration_s = 300.0;
  d.errors = {0.03, -0.004};
  drive(imm, d);
  const ImmEkf::Gaussian all = imm.mixture();
  EXPECT_NEAR(all.mean[3], 0.03, 3.0 * std::sqrt(all.covariance(3, 3)));
  EXPECT_NEAR(all.mean[4], -0.004, 3.0 * std::sqrt(all.covariance(4, 4)));
  EXPECT_LT(std::sqrt(all.covariance(4, 4)), 0.002);
}

TEST(ImmEkf, LearnsAYawRateThatIsWrongByAFactor) {
  const auto error_after_turning = [](const std::string& changes) {
    ImmEkf imm = make(changes);
    imm.initialize(pose_with_sigma({}, 0.3, 0.05));
    Pose2 truth;
    const auto move_both = [&](double yaw_rate, double duration_s) {
      truth = move(truth, {1.5, 1.04 * yaw_rate}, duration_s);
      imm.move({1.5, yaw_rate}, duration_s);
    };
    RandomEngine engine = make_engine(5);
    for (int k = 0; k < 4000; ++k) {
      move_both(k / 200 % 2 == 0 ? 0.3 : -0.2, 0.1);  // both ways: a constant error would not do
      const Eigen::Vector2d noise(draw_normal(engine), draw_normal(engine));
      if (k % 10 == 9) imm.correct(fix_of(truth.position() + 0.5 * noise, 0.5, 0.1 * (k + 1)));
    }
    if (imm.mixture().covariance(5, 5) > 0.0) {
      EXPECT_NEAR(imm.mixture().mean[5], 0.04, 3.0 * std::sqrt(imm.mixture().covariance(5, 5)));
      EXPECT_NEAR(imm.mixture().mean[5], 0.04, 0.01);
    }
    for (int k = 0; k < 300; ++k) move_both(0.3, 0.1);
    return (imm.pose().position() - truth.position()).norm();
  };
  EXPECT_LT(error_after_turning("yaw_rate_scale_sigma: 0.03"), 0.5 * error_after_turning("{}"));
}

TEST(ImmEkf, ErrorThatAllFixesShareIsInTheCovarianceAlone) {
  ImmEkf with_it = make("common_error_min: 0.7");
  ImmEkf without = make();
  const auto a = drive(with_it, {});
  const auto b = drive(without, {});
  EXPECT_TRUE(a.back().estimate.pose == b.back().estimate.pose);
  const Eigen::Matrix3d added = a.back().estimate.covariance - b.back().estimate.covariance;
  // No more than the fixes declare: 0.5 m.
  EXPECT_TRUE(added.isApprox(Eigen::Vector3d(0.25, 0.25, 0.0).asDiagonal().toDenseMatrix(), 1e-9)) << added;
}

TEST(ImmEkf, ASpikeSaysNothing) {
  ImmEkf imm = make();
  drive(imm, {});
  const Pose2 before = imm.pose();
  const double sigma_before = imm.health().position_spread_m;
  const FixOutcome outcome = imm.correct(fix_of(before.position() + Eigen::Vector2d(1600.0, 0.0), 0.5, 120.5));
  EXPECT_EQ(outcome.decision, FixDecision::kInflated);
  EXPECT_LT((imm.pose().position() - before.position()).norm(), 0.3);
  EXPECT_LT(imm.health().position_spread_m, 2.0 * sigma_before);
}

TEST(ImmEkf, CovarianceIsHonest) {
  double sum = 0.0;
  int count = 0;
  for (std::uint64_t seed = 101; seed < 121; ++seed) {
    SwitchingDrive d;
    d.seed = seed;
    d.duration_s = 200.0;
    RandomEngine engine = make_engine(seed, 7);
    d.errors = {0.03 * draw_normal(engine), 0.005 * draw_normal(engine)};
    const double direction = uniform_between(-kPi, kPi, engine);
    d.bias = bias_between(60.0, 140.0, 20.0 * Eigen::Vector2d(std::cos(direction), std::sin(direction)));
    ImmEkf imm = make();
    for (const auto& step : drive(imm, d)) {
      sum += step.nees / 3.0;
      ++count;
    }
  }
  EXPECT_GT(sum / count, 0.3);
  EXPECT_LT(sum / count, 1.6);
}

TEST(ImmEkf, RefusesWhatIsNotFinite) {
  ImmEkf imm = make();
  drive(imm, {});
  const ImmEkf::Gaussian before = imm.mixture();
  for (const auto& spoil : std::vector<std::function<void(FixMeasurement&)>>{
           [](auto& f) { f.position.x() = kNaN; }, [](auto& f) { f.covariance(0, 0) = kNaN; },
           [](auto& f) { f.covariance.setZero(); }, [](auto& f) { f.time_s = kNaN; },
           [](auto& f) { f.antenna_in_body.y() = std::numeric_limits<double>::infinity(); }}) {
    FixMeasurement fix = fix_of({0.0, 0.0}, 1.0, 121.0);
    spoil(fix);
    EXPECT_EQ(imm.correct(fix).decision, FixDecision::kRejectedNonFinite);
  }
  imm.move({kNaN, 0.0}, 0.1);
  imm.move({1.0, 0.0}, kNaN);
  imm.move({1.0, 0.0}, -1.0);
  EXPECT_EQ(imm.mixture().mean, before.mean);
  EXPECT_EQ(imm.mixture().covariance, before.covariance);
  EXPECT_THROW(imm.initialize(pose_with_sigma({kNaN, 0.0, 0.0}, 1.0, 1.0)), std::invalid_argument);
  EXPECT_THROW(imm.initialize(pose_with_sigma({}, kNaN, 1.0)), std::invalid_argument);
}

TEST(ImmEkf, SurvivesALongOutageAndALateFix) {
  ImmEkf imm = make();
  drive(imm, {});
  for (const double time_s : {1e6, 1e6 - 100.0, 1e6 + 1.0, 1e12}) {
    imm.correct(fix_of(imm.pose().position() + Eigen::Vector2d(1.0, 0.0), 0.5, time_s));
    EXPECT_TRUE(imm.mixture().mean.allFinite() && imm.mixture().covariance.allFinite()) << time_s;
    EXPECT_NEAR(imm.mode_probabilities().sum(), 1.0, 1e-9) << time_s;
  }
}

// Fixes 1 m aside, after 40 s under a roof.
TEST(ImmEkf, FirstFixesAfterAGapMoveItLess) {
  const auto moved_m = [](const std::string& yaml) {
    ImmEkf imm = make(yaml);
    drive(imm, {});
    for (int k = 0; k < 400; ++k) imm.move({1.5, 0.0}, 0.1);
    const Eigen::Vector2d before = imm.pose().position();
    for (int k = 0; k < 3; ++k) imm.correct(fix_of(before + Eigen::Vector2d(0.0, 1.0), 0.5, 160.0 + 10.0 * k));
    return (imm.pose().position() - before).norm();
  };
  const double with_doubt = moved_m("{reacquisition_sigma: 40.0, reacquisition_time: 60.0}");
  EXPECT_LT(with_doubt, 0.5 * moved_m("{reacquisition_sigma: 0.0, reacquisition_time: 60.0}"));
  EXPECT_LT(with_doubt, moved_m("{reacquisition_sigma: 10.0, reacquisition_time: 60.0}"));
  EXPECT_GT(moved_m("{reacquisition_sigma: 40.0, reacquisition_gap: 60.0}"), 2.0 * with_doubt) << "no gap";
  EXPECT_GT(moved_m("{reacquisition_sigma: 40.0, reacquisition_time: 3.0}"), 1.2 * with_doubt) << "soon forgotten";
}

TEST(ImmEkf, CommutesWithRotationAndTranslation) {
  const Pose2 frame{300.0, -200.0, 2.5};
  SwitchingDrive here, there;
  here.bias = bias_between(40.0, 80.0, {15.0, -8.0});
  there.bias = [&](double t) { return Eigen::Vector2d(transform_point(frame, here.bias(t)) - frame.position()); };
  here.fix_sigma_m = there.fix_sigma_m = 1e-3;  // so that noise in other directions is no difference
  ImmEkf a = make("{use_fix_covariance: false, direct_sigma: 0.5, shadow_sigma: 0.5}");
  ImmEkf b = a;
  const PoseEstimate start = pose_with_sigma({}, 0.3, 0.05);
  a.initialize(start);
  b.initialize(pose_with_sigma(frame, 0.3, 0.05));
  Pose2 truth;
  for (int k = 1; k < 800; ++k) {
    truth = move(truth, {1.5, 0.05}, 0.1);
    a.move({1.5, 0.05}, 0.1);
    b.move({1.5, 0.05}, 0.1);
    const Eigen::Vector2d position = truth.position() + here.bias(0.1 * k);
    a.correct(fix_of(position, 0.5, 0.1 * k));
    b.correct(fix_of(transform_point(frame, position), 0.5, 0.1 * k));
  }
  EXPECT_TRUE(near(compose(frame, a.pose()), b.pose(), 1e-5));
  EXPECT_LT((a.mode_probabilities() - b.mode_probabilities()).norm(), 1e-6);
}

TEST(ImmEkf, LeverArmIsInTheAntennasPlace) {
  ImmEkf imm = make();
  imm.initialize(pose_with_sigma({10.0, 5.0, 0.5 * kPi}, 1.0, 0.3));
  FixMeasurement fix = fix_of({10.0, 7.0}, 0.3, 1.0);  // where an antenna 2 m ahead is
  fix.antenna_in_body = {2.0, 0.0};
  ImmEkf aside = imm;
  EXPECT_LT(imm.correct(fix).nis, 1e-6);
  EXPECT_TRUE(near(imm.pose(), {10.0, 5.0, 0.5 * kPi}, 1e-6));
  fix.position.x() -= 0.5;
  aside.correct(fix);
  // Moved to the left, and turned: sideways, 1 m of the position and 0.3 rad at 2 m share it.
  EXPECT_LT(aside.pose().x, 10.0 - 0.2);
  EXPECT_GT(aside.pose().yaw, 0.5 * kPi + 0.03);
}

TEST(ImmEkf, EveryParameterHasAnEffect) {
  const std::vector<ParameterChange> changes = switching_model_changes();
  // Elsewhere: parked_walk, fix_covariance_weight, the common error's, the velocity's and the ranges'.
  EXPECT_EQ(changes.size() + 3 + parameter_names(CommonErrorParameters{}).size() +
                parameter_names(ReacquisitionParameters{}).size() + parameter_names(VelocityNoiseParameters{}).size() +
                parameter_names(RangeFixParameters{}).size(),
            parameter_names(ImmEkfParameters{}).size());
  SwitchingDrive d;
  d.bias = bias_between(20.0, 40.0, {4.0, 3.0});
  d.duration_s = 60.0;
  const auto last = [&](const ImmEkfParameters& p) {
    ImmEkf imm(p, {});
    return drive(imm, d).back().estimate.pose;
  };
  for (const auto& [change, base] : changes) {
    const ImmEkfParameters before = textbook(base);
    EXPECT_FALSE(last(with(before, change)) == last(before)) << change;
  }
  ImmEkf parked = make("parked_walk: 0.0");
  ImmEkf drifting = make();
  for (ImmEkf* imm : {&parked, &drifting}) {
    imm->initialize(pose_with_sigma({}, 1.0, 0.1));
    imm->move({0.0, 0.0}, 10.0);
  }
  EXPECT_LT(parked.health().position_spread_m, drifting.health().position_spread_m);
  // A parked robot's fixes share their error: the second says less.
  ImmEkf doubting = make("correlation_time: 30.0");
  for (ImmEkf* imm : {&doubting, &drifting}) {
    imm->initialize(pose_with_sigma({}, 1.0, 0.1));
    for (double time_s : {1.0, 2.0}) {
      imm->move({0.0, 0.0}, 1.0);
      imm->correct(fix_of({0.0, 0.0}, 1.0, time_s));
    }
  }
  EXPECT_GT(doubting.health().position_spread_m, 1.05 * drifting.health().position_spread_m);
}

}  // namespace
}  // namespace urban_gnss
