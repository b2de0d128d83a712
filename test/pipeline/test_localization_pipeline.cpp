#include <algorithm>

#include "pipeline_rig.hpp"
#include "urban_gnss_localization/gnss/covariance_filter.hpp"
#include "urban_gnss_localization/localizers/nishida/particle_filter.hpp"
#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"
#include "urban_gnss_localization/localizers/switching/switching_particle_filter.hpp"

namespace urban_gnss {
namespace {

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

TEST(LocalizationPipeline, LateFixIsComparedWithThePoseAtItsOwnStamp) {
  Rig rig(kGiven);
  rig.pipeline.set_antenna_offset({0.4, -0.3});
  for (int k = 0; k <= 40; ++k) rig.drive(0.1 * k);
  for (const double time : {2.0, 2.137, 3.95, 4.0}) {
    rig.fix(time, {0.0, 0.0}, {0.4, -0.3});
    // Where the antenna was, seen from where the base is now: with the true pose it is where the fix is.
    const FixMeasurement& fix = rig.fake->fixes.back();
    EXPECT_NEAR(fix.time_s, 1000.0 + time, 1e-9);
    EXPECT_LT((transform_point(Rig::truth(4.0), fix.antenna_in_body) - fix.position).norm(), 1e-6) << time;
    const Pose2 back = relative_pose(Rig::truth(4.0), Rig::truth(time));
    EXPECT_LT((fix.antenna_in_body - transform_point(back, {0.4, -0.3})).norm(), 1e-12) << time;
  }
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
  EXPECT_TRUE(std::isnan(rig.pipeline.report().bias_radius_m));
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

TEST(LocalizationPipeline, BiasOfBeforeTheClockWasSetBackIsForgotten) {
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

TEST(LocalizationPipeline, NonFiniteMessagesChangeNothing) {
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
    const auto events = rig.pipeline.take_events();
    EXPECT_EQ(with_bad_ones, std::any_of(events.begin(), events.end(), [](const PipelineEvent& event) {
                return event.text.find("odometry left out: ") != std::string::npos;
              }));
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

TEST(LocalizationPipeline, NonFiniteCovarianceOrAltitudeIsReplaced) {
  Rig rig(kGiven);
  rig.drive(0.0);
  RawFix fix = raw_fix(Rig::at(0.5), {1.0, 2.0});
  fix.position.altitude_m = kNaN;
  fix.covariance.setConstant(kNaN);
  rig.pipeline.add_fix(fix);
  rig.drive(1.0);
  ASSERT_EQ(rig.fake->fixes.size(), 1u);
  EXPECT_LT((rig.fake->fixes[0].covariance - isotropic(4.0)).norm(), 1e-12);
  EXPECT_TRUE(rig.fake->fixes[0].position.allFinite());
  EXPECT_EQ(rig.pipeline.report().last_fix.decision, FixDecision::kInflated);
}

// A fix without weight, as Algorithm 3 of Maier and Kleiner makes them, reaches every localizer as it is.
TEST(LocalizationPipeline, RInfinityIsKept) {
  Rig rig(kGiven);
  rig.drive(0.0);
  rig.pipeline.add_fix(raw_fix(Rig::at(0.5), {1.0, 2.0}, CovarianceFilterParameters().sigma_infinite));
  rig.drive(1.0);
  ASSERT_EQ(rig.fake->fixes.size(), 1u);
  EXPECT_LT((rig.fake->fixes[0].covariance - isotropic(600.0)).norm(), 1e-6);
  EXPECT_FALSE(rig.pipeline.report().last_fix.covariance_clamped);
}

TEST(LocalizationPipeline, OutputStampsAscend) {
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

TEST(LocalizationPipeline, StampsAscendAcrossAResetThatIsAskedFor) {
  Rig rig(kGiven);
  rig.drive(0.0);
  rig.drive(5.0);
  rig.pipeline.take_outputs();
  rig.pipeline.reset("a test");
  rig.drive(5.0);  // came twice
  EXPECT_TRUE(rig.pipeline.take_outputs().empty());
  rig.drive(5.1);
  EXPECT_EQ(rig.pipeline.take_outputs().size(), 1u);
  // A recording that starts over is still seen as that.
  for (const double time : {0.0, 0.1, 0.2}) rig.drive(time);
  EXPECT_TRUE(has_event(rig.pipeline, PipelineEvent::Level::kWarn, "jumped back"));
  EXPECT_EQ(rig.pipeline.take_outputs().size(), 3u);
}

using MakeFilter = std::unique_ptr<Localizer> (*)(int particle_count);

template <ParticleFilterMode kMode>
std::unique_ptr<Localizer> make_filter(int particle_count) {
  ParticleFilterParameters filter;
  filter.mode = kMode;
  filter.likelihood = LikelihoodChoice::kProduct;
  filter.particle_count = particle_count;
  return std::make_unique<ParticleFilter>(filter, MotionParameters{});
}
constexpr MakeFilter make_paper_filter = make_filter<ParticleFilterMode::kPaper>;
constexpr MakeFilter make_conventional_filter = make_filter<ParticleFilterMode::kConventional>;
constexpr MakeFilter make_switching_filter = [](int) -> std::unique_ptr<Localizer> {
  return std::make_unique<SwitchingParticleFilter>(SwitchingParticleFilterParameters{}, MotionParameters{});
};

TEST(LocalizationPipeline, ClockSetBackGivesTheSameRunAgain) {
  for (const auto& make : {make_paper_filter, make_switching_filter}) {
    LocalizationParameters parameters;
    parameters.datum.datum = {33.0, 130.0, 20.0};
    Rig rig(parameters, make(100));
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
  for (const auto make : {make_conventional_filter, make_paper_filter, make_switching_filter}) {
    Rig rig(parameters, make(500));
    rig.run(0.0, 120.0);
    const auto outputs = rig.pipeline.take_outputs();
    ASSERT_FALSE(outputs.empty());
    // Fixes without error and of a declared 1 m: within a metre or two of the truth.
    EXPECT_LT((outputs.back().estimate.pose.position() - Rig::truth(120.0).position()).norm(), 2.0);
    EXPECT_LT(std::abs(angle_difference(outputs.back().estimate.pose.yaw, Rig::truth(120.0).yaw)), 0.3);
    EXPECT_EQ(rig.state(), LocalizationState::kTracking);
  }
}

TEST(LocalizationPipeline, TracksWithTheInteractingModels) {
  LocalizationParameters parameters;
  parameters.datum.datum = {33.0, 130.0, 20.0};
  Rig rig(parameters, std::make_unique<ImmEkf>(ImmEkfParameters{}, MotionParameters{}));
  rig.run(0.0, 120.0);
  const auto outputs = rig.pipeline.take_outputs();
  ASSERT_FALSE(outputs.empty());
  EXPECT_LT((outputs.back().estimate.pose.position() - Rig::truth(120.0).position()).norm(), 2.0);
  EXPECT_LT(std::abs(angle_difference(outputs.back().estimate.pose.yaw, Rig::truth(120.0).yaw)), 0.3);
  EXPECT_EQ(rig.state(), LocalizationState::kTracking);
}

TEST(LocalizationPipeline, AnInertGateIsToldOnceAndSoIsItsEnd) {
  Rig rig(kGiven);
  rig.fake->gated = true;
  rig.fake->nis = 0.01;
  rig.run(0.0, 28.0);
  EXPECT_FALSE(has_event(rig.pipeline, PipelineEvent::Level::kWarn, "gate inert"));
  rig.run(28.1, 40.0);
  EXPECT_TRUE(has_event(rig.pipeline, PipelineEvent::Level::kWarn, "gate inert"));
  EXPECT_TRUE(rig.pipeline.report().is_gate_inert);
  rig.fake->nis = 20.0;
  rig.run(40.1, 50.0);
  EXPECT_TRUE(has_event(rig.pipeline, PipelineEvent::Level::kInfo, "the gate works again"));
  EXPECT_FALSE(rig.pipeline.report().is_gate_inert);
}

TEST(LocalizationPipeline, ParametersAreChecked) {
  std::vector<std::string> faults;
  faults = faults_of(LocalizationParameters{});
  EXPECT_TRUE(faults.empty());
  LocalizationParameters parameters;
  parameters.start.initial_pose = {1.0, 2.0};
  parameters.input.antenna_offset = {1.0};
  parameters.datum.datum = {1.0};
  faults = faults_of(parameters);
  EXPECT_EQ(faults.size(), 3u);
}

}  // namespace
}  // namespace urban_gnss
