#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "matchers.hpp"
#include "urban_gnss_localization/filters/particle_filter.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
const GeodeticPosition kDatum{33.0, 130.0, 20.0};

/// Dead-reckons, believes every fix without moving, and remembers what it was asked.
struct FakeLocalizer : Localizer {
  bool wants{false};
  bool breaks{false};  ///< its pose becomes NaN at the next fix
  PoseEstimate state;
  std::vector<PoseEstimate> starts;
  std::vector<std::pair<Twist2, double>> moves;
  std::vector<FixMeasurement> fixes;

  const char* name() const override { return "fake"; }
  std::string mode() const override { return "fake"; }
  bool wants_bias() const override { return wants; }
  void initialize(const PoseEstimate& start) override {
    starts.push_back(start);
    state = start;
  }
  void move(const Twist2& twist, double duration_s) override {
    moves.emplace_back(twist, duration_s);
    state.pose = urban_gnss::move(state.pose, twist, duration_s);
  }
  FixVerdict correct(const FixMeasurement& fix) override {
    fixes.push_back(fix);
    if (breaks) state.pose.x = kNaN;
    FixVerdict verdict;
    verdict.decision = FixDecision::kAccepted;
    return verdict;
  }
  Pose2 pose() const override { return state.pose; }
  PoseEstimate estimate() const override { return state; }
  LocalizerHealth health() const override {
    LocalizerHealth health;
    health.heading_sigma_rad = std::sqrt(state.covariance(2, 2));
    return health;
  }
};

RawFix raw_fix(Stamp stamp, const Eigen::Vector2d& position, double sigma = 1.0) {
  static const LocalFrame frame(kDatum);
  RawFix fix;
  fix.stamp = stamp;
  fix.position = frame.to_geodetic({position.x(), position.y(), 0.0});
  fix.covariance = sigma * sigma * Eigen::Matrix3d::Identity();
  fix.covariance_type = CovarianceType::kKnown;
  return fix;
}

/// The pipeline with a fake localizer, or another, and a robot that drives an arc at 2 m/s and 0.1 rad/s from
/// (0, 0, 0) at time 0. Its map frame is that of kDatum, its odometry frame is another.
struct Rig {
  static constexpr Twist2 kTwist{2.0, 0.1};
  FakeLocalizer* fake{nullptr};
  LocalizationPipeline pipeline;

  explicit Rig(const std::string& yaml, bool wants_bias = false)
      : Rig(with(LocalizationParameters{}, yaml), std::make_unique<FakeLocalizer>()) {
    fake->wants = wants_bias;
  }
  Rig(const LocalizationParameters& parameters, std::unique_ptr<Localizer> localizer)
      : fake(dynamic_cast<FakeLocalizer*>(localizer.get())), pipeline(parameters, std::move(localizer)) {}

  static Stamp at(double time) { return from_seconds(1000.0 + time); }
  static Pose2 truth(double time) { return move({}, kTwist, time); }
  static OdometrySample odometry(double time) { return {at(time), compose({-7.0, 5.0, 1.0}, truth(time)), kTwist}; }
  void drive(double time) { pipeline.add_odometry(odometry(time)); }
  void fix(double time, const Eigen::Vector2d& error = {0.0, 0.0}, const Eigen::Vector2d& antenna = {0.0, 0.0}) {
    pipeline.add_fix(raw_fix(at(time), transform_point(truth(time), antenna) + error));
  }
  /// Odometry at 10 Hz, and a fix each second unless there shall be none.
  void run(double from, double to, bool with_fixes = true) {
    for (long k = std::lround(10.0 * from); k <= std::lround(10.0 * to); ++k) {
      if (with_fixes && k % 10 == 0) fix(0.1 * k);
      drive(0.1 * k);
    }
  }
  void bias(double time, double radius, FixDecision decision = FixDecision::kAccepted) {
    BiasEstimate bias;
    bias.stamp = at(time);
    bias.radius_m = radius;
    bias.verdict.decision = decision;
    bias.verdict.stamp = bias.stamp;
    pipeline.add_bias(bias);
  }
  LocalizationState state() const { return pipeline.report().state; }
};

/// Where and when the robot is known from the first message on.
const char* const kGiven = "{datum: [33.0, 130.0, 20.0], initial_pose: [0.0, 0.0, 0.0]}";

bool has_event(LocalizationPipeline& pipeline, PipelineEvent::Level level, const std::string& text) {
  for (const PipelineEvent& event : pipeline.take_events()) {
    if (event.level == level && event.text.find(text) != std::string::npos) return true;
  }
  return false;
}

