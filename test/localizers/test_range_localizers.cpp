#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>

#include "range_rig.hpp"
#include "switching_rig.hpp"
#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"
#include "urban_gnss_localization/localizers/switching/switching_particle_filter.hpp"

namespace urban_gnss {
namespace {

/// A drive whose fixes are all off by the same, and say so by their ranges.
struct RangeDrive {
  Eigen::Vector2d bias{8.0, -6.0};
  double duration_s{120.0};
  double range_sigma_m{2.0};
  int reflected_count{2};
  double no_satellites_share{0.0};
  std::uint64_t seed{101};
};

/// Largest error (m) after the first 20 s, and the pose at the end. Started at the first fix, as a pipeline does it.
struct DriveResult {
  double worst_m{0.0};
  Pose2 last;
};

DriveResult drive_with_ranges(Localizer& localizer, const RangeDrive& d) {
  RandomEngine engine = make_engine(d.seed);
  Pose2 truth{100.0, 50.0, 0.4};
  PoseEstimate start = pose_with_sigma(truth, 10.0, 0.1);
  start.pose.x += d.bias.x();
  start.pose.y += d.bias.y();
  localizer.initialize(start);
  DriveResult result;
  for (int k = 1; k <= std::lround(10.0 * d.duration_s); ++k) {
    const Twist2 twist{k % 400 < 40 ? 0.0 : 2.0, k % 400 < 40 ? 0.0 : 0.05};
    truth = move(truth, twist, 0.1);
    localizer.move(twist, 0.1);
    if (k % 10 != 0) continue;
    FixMeasurement fix = fix_of(truth.position() + d.bias, 3.0, 0.1 * k);
    const double clock_m = 100.0 * draw_normal(engine);
    fix.satellites =
        with_ranges(two_constellations(), {-d.bias.x(), -d.bias.y(), 1.0}, {{Constellation::kGps, clock_m}});
    for (std::size_t i = 0; i < fix.satellites.size(); ++i) {
      SatelliteObservation& s = fix.satellites[i];
      s.residual_m += d.range_sigma_m * draw_normal(engine);
      s.cn0_dbhz += draw_normal(engine);
      if (static_cast<int>(i) >= d.reflected_count) continue;
      s.residual_m += 40.0;
      s.cn0_dbhz -= 12.0;
    }
    if (draw_uniform(engine) < d.no_satellites_share) fix.satellites.clear();
    localizer.correct(fix);
    if (0.1 * k < 20.0) continue;
    result.worst_m = std::max(result.worst_m, (localizer.pose().position() - truth.position()).norm());
  }
  result.last = localizer.pose();
  return result;
}

using Maker = std::function<std::unique_ptr<Localizer>(const std::string& changes)>;

std::unique_ptr<Localizer> make_imm(const std::string& changes) {
  return std::make_unique<ImmEkf>(with(ImmEkfParameters{}, changes), MotionParameters{});
}
std::unique_ptr<Localizer> make_switching(const std::string& changes) {
  return std::make_unique<SwitchingParticleFilter>(with(SwitchingParticleFilterParameters{}, changes),
                                                   MotionParameters{});
}

/// Two YAML maps as one.
std::string merged(const std::string& base, const std::string& change) {
  return base == "{}" ? change : base + "\n" + change;
}

class RangeLocalizers : public ::testing::TestWithParam<std::pair<const char*, Maker>> {
 protected:
  static DriveResult result_of(const std::string& changes, const RangeDrive& d = {}) {
    const auto localizer = GetParam().second(changes);
    return drive_with_ranges(*localizer, d);
  }
};

TEST_P(RangeLocalizers, SeeThroughABiasThatTheRangesReveal) {
  for (const std::uint64_t seed : {101, 102, 103}) {
    RangeDrive d;
    d.seed = seed;
    EXPECT_LT(result_of("{}", d).worst_m, 2.0) << seed;
    EXPECT_GT(result_of("use_ranges: false", d).worst_m, 8.0) << seed;
  }
}

TEST_P(RangeLocalizers, HoldOnWhereSomeFixesHaveNone) {
  RangeDrive d;
  d.no_satellites_share = 0.15;
  EXPECT_LT(result_of("{}", d).worst_m, 6.5);
  EXPECT_GT(result_of("use_ranges: false", d).worst_m, 8.0);
}

/// Satellites that have no ranges are no satellites.
TEST_P(RangeLocalizers, WithoutResidualsAreAsWithoutSatellites) {
  const auto last_of = [](const Sky& sky, const std::string& changes) {
    const auto localizer = GetParam().second(changes);
    localizer->initialize(pose_with_sigma({}, 1.0, 0.1));
    for (int k = 1; k <= 20; ++k) {
      localizer->move({1.0, 0.1}, 1.0);
      FixMeasurement fix = fix_of({0.8 * k, 0.3 * k}, 2.0, k);
      fix.satellites = sky;
      localizer->correct(fix);
    }
    return localizer->pose();
  };
  const Pose2 expected = last_of({}, "{}");
  EXPECT_TRUE(last_of(open_sky(40.0), "{}") == expected);
  Sky alone = with_ranges({open_sky().front()}, {5.0, 5.0, 0.0});
  EXPECT_TRUE(last_of(alone, "{}") == expected);
  const Sky sky = with_ranges(open_sky(), {5.0, 5.0, 0.0});
  EXPECT_FALSE(last_of(sky, "{}") == expected);
  EXPECT_TRUE(last_of(sky, "use_ranges: false") == expected);
}

TEST_P(RangeLocalizers, EveryRangeParameterHasAnEffect) {
  const std::vector<std::pair<std::string, std::string>> changes = {
      {"use_ranges: false", "{}"},
      {"range_sigma: 3.0", "{}"},
      {"range_sigma_min: 4.0", "fix_scale_rate: 0.3"},
      {"range_sigma_max: 0.2", "range_sigma_min: 0.1\nrange_sigma: 0.1\nfix_scale_rate: 0.3"},  // which grows
      {"nlos_mean: 25.0", "{}"},
      {"nlos_sigma: 20.0", "{}"},
      {"nlos_elevation_exponent: 0.3", "{}"},
      {"nlos_cn0_drop: 8.0", "{}"},
      {"nlos_cn0_width: 2.0", "{}"},
      {"nlos_cn0_rise: 3.0", "{}"},
      {"nlos_elevation_law: cotangent", "{}"},
      {"range_height_sigma: 5.0", "{}"},
      {"range_bias_odds: 1.0", "{}"},
  };
  EXPECT_EQ(changes.size(), parameter_names(RangeFixParameters{}).size());
  RangeDrive d;
  d.duration_s = 40.0;
  for (const auto& [change, base] : changes) {
    EXPECT_FALSE(result_of(merged(base, change), d).last == result_of(base, d).last) << change;
  }
}

INSTANTIATE_TEST_SUITE_P(Both, RangeLocalizers,
                         ::testing::Values(std::pair<const char*, Maker>{"imm_ekf", make_imm},
                                           std::pair<const char*, Maker>{"switching", make_switching}),
                         [](const auto& info) { return std::string(info.param.first); });

TEST(RangeImmEkf, OddsOfABiasMatter) {
  const auto bias_after = [](double odds) {
    ImmEkf imm(with(ImmEkfParameters{}, "range_bias_odds: " + std::to_string(odds)), {});
    imm.initialize(pose_with_sigma({}, 1.0, 0.1));
    FixMeasurement fix;
    for (int k = 1; k <= 30; ++k) {
      imm.move({1.0, 0.0}, 1.0);
      const Eigen::Vector2d off(k == 30 ? 8.0 : 0.0, 0.0);
      fix = fix_of(Eigen::Vector2d(k, 0.0) + off, 3.0, k);
      fix.satellites = with_ranges(two_constellations(), {0.0, 0.0, 0.0});  // they agree with the fix
      imm.correct(fix);
    }
    return 1.0 - imm.mode_probabilities()[0];
  };
  EXPECT_GT(bias_after(30.0), 3.0 * bias_after(1.0));
  EXPECT_GT(bias_after(1.0), 3.0 * bias_after(1.0 / 30.0));
}

/// The fix that a receiver's ranges make, and how it is weighed.
struct ReceiverRig {
  SwitchingModelParameters parameters;
  FixStatistics statistics{parameters};
  PoseEstimate before;
  double time_s{0.0};

