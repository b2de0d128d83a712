#include <cmath>

#include "pipeline_rig.hpp"
#include "range_rig.hpp"
#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"

namespace urban_gnss {
namespace {

/// Satellites that tell their fix: one whose number is that of the fix's second.
Sky marked(double time) { return {satellite(static_cast<int>(std::lround(time)), 10.0, 45.0)}; }

struct SkyRig : Rig {
  explicit SkyRig(const std::string& changes = "{}", bool wants_bias = false)
      : Rig(with(with(LocalizationParameters{}, kGiven), changes), std::make_unique<FakeLocalizer>()) {
    fake->wants = wants_bias;
    for (int k = 0; k <= 5; ++k) drive(0.1 * k);
  }
  void satellites(double time) { pipeline.add_satellites(at(time), marked(time)); }
  void drive_through(double from, double to) {
    for (long k = std::lround(10.0 * from); k <= std::lround(10.0 * to); ++k) drive(0.1 * k);
  }
  std::size_t taken() const { return fake->fixes.size(); }
  /// The number of the satellite that the last fix came with; 0 where it had none.
  int last_mark() const {
    const auto& satellites = fake->fixes.back().satellites;
    return satellites.empty() ? 0 : satellites.front().id.svid;
  }
};

TEST(SatellitesOfFixes, BeforeTheFixTheyArePaired) {
  SkyRig rig;
  for (const double time : {1.0, 2.0, 3.0}) {
    rig.satellites(time);
    rig.fix(time);
    EXPECT_EQ(rig.taken(), static_cast<std::size_t>(time) - 1);
    rig.drive(time);
    ASSERT_EQ(rig.taken(), static_cast<std::size_t>(time));
    EXPECT_EQ(rig.last_mark(), time);
  }
}

TEST(SatellitesOfFixes, AfterTheFixTheyAreWaitedForFromTheSecondOn) {
  SkyRig rig;
  rig.fix(1.0);
  rig.drive(1.0);
  ASSERT_EQ(rig.taken(), 1u);  // nobody knows yet that there are any
  EXPECT_EQ(rig.last_mark(), 0);
  rig.satellites(1.0);
  EXPECT_EQ(rig.taken(), 1u);
  for (const double time : {2.0, 3.0}) {
    rig.fix(time);
    rig.drive_through(time, time + 0.4);
    EXPECT_EQ(rig.taken(), static_cast<std::size_t>(time) - 1);
    rig.satellites(time);
    ASSERT_EQ(rig.taken(), static_cast<std::size_t>(time));
    EXPECT_EQ(rig.last_mark(), time);
    // As late as any other fix: where the antenna was at its own stamp.
    EXPECT_LT((transform_point(Rig::truth(time + 0.4), rig.fake->fixes.back().antenna_in_body) -
               rig.fake->fixes.back().position)
                  .norm(),
              1e-6);
  }
}

TEST(SatellitesOfFixes, AreWaitedForAtMostSatellitesWait) {
  for (const double timeout : {0.3, 0.8}) {
    SkyRig rig("satellites_wait: " + std::to_string(timeout));
    rig.satellites(1.0);
    rig.fix(1.0);
    rig.drive(1.0);
    rig.fix(2.0);
    rig.drive_through(2.0, 2.0 + timeout - 0.1);
    EXPECT_EQ(rig.taken(), 1u);
    rig.drive(2.0 + timeout);
    ASSERT_EQ(rig.taken(), 2u);
    EXPECT_EQ(rig.last_mark(), 0);
    // The next one does not wait: they have ceased.
    rig.fix(3.0);
    rig.drive(3.0);
    EXPECT_EQ(rig.taken(), 3u);
    // Until they come again, be it late.
    rig.satellites(3.0);
    rig.fix(4.0);
    rig.drive(4.0);
    EXPECT_EQ(rig.taken(), 3u);
    rig.satellites(4.0);
    EXPECT_EQ(rig.last_mark(), 4);
  }
  SkyRig never("satellites_wait: 0.0");
  never.satellites(1.0);
  never.fix(1.0);
  never.drive(1.0);
  never.fix(2.0);
  never.drive(2.0);
  EXPECT_EQ(never.taken(), 2u);
}

TEST(SatellitesOfFixes, WaitIsNotNegative) {
  for (const auto& [value, fault_count] : {std::pair{"0.0", 0u}, {"-0.1", 1u}, {".nan", 1u}}) {
    LocalizationParameters parameters;
    ParameterReader reader(YAML::Load(std::string("satellites_wait: ") + value));
    reader.read(parameters);
    EXPECT_EQ(reader.finish().size(), fault_count) << value;
  }
}

TEST(SatellitesOfFixes, AreNotWaitedForWhereNoneEverCame) {
  SkyRig rig;
  for (const double time : {1.0, 2.0, 3.0}) {
    rig.fix(time);
    rig.drive(time);
    EXPECT_EQ(rig.taken(), static_cast<std::size_t>(time));
    EXPECT_EQ(rig.last_mark(), 0);
  }
  // Nor where there are some that belong to no fix.
  rig.satellites(3.5);
  rig.fix(4.0);
  rig.drive(4.0);
  EXPECT_EQ(rig.taken(), 4u);
}

TEST(SatellitesOfFixes, LocalizerWithoutUseForThemNeitherHasNorAwaitsThem) {
  SkyRig rig;
  rig.fake->takes_sky = false;
  for (const double time : {1.0, 2.0, 3.0}) {
    if (time < 3.0) rig.satellites(time);
    rig.fix(time);
    rig.drive(time);
    ASSERT_EQ(rig.taken(), static_cast<std::size_t>(time));
    EXPECT_EQ(rig.last_mark(), 0);
  }
  ImmEkfParameters p;
  EXPECT_TRUE(ImmEkf(p, {}).takes_satellites());
  p.ranges.use_ranges = false;
  EXPECT_FALSE(ImmEkf(p, {}).takes_satellites());
}

TEST(SatellitesOfFixes, StampsMayBeRounded) {
  SkyRig rig;
  rig.pipeline.add_satellites(Rig::at(1.009), marked(1.0));
  rig.fix(1.0);
  rig.drive(1.0);
  EXPECT_EQ(rig.last_mark(), 1);
  rig.pipeline.add_satellites(Rig::at(2.0), marked(2.0));
  rig.fix(1.991);
  rig.drive(2.0);
  EXPECT_EQ(rig.last_mark(), 2);
  rig.pipeline.add_satellites(Rig::at(2.95), marked(3.0));  // of another epoch
  rig.fix(3.0);
  rig.drive_through(3.0, 3.5);
  EXPECT_EQ(rig.taken(), 3u);
  EXPECT_EQ(rig.last_mark(), 0);
}

/// 50 Hz, and odometry that comes later than several epochs: each fix has its own satellites, not a neighbour's.
TEST(SatellitesOfFixes, EpochsThatAreCloseAreKeptApart) {
  for (const bool satellites_first : {true, false}) {
    SkyRig rig;
    const auto time_of = [](int k) { return 1.0 + 0.02 * k; };
    const auto add_satellites = [&](int k) {
      rig.pipeline.add_satellites(Rig::at(time_of(k)), {satellite(100 + k, 10.0, 45.0)});
    };
    for (int k = 0; k < 20; ++k) {
      if (satellites_first) add_satellites(k);
      rig.fix(time_of(k));
      if (k % 5 == 4) rig.drive(time_of(k));
      if (!satellites_first) add_satellites(k);
    }
    rig.drive(1.5);
    ASSERT_EQ(rig.taken(), 20u);
    for (int k = satellites_first ? 0 : 5; k < 20; ++k) {
      ASSERT_EQ(rig.fake->fixes[k].satellites.size(), 1u) << k;
      EXPECT_EQ(rig.fake->fixes[k].satellites[0].id.svid, 100 + k) << satellites_first;
    }
  }
}

TEST(SatellitesOfFixes, WaitAsWellAsTheBias) {
  SkyRig rig("{}", true);
  rig.satellites(1.0);
  rig.fix(1.0);
  rig.bias(1.0, 3.0);
  rig.drive(1.0);
  ASSERT_EQ(rig.taken(), 1u);
  EXPECT_EQ(rig.last_mark(), 1);
  rig.fix(2.0);
  rig.drive(2.0);
  rig.bias(2.0, 4.0);
  EXPECT_EQ(rig.taken(), 1u);
  rig.satellites(2.0);
  ASSERT_EQ(rig.taken(), 2u);
  EXPECT_EQ(rig.last_mark(), 2);
  EXPECT_EQ(rig.fake->fixes.back().bias_radius_m, 4.0);
}

TEST(SatellitesOfFixes, ManyThatNoFixWantsAreForgotten) {
  SkyRig rig;
  rig.satellites(1.0);
  for (int k = 0; k < 100000; ++k) rig.pipeline.add_satellites(Rig::at(100.0 + k), marked(7.0));
  rig.fix(1.0);
  rig.drive(1.0);
  ASSERT_EQ(rig.taken(), 1u);
  EXPECT_EQ(rig.last_mark(), 0);
}

TEST(SatellitesOfFixes, ResetForgetsThem) {
  SkyRig rig;
  rig.satellites(1.0);
  rig.fix(1.0);
  rig.drive(1.0);
  EXPECT_EQ(rig.last_mark(), 1);
  rig.satellites(3.0);
  rig.pipeline.reset("asked for");
  rig.pipeline.set_pose(pose_with_sigma(Rig::truth(2.0), 1.0, 0.1));
  rig.drive(2.0);
  rig.drive(2.1);
  // That no fix has satellites is as it was at the start, and those of before are gone.
  rig.fix(3.0);
  rig.drive_through(2.2, 3.0);
  ASSERT_EQ(rig.taken(), 2u);
  EXPECT_EQ(rig.last_mark(), 0);
}

/// What comes of a run with a fix each second, whose satellites come before or after it.
std::vector<LocalizationOutput> outputs_of(bool satellites_first, bool knows_beforehand) {
  LocalizationParameters parameters = with(LocalizationParameters{}, kGiven);
  Rig rig(parameters, std::make_unique<ImmEkf>(ImmEkfParameters{}, MotionParameters{}));
  RandomEngine engine = make_engine(101);
  for (int k = 0; k <= 300; ++k) {
    const double time = 0.1 * k;
    if (k % 10 == 5) {
      Sky ranges = with_ranges(open_sky(), Eigen::Vector3d::Zero());
      for (SatelliteObservation& each : ranges) each.residual_m += draw_normal(engine);
      ranges[2].residual_m += 40.0;
      set_cn0(ranges[2], 14.0);
      const auto [sky, error] = at_solution(ranges, [](const SatelliteObservation&) { return 1.0; });
      const bool first = satellites_first || (knows_beforehand && k == 5);
      if (first) rig.pipeline.add_satellites(Rig::at(time), sky);
      rig.fix(time, error);
      if (!first) rig.pipeline.add_satellites(Rig::at(time), sky);
    }
    rig.drive(time);
  }
  return rig.pipeline.take_outputs();
}

TEST(SatellitesOfFixes, BeforeOrAfterTheFixIsTheSameRun) {
  const auto before = outputs_of(true, true);
  const auto after = outputs_of(false, true);
  ASSERT_EQ(before.size(), after.size());
  ASSERT_GT(before.size(), 290u);
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(before[i].stamp, after[i].stamp);
    EXPECT_TRUE(before[i].estimate.pose == after[i].estimate.pose) << i;
    EXPECT_EQ(before[i].estimate.covariance, after[i].estimate.covariance) << i;
  }
  EXPECT_LT((before.back().estimate.pose.position() - Rig::truth(30.0).position()).norm(), 1.5);
}

TEST(SatellitesOfFixes, ResidualsOfAnotherPositionAreLeftOut) {
  const Sky at_the_fix = at_solution([] {
    Sky sky = with_ranges(two_constellations(), Eigen::Vector3d::Zero());
    sky[2].residual_m += 40.0;
    return sky;
  }());
  Sky beside = at_the_fix;
  for (SatelliteObservation& each : beside) each.residual_m += range_gradient(each.look).x() * 60.0;

  const auto residual_with = [&](const Sky& sky, const std::string& changes) {
    SkyRig rig(changes);
    std::size_t warnings = 0;
    for (double time = 1.0; time <= 22.0; time += 1.0) {
      rig.pipeline.add_satellites(Rig::at(time), sky);
      rig.fix(time);
      rig.drive(time);
      for (const PipelineEvent& event : rig.pipeline.take_events()) {
        warnings += event.text.find("residuals") != std::string::npos;
      }
    }
    const auto& taken = rig.fake->fixes.back().satellites;
    EXPECT_EQ(taken.size(), sky.size());
    EXPECT_EQ(warnings, std::isnan(taken[2].residual_m) ? 1u : 0u);
    return taken[2].residual_m;
  };
  EXPECT_EQ(residual_with(at_the_fix, "{}"), at_the_fix[2].residual_m);
  EXPECT_TRUE(std::isnan(residual_with(beside, "{}")));
  EXPECT_EQ(residual_with(beside, "{residual_misfit_limit: 10.0}"), beside[2].residual_m);
}

}  // namespace
}  // namespace urban_gnss