TEST(LocalizationPipeline, DatumComesFromAgreeingFixesWhichAreThenUsedF17) {
  Rig rig("{}");
  for (int k = 0; k <= 3; ++k) {
    rig.fix(0.2 * k);
    rig.drive(0.2 * k);
    EXPECT_FALSE(rig.pipeline.frame());
    EXPECT_EQ(rig.state(), LocalizationState::kWaitingForDatum);
    EXPECT_TRUE(rig.pipeline.take_verdicts().empty());
  }
  rig.fix(0.8);
  ASSERT_TRUE(rig.pipeline.frame());
  rig.drive(0.8);
  EXPECT_EQ(rig.pipeline.take_verdicts().size(), 5u);  // those that waited, and the last
  EXPECT_EQ(rig.state(), LocalizationState::kInitializing);
  // The median of the five places is the third.
  EXPECT_LT(rig.pipeline.frame()->to_local(raw_fix({}, Rig::truth(0.4).position()).position).norm(), 1e-2);
  EXPECT_TRUE(rig.pipeline.take_outputs().empty());
}

TEST(LocalizationPipeline, FindsItsPlaceFromFixesAndMotion) {
  Rig rig("datum: [33.0, 130.0, 20.0]");
  double started = 0.0;
  for (int k = 0; k <= 400 && started == 0.0; ++k) {
    if (k % 10 == 0) rig.fix(0.1 * k);
    rig.drive(0.1 * k);
    if (!rig.pipeline.take_outputs().empty()) started = 0.1 * k;
  }
  ASSERT_GT(started, 0.0);
  EXPECT_LT(started, 30.0);
  ASSERT_EQ(rig.fake->starts.size(), 1u);
  EXPECT_TRUE(near(rig.fake->starts[0].pose, Rig::truth(started), 1e-6));
  EXPECT_LT(std::sqrt(rig.fake->starts[0].covariance(2, 2)), 0.2);
  rig.run(started + 0.1, started + 10.0);
  EXPECT_EQ(rig.state(), LocalizationState::kTracking);
  EXPECT_TRUE(rig.pipeline.report().healthy) << rig.pipeline.report().reason;
  EXPECT_EQ(rig.pipeline.waiting_for(), "");
}

TEST(LocalizationPipeline, ParkedRobotStartsWithoutAHeadingAfterItsTimeout) {
  Rig rig("{datum: [33.0, 130.0, 20.0], initialization_timeout: 20.0}");
  for (int k = 0; k <= 200; ++k) {
    if (k % 10 == 0) rig.pipeline.add_fix(raw_fix(Rig::at(0.1 * k), {30.0, 40.0}));
    rig.pipeline.add_odometry({Rig::at(0.1 * k), {}, {}});
    EXPECT_EQ(rig.pipeline.initialized(), k >= 200) << k;
  }
  ASSERT_EQ(rig.fake->starts.size(), 1u);
  EXPECT_LT((rig.fake->starts[0].pose.position() - Eigen::Vector2d(30.0, 40.0)).norm(), 1e-6);
  EXPECT_GE(rig.fake->starts[0].covariance(2, 2), kPi * kPi / 3.0 - 1e-12);
  EXPECT_FALSE(rig.pipeline.report().heading_converged);
  EXPECT_FALSE(rig.pipeline.report().healthy);
}

TEST(LocalizationPipeline, FixWaitsForTheOdometryOfItsStamp) {
  Rig rig(kGiven);
  rig.drive(0.0);
  rig.drive(0.9);
  rig.fix(1.0);
  EXPECT_TRUE(rig.fake->fixes.empty());
  rig.drive(0.95);
  EXPECT_TRUE(rig.fake->fixes.empty());
  rig.drive(1.0);
  ASSERT_EQ(rig.fake->fixes.size(), 1u);
  EXPECT_LT(rig.fake->fixes[0].antenna_in_body.norm(), 1e-12);
  EXPECT_NEAR(rig.fake->fixes[0].time_s, 1001.0, 1e-9);
  EXPECT_LT((rig.fake->fixes[0].position - Rig::truth(1.0).position()).norm(), 1e-6);
  EXPECT_EQ(rig.pipeline.report().fixes_used, 1u);
}

TEST(LocalizationPipeline, LateFixIsComparedWithThePoseAtItsOwnStampF23) {
  Rig rig(kGiven);
  rig.pipeline.set_antenna_offset({0.4, -0.3});
  for (int k = 0; k <= 40; ++k) rig.drive(0.1 * k);
  for (const double time : {2.0, 2.137, 3.95, 4.0}) {
    rig.fix(time, {0.0, 0.0}, {0.4, -0.3});
    // Where the antenna was, seen from where the base is now: with the true pose it is where the fix is.
    const FixMeasurement& fix = rig.fake->fixes.back();
    EXPECT_NEAR(fix.time_s, 1000.0 + time, 1e-9);
    EXPECT_LT((transform_point(Rig::truth(4.0), fix.antenna_in_body) - fix.position).norm(), 1e-6) << time;
    const Pose2 back = between(Rig::truth(4.0), Rig::truth(time));
    EXPECT_LT((fix.antenna_in_body - transform_point(back, {0.4, -0.3})).norm(), 1e-12) << time;
  }
}