  explicit ReceiverRig(const std::string& changes = "{}")
      : parameters(with(SwitchingModelParameters{}, changes)),
        statistics(parameters),
        before(pose_with_sigma({}, 5.0, 0.1)) {}

  FixMeasurement fix(const Sky& sky = with_ranges(two_constellations(), {3.0, -2.0, 0.0})) {
    FixMeasurement fix = fix_of({0.0, 0.0}, 4.0, time_s += 1.0);
    fix.satellites = sky;
    return fix;
  }
  /// Fixes that misfit to this share.
  void learn(int count, double exceeding) {
    for (int i = 0; i < count; ++i) {
      statistics.effective_fix(fix(), before);
      statistics.learn_fix(time_s, exceeding);
    }
  }
};

TEST(RangeFixStatistics, TakesTheRangesInPlaceOfTheFix) {
  ReceiverRig rig;
  const FixMeasurement declared = rig.fix();
  const FixMeasurement effective = rig.statistics.effective_fix(declared, rig.before);
  EXPECT_LT((effective.position - Eigen::Vector2d(3.0, -2.0)).norm(), 0.3);
  EXPECT_FALSE(effective.covariance.isApprox(declared.covariance, 0.1));
  EXPECT_EQ(rig.statistics.fix_noise(1.0).scale, 1.0);
  EXPECT_EQ(rig.statistics.bias_odds(), rig.parameters.ranges.range_bias_odds);
  // A fix without: as declared, with what has been learnt of fixes.
  const FixMeasurement plain = rig.statistics.effective_fix(rig.fix({}), rig.before);
  EXPECT_EQ(plain.position, declared.position);
  EXPECT_TRUE(plain.covariance.isApprox(declared.covariance, 1e-9));
  EXPECT_EQ(rig.statistics.fix_noise(1.0).scale, rig.parameters.noise.first_fix_scale);
  EXPECT_EQ(rig.statistics.bias_odds(), 1.0);
}

TEST(RangeFixStatistics, TheAntennaAndNotTheBaseIsWhereRangesSay) {
  // What is known is the place of the antenna: 30 m from the base, and a reflection is judged by it.
  ReceiverRig rig;
  rig.before = pose_with_sigma({}, 1.0, 0.01);
  Sky sky = with_ranges(open_sky(), {30.0, 0.0, 0.0});
  sky[5].residual_m += 40.0;
  FixMeasurement fix = rig.fix(sky);
  fix.antenna_in_body = {30.0, 0.0};
  EXPECT_LT((rig.statistics.effective_fix(fix, rig.before).position - Eigen::Vector2d(30.0, 0.0)).norm(), 1.0);
}

TEST(RangeFixStatistics, LearnsHowGoodRangesAreWithinLimits) {
  ReceiverRig rig;
  const RangeFixParameters& p = rig.parameters.ranges;
  EXPECT_NEAR(rig.statistics.range_sigma_m(), p.range_sigma, 1e-9);
  const double first = rig.statistics.effective_fix(rig.fix(), rig.before).covariance.trace();
  double last = p.range_sigma;
  for (int round = 0; round < 300; ++round) {
    rig.learn(1, 0.0);
    EXPECT_LE(rig.statistics.range_sigma_m(), last);
    EXPECT_GE(rig.statistics.range_sigma_m(), p.range_sigma_min - 1e-9);
    last = rig.statistics.range_sigma_m();
  }
  EXPECT_NEAR(last, p.range_sigma_min, 1e-9);
  EXPECT_LT(rig.statistics.effective_fix(rig.fix(), rig.before).covariance.trace(), 0.2 * first);
  for (int round = 0; round < 300; ++round) {
    rig.learn(1, 1.0);
    EXPECT_LE(rig.statistics.range_sigma_m(), p.range_sigma_max + 1e-9);
  }
  EXPECT_NEAR(rig.statistics.range_sigma_m(), p.range_sigma_max, 1e-9);

  rig.statistics.reset();
  EXPECT_NEAR(rig.statistics.range_sigma_m(), p.range_sigma, 1e-9);
  // The level of free signals is forgotten, too: of weak ones alone, nobody knows that they are weak.
  const auto after_strong = [](bool resets) {
    ReceiverRig weak;
    Sky sky = with_ranges(open_sky(), {0.0, 0.0, 0.0});
    if (resets) {
      for (int i = 0; i < 50; ++i) weak.statistics.effective_fix(weak.fix(sky), weak.before);
      weak.statistics.reset();
    }
    for (SatelliteObservation& s : sky) s.cn0_dbhz -= 20.0;
    return weak.statistics.effective_fix(weak.fix(sky), weak.before).covariance;
  };
  EXPECT_EQ(after_strong(true), after_strong(false));
}

TEST(RangeFixStatistics, FixesAndRangesAreLearntApart) {
  ReceiverRig rig;
  rig.learn(100, 1.0);
  rig.statistics.effective_fix(rig.fix({}), rig.before);
  EXPECT_EQ(rig.statistics.fix_noise(rig.time_s).scale, rig.parameters.noise.first_fix_scale);
  rig.statistics.learn_fix(rig.time_s, 1.0);
  EXPECT_GT(rig.statistics.fix_noise(rig.time_s).scale, rig.parameters.noise.first_fix_scale);
  EXPECT_NEAR(rig.statistics.range_sigma_m(), rig.parameters.ranges.range_sigma_max, 1e-9);
  // Where nothing is learnt, the declared range_sigma is what counts.
  ReceiverRig fixed("{fix_scale_rate: 0.0, range_sigma: 3.0}");
  fixed.learn(100, 1.0);
  EXPECT_EQ(fixed.statistics.range_sigma_m(), 3.0);
}

}  // namespace
}  // namespace urban_gnss