TEST(LocalizationPipeline, AntennaOffsetIsTakenOffAtTheStart) {
  Rig rig("{datum: [33.0, 130.0, 20.0], antenna_offset: [1.5, 0.8]}");
  for (int k = 0; k <= 400 && !rig.pipeline.initialized(); ++k) {
    if (k % 10 == 0) rig.fix(0.1 * k, {0.0, 0.0}, {1.5, 0.8});
    rig.drive(0.1 * k);
    if (!rig.pipeline.initialized()) continue;
    EXPECT_TRUE(near(rig.fake->starts[0].pose, Rig::truth(0.1 * k), 1e-6));
  }
  EXPECT_TRUE(rig.pipeline.initialized());
}

TEST(LocalizationPipeline, FixOlderThanTheOdometryIsStale) {
  Rig rig(kGiven);
  for (int k = 0; k <= 200; ++k) rig.drive(0.1 * k);
  rig.fix(5.0);
  EXPECT_TRUE(rig.fake->fixes.empty());
  ASSERT_EQ(rig.pipeline.report().fixes_rejected, 1u);
  EXPECT_EQ(rig.pipeline.report().last_fix.decision, FixDecision::kRejectedStale);
  rig.fix(19.0);
  EXPECT_EQ(rig.fake->fixes.size(), 1u);
}

TEST(LocalizationPipeline, WaitsForTheBiasAndUsesIt) {
  Rig rig(kGiven, true);
  rig.run(0.0, 1.0);  // fixes at 0 and 1 s
  EXPECT_TRUE(rig.fake->fixes.size() <= 1u);
  rig.bias(0.0, 0.5);
  rig.bias(1.0, 3.0);
  ASSERT_GE(rig.fake->fixes.size(), 1u);
  EXPECT_EQ(rig.fake->fixes.back().bias_radius_m, 3.0);
  EXPECT_NEAR(rig.fake->fixes.back().time_s, 1001.0, 1e-9);
  EXPECT_EQ(rig.pipeline.report().bias_radius_m, 3.0);

  // The bias before the odometry, and before the fix: the same.
  rig.bias(2.0, 4.0);
  rig.run(1.1, 2.0);
  EXPECT_EQ(rig.fake->fixes.back().bias_radius_m, 4.0);
  EXPECT_NEAR(rig.fake->fixes.back().time_s, 1002.0, 1e-9);
}

TEST(LocalizationPipeline, WithoutABiasTheLastOneIsUsedAfterTheTimeout) {
  Rig rig(kGiven, true);
  rig.run(0.1, 1.0);
  rig.bias(1.0, 3.0);
  ASSERT_EQ(rig.fake->fixes.size(), 1u);
  rig.run(1.1, 2.0);
  rig.run(2.1, 2.4, false);
  EXPECT_EQ(rig.fake->fixes.size(), 1u);
  EXPECT_EQ(rig.pipeline.bias_query()->fix.stamp, Rig::at(2.0));
  rig.drive(2.5);
  ASSERT_EQ(rig.fake->fixes.size(), 2u);
  EXPECT_EQ(rig.fake->fixes.back().bias_radius_m, 3.0);
  // It is still compared with the pose at its own stamp.
  const Eigen::Vector2d antenna = transform_point(Rig::truth(2.5), rig.fake->fixes.back().antenna_in_body);
  EXPECT_LT((antenna - Rig::truth(2.0).position()).norm(), 1e-9);
  EXPECT_TRUE(has_event(rig.pipeline, PipelineEvent::Level::kWarn, "gps/bias"));
  rig.bias(2.0, 9.0);  // too late, and forgotten
  rig.run(2.6, 3.0);
  rig.bias(3.0, 5.0);
  EXPECT_EQ(rig.fake->fixes.back().bias_radius_m, 5.0);
}

TEST(LocalizationPipeline, BiasFromAnotherTimeDoesNotBlockTheOthers) {
  Rig rig(kGiven, true);
  rig.run(0.1, 0.9);
  rig.bias(5000.0, 9.0);  // of before the clock was set back, published late
  rig.run(1.0, 1.0);
  rig.bias(1.0, 3.0);
  ASSERT_EQ(rig.fake->fixes.size(), 1u);
  EXPECT_EQ(rig.fake->fixes[0].bias_radius_m, 3.0);
}

TEST(LocalizationPipeline, BiasOfBeforeTheClockWasSetBackIsForgottenF21) {
  Rig rig(kGiven, true);
  rig.run(5.0, 6.0, false);
  rig.bias(7.0, 9.0);
  rig.run(1.0, 7.0);
  ASSERT_FALSE(rig.fake->fixes.empty());
  EXPECT_NEAR(rig.fake->fixes.back().time_s, 1006.0, 1e-9);  // that of 7 s waits for its own bias
}

TEST(LocalizationPipeline, FixThatTheBiasFilterRejectsIsNotUsed) {
  Rig rig(kGiven, true);
  rig.run(0.1, 1.0);
  rig.bias(1.0, 3.0, FixDecision::kRejectedGate);
  EXPECT_TRUE(rig.fake->fixes.empty());
  EXPECT_EQ(rig.pipeline.report().fixes_rejected, 1u);
  EXPECT_EQ(rig.pipeline.report().last_fix.decision, FixDecision::kRejectedGate);
  EXPECT_EQ(rig.pipeline.report().last_fix.stamp, Rig::at(1.0));
}

TEST(LocalizationPipeline, BiasQueryPredictsTheAntennaAtTheFix) {
  Rig rig(kGiven, true);
  rig.pipeline.set_antenna_offset({0.4, -0.3});
  rig.run(0.1, 1.0);
  rig.run(1.1, 1.3, false);
  const auto query = rig.pipeline.bias_query();
  ASSERT_TRUE(query);
  EXPECT_EQ(query->fix.stamp, Rig::at(1.0));
  // The filter starts at the first message, at 0.1 s, from the given pose.
  const Pose2 base = compose(inverse(Rig::truth(0.1)), Rig::truth(1.0));
  EXPECT_LT((query->predicted_antenna_position - transform_point(base, {0.4, -0.3})).norm(), 1e-9);
}

TEST(LocalizationPipeline, NonFiniteMessagesChangeNothingF25) {
  const auto run = [](bool with_bad_ones) {
    Rig rig(kGiven);
    std::vector<LocalizationOutput> outputs;
    for (int k = 0; k <= 100; ++k) {
      if (with_bad_ones) {
        for (const double bad : {kNaN, kInfinity, -kInfinity, 1e300}) {
          for (int field = 0; field < 4; ++field) {
            OdometrySample sample = Rig::odometry(0.1 * k);
            double* const fields[] = {&sample.pose.x, &sample.pose.y, &sample.twist.speed_mps,
                                      &sample.twist.yaw_rate_radps};
            *fields[field] = bad;
            rig.pipeline.add_odometry(sample);
          }
          rig.pipeline.add_imu_yaw_rate(Rig::at(0.1 * k), bad);
          RawFix fix = raw_fix(Rig::at(0.1 * k), {0.0, 0.0});
          fix.position.latitude_deg = bad;
          rig.pipeline.add_fix(fix);
          fix = raw_fix(Rig::at(0.1 * k), {0.0, 0.0});
          fix.position.longitude_deg = bad;
          rig.pipeline.add_fix(fix);
        }
        // Receivers without a fix are known to send stamp 0 and place 0.
        RawFix empty;
        empty.has_fix = false;
        rig.pipeline.add_fix(empty);
      }
      if (k % 10 == 0) rig.fix(0.1 * k);
      rig.drive(0.1 * k);
    }
    for (const LocalizationOutput& output : rig.pipeline.take_outputs()) outputs.push_back(output);
    return std::make_pair(outputs, rig.pipeline.report());
  };
  const auto [clean, clean_report] = run(false);
  const auto [dirty, dirty_report] = run(true);
  EXPECT_EQ(clean_report.fixes_used, dirty_report.fixes_used);
  EXPECT_EQ(clean_report.fixes_rejected, 0u);
  EXPECT_EQ(dirty_report.fixes_rejected, 101u * 9u);
  ASSERT_EQ(clean.size(), dirty.size());
  for (std::size_t i = 0; i < clean.size(); ++i) {
    ASSERT_EQ(clean[i].stamp, dirty[i].stamp);
    ASSERT_EQ(clean[i].estimate.pose, dirty[i].estimate.pose);
  }
}

TEST(LocalizationPipeline, NonFiniteCovarianceOrAltitudeIsReplacedF15) {
  Rig rig(kGiven);
  rig.drive(0.0);
  RawFix fix = raw_fix(Rig::at(0.5), {1.0, 2.0});
  fix.position.altitude_m = kNaN;
  fix.covariance.setConstant(kNaN);
  rig.pipeline.add_fix(fix);
  rig.drive(1.0);
  ASSERT_EQ(rig.fake->fixes.size(), 1u);
  EXPECT_LT((rig.fake->fixes[0].covariance - isotropic(5.0)).norm(), 1e-12);
  EXPECT_TRUE(rig.fake->fixes[0].position.allFinite());
  EXPECT_EQ(rig.pipeline.report().last_fix.decision, FixDecision::kInflated);
}

TEST(LocalizationPipeline, NonFiniteStateStartsAnewF25) {
  Rig rig(kGiven);
  rig.run(0.0, 5.0);
  rig.fake->breaks = true;
  rig.run(5.1, 6.0);
  rig.fake->breaks = false;
  EXPECT_EQ(rig.state(), LocalizationState::kLost);
  EXPECT_TRUE(has_event(rig.pipeline, PipelineEvent::Level::kError, "not finite"));
  rig.run(6.1, 40.0);
  EXPECT_EQ(rig.state(), LocalizationState::kTracking);
  for (const LocalizationOutput& output : rig.pipeline.take_outputs()) ASSERT_TRUE(is_finite(output.estimate.pose));
}

TEST(LocalizationPipeline, OutputStampsAscendF22) {
  Rig rig(kGiven);
  const double times[] = {0.0, 0.1, 0.1, 0.05, 0.2, 0.2, 0.15, 0.3, 0.1, 0.4};
  for (const double time : times) {
    rig.drive(time);
    rig.drive(time);
  }
  const auto outputs = rig.pipeline.take_outputs();
  ASSERT_EQ(outputs.size(), 5u);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(outputs[i].stamp, Rig::at(0.1 * double(i)));
    EXPECT_TRUE(near(outputs[i].estimate.pose, Rig::truth(0.1 * double(i)), 1e-9));
    EXPECT_TRUE(near(compose(map_to_odometry(outputs[i]), outputs[i].odometry_pose), outputs[i].estimate.pose, 1e-9));
  }
  EXPECT_EQ(rig.fake->moves.size(), 4u);
}

TEST(LocalizationPipeline, ClockSetBackGivesTheSameRunAgainF21) {
  for (const bool with_datum : {false, true}) {
    LocalizationParameters parameters;
    if (with_datum) parameters.datum.datum = {33.0, 130.0, 20.0};
    ParticleFilterParameters filter;
    filter.particle_count = 100;
    Rig rig(parameters, std::make_unique<ParticleFilter>(filter, MotionParameters{}));
    std::vector<LocalizationOutput> passes[2];
    for (auto& pass : passes) {
      rig.run(0.0, 60.0);
      pass = rig.pipeline.take_outputs();
    }
    EXPECT_TRUE(has_event(rig.pipeline, PipelineEvent::Level::kWarn, "jumped back"));
    ASSERT_GT(passes[0].size(), 200u);
    ASSERT_EQ(passes[0].size(), passes[1].size());
    for (std::size_t i = 0; i < passes[0].size(); ++i) {
      ASSERT_EQ(passes[0][i].stamp, passes[1][i].stamp);
      ASSERT_EQ(passes[0][i].estimate.pose, passes[1][i].estimate.pose);
      ASSERT_EQ(passes[0][i].estimate.covariance, passes[1][i].estimate.covariance);
    }
  }
}

TEST(LocalizationPipeline, TracksWithTheParticleFilter) {
  LocalizationParameters parameters;
  parameters.datum.datum = {33.0, 130.0, 20.0};
  for (const auto mode : {ParticleFilterMode::kConventional, ParticleFilterMode::kPaper}) {
    ParticleFilterParameters filter;
    filter.mode = mode;
    filter.likelihood = LikelihoodChoice::kProduct;
    filter.particle_count = 500;
    Rig rig(parameters, std::make_unique<ParticleFilter>(filter, MotionParameters{}));
    rig.run(0.0, 120.0);
    const auto outputs = rig.pipeline.take_outputs();
    ASSERT_FALSE(outputs.empty());
    // Fixes without error and of a declared 1 m: within a metre or two of the truth.
    EXPECT_LT((outputs.back().estimate.pose.position() - Rig::truth(120.0).position()).norm(), 2.0);
    EXPECT_LT(std::abs(angle_difference(outputs.back().estimate.pose.yaw, Rig::truth(120.0).yaw)), 0.3);
    EXPECT_EQ(rig.state(), LocalizationState::kTracking);
  }
}

TEST(LocalizationPipeline, OdometryGapLosesThePlaceAndFindsItAgain) {
  Rig rig(kGiven);
  rig.run(0.0, 5.0);
  ASSERT_TRUE(rig.pipeline.initialized());
  rig.pipeline.take_outputs();
  rig.drive(6.9);  // 1.9 s: not yet
  EXPECT_TRUE(rig.pipeline.initialized());
  rig.drive(20.0);
  EXPECT_EQ(rig.state(), LocalizationState::kLost);
  EXPECT_EQ(rig.pipeline.take_outputs().size(), 1u);
  EXPECT_EQ(rig.fake->moves.back().second, 1.9);
  EXPECT_TRUE(has_event(rig.pipeline, PipelineEvent::Level::kWarn, "no odometry for 13.1 s"));
  rig.fix(15.0);  // nobody knows how the robot moved since
  EXPECT_EQ(rig.pipeline.report().last_fix.decision, FixDecision::kRejectedStale);
  rig.run(20.1, 60.0);
  EXPECT_EQ(rig.state(), LocalizationState::kTracking);
  ASSERT_EQ(rig.fake->starts.size(), 2u);
  EXPECT_TRUE(near(rig.pipeline.take_outputs().back().estimate.pose, Rig::truth(60.0), 1e-6));
}

TEST(LocalizationPipeline, FixesThatNoReflectionExplainsStartItAnewF3) {
  Rig rig("{datum: [33.0, 130.0, 20.0], initial_pose: [150.0, 20.0, 2.0]}");
  rig.run(0.0, 9.9);
  EXPECT_EQ(rig.fake->starts.size(), 1u);
  EXPECT_EQ(rig.state(), LocalizationState::kTracking);
  rig.run(10.0, 30.0);
  ASSERT_EQ(rig.fake->starts.size(), 2u);
  EXPECT_EQ(rig.state(), LocalizationState::kTracking);
  EXPECT_TRUE(has_event(rig.pipeline, PipelineEvent::Level::kWarn, "lost"));
  EXPECT_TRUE(near(rig.pipeline.take_outputs().back().estimate.pose, Rig::truth(30.0), 1e-6));

  // A bias that a reflection can cause does not, however long, and neither do far fixes with good ones among them.
  Rig near_by(kGiven);
  for (int k = 0; k <= 600; ++k) {
    if (k % 10 == 0) near_by.fix(0.1 * k, {k % 50 == 0 ? 40.0 : k > 300 ? 500.0 : 40.0, 0.0});
    near_by.drive(0.1 * k);
  }
  EXPECT_EQ(near_by.fake->starts.size(), 1u);
}

TEST(LocalizationPipeline, GivenPoseStartsWithTheDatum) {
  Rig rig("initial_pose: [3.0, 4.0, 7.0]");
  rig.drive(0.0);
  EXPECT_FALSE(rig.pipeline.initialized());
  rig.pipeline.set_datum(kDatum);
  rig.drive(0.1);
  ASSERT_TRUE(rig.pipeline.initialized());
  ASSERT_EQ(rig.fake->starts.size(), 1u);
  EXPECT_TRUE(near(rig.fake->starts[0].pose, {3.0, 4.0, wrap_angle(7.0)}, 1e-12));
  EXPECT_NEAR(rig.fake->starts[0].covariance(0, 0), 1.0, 1e-12);
  EXPECT_NEAR(rig.fake->starts[0].covariance(2, 2), 0.04, 1e-12);
  EXPECT_EQ(rig.pipeline.take_outputs().size(), 1u);
}

TEST(LocalizationPipeline, PoseThatIsSetStartsAnewF33) {
  Rig rig(kGiven);
  rig.run(0.0, 2.0);
  rig.pipeline.set_pose(pose_with_sigma({100.0, 50.0, 1.0}, 2.0, 0.3));
  ASSERT_EQ(rig.fake->starts.size(), 2u);
  rig.drive(2.1);
  const auto outputs = rig.pipeline.take_outputs();
  EXPECT_TRUE(near(outputs.back().estimate.pose, move({100.0, 50.0, 1.0}, Rig::kTwist, 0.1), 1e-9));
  PoseEstimate bad = pose_with_sigma({kNaN, 0.0, 0.0}, 1.0, 1.0);
  EXPECT_THROW(rig.pipeline.set_pose(bad), std::invalid_argument);
  bad = pose_with_sigma({}, kNaN, 1.0);
  EXPECT_THROW(rig.pipeline.set_pose(bad), std::invalid_argument);
  EXPECT_EQ(rig.fake->starts.size(), 2u);

  Rig early("{}");
  early.pipeline.set_pose(pose_with_sigma({1.0, 2.0, 3.0}, 2.0, 0.3));  // before datum and odometry
  early.pipeline.set_datum(kDatum);
  early.drive(0.0);
  EXPECT_TRUE(early.pipeline.initialized());
}

TEST(LocalizationPipeline, DatumThatIsSetMovesTheMap) {
  Rig rig("datum: [33.0, 130.0, 20.0]");
  rig.run(0.0, 40.0);
  ASSERT_TRUE(rig.pipeline.initialized());
  EXPECT_THROW(rig.pipeline.set_datum({91.0, 0.0, 0.0}), std::invalid_argument);
  EXPECT_TRUE(rig.pipeline.initialized());
  rig.pipeline.set_datum(kDatum);  // the same: nothing moves
  EXPECT_TRUE(rig.pipeline.initialized());
  const LocalFrame frame(kDatum);
  rig.pipeline.set_datum(frame.to_geodetic({100.0, -200.0, 0.0}));
  EXPECT_FALSE(rig.pipeline.initialized());
  rig.run(40.1, 80.0);
  ASSERT_TRUE(rig.pipeline.initialized());
  // The map is shifted, and turned by the convergence of the meridians (30 microradians in 100 m).
  const Pose2 last = rig.pipeline.take_outputs().back().estimate.pose;
  const Pose2 truth = Rig::truth(80.0);
  EXPECT_TRUE(near(last, {truth.x - 100.0, truth.y + 200.0, truth.yaw}, 0.02));
  rig.pipeline.reset("a test");
  EXPECT_TRUE(rig.pipeline.frame());  // a datum that was set stays
  EXPECT_NEAR(rig.pipeline.frame()->to_local(kDatum).x(), -100.0, 0.01);
}

TEST(LocalizationPipeline, DatumThatIsSetDuringTheStartLeavesNoOldFixes) {
  Rig rig("datum: [33.0, 130.0, 20.0]");
  rig.run(0.0, 3.0);  // some fixes are remembered for the start, in the old map
  ASSERT_FALSE(rig.pipeline.initialized());
  const LocalFrame frame(kDatum);
  rig.pipeline.set_datum(frame.to_geodetic({3.0, -2.0, 0.0}));
  rig.run(3.1, 60.0);
  ASSERT_TRUE(rig.pipeline.initialized());
  const Pose2 truth = Rig::truth(60.0);
  EXPECT_TRUE(near(rig.pipeline.take_outputs().back().estimate.pose, {truth.x - 3.0, truth.y + 2.0, truth.yaw}, 1e-3));
}

TEST(LocalizationPipeline, ImuYawRateReplacesTheOdometrys) {
  for (const bool use : {false, true}) {
    Rig rig(std::string("{datum: [33.0, 130.0, 20.0], initial_pose: [0.0, 0.0, 0.0], use_imu_yaw_rate: ") +
            (use ? "true}" : "false}"));
    rig.drive(0.0);
    rig.pipeline.add_imu_yaw_rate(Rig::at(0.0), 99.0);  // belongs to the step before; and absurd
    rig.pipeline.add_imu_yaw_rate(Rig::at(0.02), 0.4);
    rig.pipeline.add_imu_yaw_rate(Rig::at(0.06), 0.6);
    rig.pipeline.add_imu_yaw_rate(Rig::at(0.12), 5.0);  // belongs to the step after
    rig.drive(0.1);
    EXPECT_NEAR(rig.fake->moves[0].first.yaw_rate_radps, use ? 0.5 : 0.1, 1e-12);
    EXPECT_EQ(rig.fake->moves[0].first.speed_mps, 2.0);
    rig.drive(0.2);
    EXPECT_NEAR(rig.fake->moves[1].first.yaw_rate_radps, use ? 5.0 : 0.1, 1e-12);
    rig.drive(0.3);  // none came: the odometry's
    EXPECT_NEAR(rig.fake->moves[2].first.yaw_rate_radps, 0.1, 1e-12);
  }
}

TEST(LocalizationPipeline, ReportGoesThroughItsStates) {
  Rig rig("datum: [33.0, 130.0, 20.0]");
  EXPECT_EQ(rig.state(), LocalizationState::kWaitingForOdometry);
  EXPECT_EQ(rig.pipeline.waiting_for(), "odometry");
  rig.drive(0.0);
  EXPECT_EQ(rig.state(), LocalizationState::kWaitingForFix);
  EXPECT_NE(rig.pipeline.waiting_for(), "");
  rig.fix(0.1);
  rig.drive(0.1);
  EXPECT_EQ(rig.state(), LocalizationState::kInitializing);
  EXPECT_NE(rig.pipeline.waiting_for(), "");
  EXPECT_FALSE(rig.pipeline.report().healthy);
  rig.run(1.0, 40.0);
  EXPECT_EQ(rig.state(), LocalizationState::kTracking);
  LocalizationReport report = rig.pipeline.report();
  EXPECT_TRUE(report.healthy) << report.reason;
  EXPECT_TRUE(report.heading_converged);
  EXPECT_NEAR(report.fix_age_s, 0.0, 1e-9);
  EXPECT_GT(report.position_sigma_m, 0.0);
  rig.run(40.1, 49.9, false);
  EXPECT_EQ(rig.state(), LocalizationState::kTracking);
  rig.run(50.0, 51.0, false);
  report = rig.pipeline.report();
  EXPECT_EQ(report.state, LocalizationState::kDeadReckoning);
  EXPECT_FALSE(report.healthy);
  EXPECT_NEAR(report.fix_age_s, 11.0, 1e-9);
  // Fixes without odometry: it cannot tell where it is.
  rig.run(51.1, 52.0);
  rig.fix(55.0);
  report = rig.pipeline.report();
  EXPECT_NEAR(report.odometry_age_s, 3.0, 1e-9);
  EXPECT_FALSE(report.healthy);
  EXPECT_NE(report.reason.find("no odometry"), std::string::npos) << report.reason;
}

/// What users see of half a minute in which everything happens that a parameter is about.
std::string trace(const std::string& base, const std::string& change, bool wants_bias = false) {
  LocalizationParameters parameters = with(with(LocalizationParameters{}, base), change);
  auto localizer = std::make_unique<FakeLocalizer>();
  localizer->wants = wants_bias;
  Rig rig(parameters, std::move(localizer));
  std::ostringstream out;
  const auto note = [&] {
    for (const auto& o : rig.pipeline.take_outputs()) out << o.stamp.count() << ' ' << o.estimate.pose.yaw << '\n';
    for (const auto& v : rig.pipeline.take_verdicts()) out << int(v.decision) << v.covariance_clamped << '\n';
    const LocalizationReport report = rig.pipeline.report();
    out << int(report.state) << report.healthy << report.heading_converged << ' ' << report.fixes_rejected << '\n';
  };
  RandomEngine noise = make_engine(1);
  for (int k = 0; k <= 400; ++k) {
    const double time = 0.1 * k;
    rig.pipeline.add_imu_yaw_rate(Rig::at(time), 0.12);
    if (k % 10 == 0 && k != 150 && (k < 160 || k > 190)) {
      const Eigen::Vector2d error(0.5 * draw_normal(noise), 0.5 * draw_normal(noise));
      RawFix fix = raw_fix(Rig::at(time), Rig::truth(time).position() + error, k % 20 == 0 ? 0.1 : 1.0);
      if (k % 30 == 0) fix.covariance_type = CovarianceType::kUnknown;
      if (k == 270) fix = raw_fix(Rig::at(time), {3000.0, 0.0});
      if (k == 280) fix.covariance *= 1e6;
      rig.pipeline.add_fix(fix);
    }
    if (k < 300 || k > 315) rig.drive(time);
    if (k == 350) rig.drive(time - 0.7);  // late, and not a clock that was set back
    note();
  }
  for (const FixMeasurement& fix : rig.fake->fixes) {
    out << fix.antenna_in_body.transpose() << ' ' << fix.covariance(0, 0) << ' ' << fix.position.transpose() << '\n';
  }
  for (const PoseEstimate& start : rig.fake->starts) out << start.pose.x << ' ' << start.covariance << '\n';
  rig.run(0.0, 1.0);
  note();
  return out.str();
}

TEST(LocalizationPipeline, EveryParameterHasAnEffectF36) {
  const std::string datum = "datum: [33.0, 130.0, 20.0]";
  const std::string given = kGiven;
  const std::string far_off = "{datum: [33.0, 130.0, 20.0], initial_pose: [150.0, 0.0, 0.0]}";
  const std::map<std::string, std::pair<std::string, std::string>> changes = {
      {"initial_pose", {datum, "[0.0, 0.0, 0.5]"}},
      {"initial_position_sigma", {given, "2.0"}},
      {"initial_heading_sigma", {given, "0.1"}},
      {"antenna_offset", {given, "[1.0, 0.0]"}},
      {"use_imu_yaw_rate", {given, "true"}},
      {"odometry_gap", {given, "1.0"}},
      {"max_bias_radius", {far_off, "200.0"}},
      {"lost_timeout", {far_off, "5.0"}},
      {"fix_timeout", {given, "3.0"}},
      {"bias_timeout", {given, "0.2"}},
      {"time_jump", {given, "0.5"}},
      {"reset_on_time_jump", {given, "false"}},
      {"heading_converged_sigma", {given, "0.1"}},
      {"datum", {"{}", "[33.0, 130.0, 20.0]"}},
      {"datum_fix_count", {"{}", "3"}},
      {"datum_max_spread", {"{}", "2.0"}},
      {"fix_sigma_default", {given, "7.0"}},
      {"fix_sigma_floor", {given, "0.5"}},
      {"fix_sigma_ceiling", {given, "100.0"}},
      {"fix_covariance_scale", {given, "4.0"}},
      {"max_distance_from_datum", {given, "1000.0"}},
      {"initialization_heading_sigma", {datum, "0.05"}},
      {"initialization_timeout", {datum, "2.0"}},
      {"initialization_window", {datum, "2.0"}},
  };
  for (const std::string& name : parameter_names(LocalizationParameters{})) {
    const auto found = changes.find(name);
    ASSERT_NE(found, changes.end()) << name << " is not examined";
    const auto& [base, value] = found->second;
    const bool wants_bias = name == "bias_timeout";
    EXPECT_NE(trace(base, name + ": " + value, wants_bias), trace(base, "{}", wants_bias)) << name;
  }
}

TEST(LocalizationPipeline, ParametersAreChecked) {
  std::vector<std::string> faults;
  LocalizationParameters{}.check(faults);
  EXPECT_TRUE(faults.empty());
  LocalizationParameters parameters;
  parameters.initial_pose = {1.0, 2.0};
  parameters.antenna_offset = {1.0};
  parameters.datum.datum = {1.0};
  parameters.check(faults);
  EXPECT_EQ(faults.size(), 3u);
}

}  // namespace
}  // namespace urban_gnss
