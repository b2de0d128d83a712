#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "range_rig.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Finite and positive definite.
bool is_sound(const RelativePlace& place) {
  return place.offset.allFinite() && place.covariance.allFinite() && place.covariance(0, 0) > 0.0 &&
         place.covariance.determinant() > 0.0;
}

::testing::AssertionResult same(const RelativePlace& a, const RelativePlace& b, double tolerance) {
  const double apart =
      std::max((a.offset - b.offset).cwiseAbs().maxCoeff(), (a.covariance - b.covariance).cwiseAbs().maxCoeff());
  if (apart <= tolerance) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << a.offset.transpose() << " | " << a.covariance << " is " << apart << " from "
                                       << b.offset.transpose() << " | " << b.covariance;
}

/// Where all ranges are direct: with `noise_m` on each.
Sky noisy_sky(RandomEngine& engine, double noise_m) {
  const Eigen::Vector3d place(uniform_between(-20, 20, engine), uniform_between(-20, 20, engine),
                              uniform_between(-20, 20, engine));
  Sky sky = with_ranges(two_constellations(), place,
                        {{Constellation::kGps, uniform_between(-1e4, 1e4, engine)},
                         {Constellation::kGalileo, uniform_between(-1e4, 1e4, engine)}});
  for (SatelliteObservation& s : sky) s.residual_m += noise_m * draw_normal(engine);
  return sky;
}

TEST(RangeFix, OfDirectRangesIsWeightedLeastSquares) {
  RandomEngine engine = make_engine(101);
  for (int round = 0; round < 20; ++round) {
    RangeFixParameters p = all_direct();
    p.range_sigma = uniform_between(1.0, 7.0, engine);
    p.range_height_sigma = uniform_between(3.0, 100.0, engine);
    const Sky sky = noisy_sky(engine, p.range_sigma);
    const auto fix = range_fix(sky, kNominalCn0, known_place({0.0, 0.0}, 50.0), p);
    ASSERT_TRUE(fix);
    const auto expected =
        DenseRanges(sky)
            .solve(std::vector<RangeNoise>(sky.size(), {0.0, p.range_sigma}), p.range_height_sigma, anywhere())
            .place();
    EXPECT_TRUE(same(*fix, expected, 1e-5));
    EXPECT_TRUE(is_sound(*fix));
  }
}

TEST(RangeFix, FindsTheAntennaWithTheDefaults) {
  const Eigen::Vector3d place(12.0, -7.0, 5.0);
  const Sky sky =
      with_ranges(two_constellations(), place, {{Constellation::kGps, 40.0}, {Constellation::kGalileo, -900.0}});
  const auto fix = range_fix(sky, kNominalCn0, known_place({10.0, -5.0}, 10.0), {});
  ASSERT_TRUE(fix);
  EXPECT_LT((fix->offset - place.head<2>()).norm(), 0.3);
  EXPECT_LT(fix->covariance.trace(), 2.0 * 5.0 * 5.0);
}

TEST(RangeFix, ClocksAndOrderDoNotMatter) {
  RandomEngine engine = make_engine(102);
  Sky sky = noisy_sky(engine, 6.0);
  sky[3].residual_m += 35.0;
  set_cn0(sky[3], 15.0);
  const RelativePlace known = known_place({3.0, 2.0}, 8.0);
  const auto before = range_fix(sky, kNominalCn0, known, {});
  ASSERT_TRUE(before);
  for (const Constellation constellation : {Constellation::kGps, Constellation::kGalileo}) {
    Sky shifted = sky;
    for (SatelliteObservation& s : shifted) s.residual_m += s.id.constellation == constellation ? 777.0 : 0.0;
    EXPECT_TRUE(same(*range_fix(shifted, kNominalCn0, known, {}), *before, 1e-6));
  }
  for (int round = 0; round < 10; ++round) {
    for (std::size_t i = sky.size(); i > 1; --i) std::swap(sky[i - 1], sky[engine() % i]);
    EXPECT_TRUE(same(*range_fix(sky, kNominalCn0, known, {}), *before, 1e-9));
  }
}

TEST(RangeFix, IsTheLikelihoodWithoutWhatIsKnown) {
  RandomEngine engine = make_engine(103);
  const Sky sky = noisy_sky(engine, 3.0);
  // Judged alike: all direct, however far the known place is from that of the ranges.
  const auto loose = range_fix(sky, kNominalCn0, known_place({0.0, 0.0}, 100.0), all_direct());
  ASSERT_TRUE(loose);
  for (const Eigen::Vector2d& offset :
       {Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(60.0, 0.0), Eigen::Vector2d(-20.0, 50.0)}) {
    for (const double sigma : {0.0, 0.1, 10.0}) {
      const auto fix = range_fix(sky, kNominalCn0, known_place(offset, sigma), all_direct());
      ASSERT_TRUE(fix);
      EXPECT_TRUE(same(*fix, *loose, 1e-5)) << offset.transpose() << ", " << sigma;
    }
  }
}

TEST(RangeFix, SatelliteAloneInItsConstellationChangesNothing) {
  RandomEngine engine = make_engine(104);
  Sky sky = noisy_sky(engine, 4.0);
  const RelativePlace known = known_place({0.0, 0.0}, 30.0);
  const auto before = range_fix(sky, kNominalCn0, known, {});
  sky.push_back(satellite(7, 80, 45, Constellation::kBeidou));
  set_cn0(sky.back());
  sky.back().residual_m = 13.0;
  EXPECT_TRUE(same(*range_fix(sky, kNominalCn0, known, {}), *before, 0.0));
  // With another of its clock it does.
  sky.push_back(satellite(8, 260, 30, Constellation::kBeidou));
  set_cn0(sky.back());
  sky.back().residual_m = -4.0;
  EXPECT_FALSE(same(*range_fix(sky, kNominalCn0, known, {}), *before, 1e-3));
  EXPECT_FALSE(range_fix({sky.front()}, kNominalCn0, known, {}));
  EXPECT_FALSE(range_fix({sky.front(), sky.back()}, kNominalCn0, known, {}));
}

TEST(RangeFix, SbasAndQzssHaveTheClockOfGps) {
  for (const Constellation c : {Constellation::kGps, Constellation::kGalileo, Constellation::kBeidou,
                                Constellation::kGlonass, Constellation::kNavic, Constellation::kUnknown}) {
    EXPECT_EQ(clock_of(c), c);
  }
  EXPECT_EQ(clock_of(Constellation::kSbas), Constellation::kGps);
  EXPECT_EQ(clock_of(Constellation::kQzss), Constellation::kGps);
  RandomEngine engine = make_engine(105);
  Sky sky = noisy_sky(engine, 4.0);
  const RelativePlace known = known_place({0.0, 0.0}, 30.0);
  const auto expected = range_fix(sky, kNominalCn0, known, {});
  sky[0].id = {Constellation::kQzss, 195};
  sky[1].id = {Constellation::kSbas, 137};
  EXPECT_TRUE(same(*range_fix(sky, kNominalCn0, known, {}), *expected, 1e-9));
  // Two that are alone but for the clock that they share.
  EXPECT_TRUE(range_fix({sky[0], sky[1]}, kNominalCn0, known, {}));
}

TEST(RangeFix, SatelliteCountsOnce) {
  RandomEngine engine = make_engine(106);
  const Sky sky = noisy_sky(engine, 4.0);
  const RelativePlace known = known_place({0.0, 0.0}, 30.0);
  Sky twice = sky;
  twice.insert(twice.end(), sky.begin(), sky.begin() + 5);
  EXPECT_TRUE(same(*range_fix(twice, kNominalCn0, known, {}), *range_fix(sky, kNominalCn0, known, {}), 0.0));
  EXPECT_FALSE(range_fix({sky[0], sky[0]}, kNominalCn0, known, {}));
  // Of two signals, the one that can be used.
  twice = sky;
  twice.insert(twice.begin(), sky[2]);
  twice.front().residual_m = kNaN;
  EXPECT_TRUE(same(*range_fix(twice, kNominalCn0, known, {}), *range_fix(sky, kNominalCn0, known, {}), 0.0));
}

TEST(RangeFix, LeavesOutWhatCannotBeUsed) {
  RandomEngine engine = make_engine(107);
  const Sky sky = noisy_sky(engine, 4.0);
  const RelativePlace known = known_place({0.0, 0.0}, 30.0);
  const auto without_first = range_fix({sky.begin() + 1, sky.end()}, kNominalCn0, known, {});
  const auto with_all = range_fix(sky, kNominalCn0, known, {});
  ASSERT_TRUE(without_first && with_all);
  EXPECT_FALSE(same(*with_all, *without_first, 1e-3));
  const std::vector<void (*)(SatelliteObservation&)> spoilers = {
      [](auto& s) { s.residual_m = kNaN; },
      [](auto& s) { s.residual_m = kInfinity; },
      [](auto& s) { s.residual_m = -kInfinity; },
      [](auto& s) { s.residual_m = 1e30; },
      [](auto& s) { s.residual_m = -1e30; },
      [](auto& s) { s.look.azimuth_rad = kNaN; },
      [](auto& s) { s.look.azimuth_rad = kInfinity; },
      [](auto& s) { s.look.elevation_rad = kNaN; },
      [](auto& s) { s.look.elevation_rad = -0.1; },
      [](auto& s) { s.look.elevation_rad = kInfinity; },
      [](auto& s) { s.cn0_dbhz = 0.0; },
      [](auto& s) { s.cn0_dbhz = kNaN; },
      [](auto& s) { s.cn0_dbhz = kInfinity; },
      [](auto& s) { s.tracked = false; },
  };
  for (std::size_t i = 0; i < spoilers.size(); ++i) {
    Sky spoilt = sky;
    spoilers[i](spoilt.front());
    const auto fix = range_fix(spoilt, kNominalCn0, known, {});
    ASSERT_TRUE(fix) << i;
    EXPECT_TRUE(same(*fix, *without_first, 0.0)) << i;
    for (SatelliteObservation& s : spoilt) spoilers[i](s);
    EXPECT_FALSE(range_fix(spoilt, kNominalCn0, known, {})) << i;
  }
  EXPECT_FALSE(range_fix({}, kNominalCn0, known, {}));
}

TEST(RangeFix, KnownPlaceMayBeNonsense) {
  RandomEngine engine = make_engine(108);
  const Sky sky = noisy_sky(engine, 4.0);
  for (const double offset : {0.0, 1e3, 1e30, kNaN, kInfinity}) {
    for (const double sigma : {0.0, 1e-9, 1e9, 1e200, kNaN, kInfinity}) {
      RelativePlace known = known_place({offset, -offset}, sigma);
      known.covariance(0, 1) = known.covariance(1, 0) = 0.0;
      const auto fix = range_fix(sky, kNominalCn0, known, {});
      EXPECT_TRUE(!fix || is_sound(*fix)) << offset << ", " << sigma;
    }
  }
  for (const double level : {kNaN, kInfinity, -kInfinity, 0.0, 1e30}) {
    const auto fix = range_fix(sky, level, known_place({0.0, 0.0}, 30.0), {});
    EXPECT_TRUE(!fix || is_sound(*fix)) << level;
  }
}

double of_these(const std::vector<double>& values, RandomEngine& engine) { return values[engine() % values.size()]; }

/// Skies as drivers make them, and as none does: finite and positive definite, or nothing. Where ranges say nothing,
/// 100 m per axis are left.
TEST(RangeFix, AnySkyGivesAFixThatIsSoundOrNothing) {
  RandomEngine engine = make_engine(109);
  const Constellation constellations[] = {Constellation::kGps, Constellation::kQzss, Constellation::kGalileo,
                                          Constellation::kGlonass, Constellation::kUnknown};
  int solved = 0;
  for (int round = 0; round < 1000; ++round) {
    const int kind = round % 4;
    Sky sky;
    const int count = static_cast<int>(engine() % 30);
    for (int i = 0; i < count; ++i) {
      SatelliteObservation s = satellite(i / 2, uniform_between(0, 360, engine), uniform_between(-5, 90, engine),
                                         constellations[engine() % 5]);
      if (kind == 1) s.look = {1.0, 0.7};                                    // all in one direction
      if (kind == 2) s.look = {i % 2 == 0 ? 0.0 : kPi, 0.0};                 // on a line
      if (kind == 3 && engine() % 8 == 0) s.look.elevation_rad = 0.5 * kPi;  // overhead
      s.cn0_dbhz = uniform_between(-5, 60, engine);
      s.residual_m = std::pow(10.0, uniform_between(-3, 5.2, engine)) * (engine() % 2 == 0 ? 1.0 : -1.0);
      if (engine() % 10 == 0) s.residual_m = of_these({kNaN, kInfinity, 1e30, 0.0, 1e5}, engine);
      if (engine() % 10 == 0) s.cn0_dbhz = of_these({kNaN, 0.0, 1e9, kInfinity}, engine);
      if (kind == 0 && engine() % 20 == 0) s.look.azimuth_rad = of_these({kNaN, kInfinity, 1e9}, engine);
      sky.push_back(s);
    }
    RangeFixParameters p;
    p.range_sigma = std::pow(10.0, uniform_between(-8, 3, engine));
    const RelativePlace known =
        known_place({uniform_between(-1e3, 1e3, engine), 1.0}, std::pow(10.0, uniform_between(-6, 6, engine)));
    const auto fix = range_fix(sky, kNominalCn0, known, p);
    if (!fix) continue;
    ++solved;
    ASSERT_TRUE(is_sound(*fix)) << round;
    if (p.range_sigma > 1e-3) {
      EXPECT_LE(std::sqrt(fix->covariance.diagonal().maxCoeff()), 100.1) << round;
    }
    EXPECT_EQ(fix->covariance(0, 1), fix->covariance(1, 0)) << round;
    if (kind == 1 && p.range_sigma > 1e-3) {
      EXPECT_NEAR(std::sqrt(fix->covariance(0, 0)), 100.0, 1.0) << round;
    }
  }
  EXPECT_GT(solved, 700);
}

TEST(RangeFix, ParametersAreChecked) {
  const auto faults_of = [](const std::string& yaml) {
    const YAML::Node map = YAML::Load(yaml);
    ParameterReader reader(map);
    RangeFixParameters p;
    reader.read(p);
    return reader.finish().size();
  };
  EXPECT_EQ(faults_of("{}"), 0u);
  EXPECT_EQ(faults_of("{range_sigma: 2.0, range_sigma_min: 2.0, range_sigma_max: 2.0}"), 0u);
  EXPECT_EQ(faults_of("{range_sigma: 0.5}"), 1u);
  EXPECT_EQ(faults_of("{range_sigma: 8.5}"), 1u);
  EXPECT_EQ(faults_of("{range_sigma_min: 6.0, range_sigma_max: 5.5}"), 1u);
  EXPECT_GT(faults_of("{range_sigma: .nan}"), 0u);
  EXPECT_EQ(faults_of("{range_bias_odds: 0.0, range_height_sigma: -1.0, nlos_cn0_width: 0.0}"), 3u);
  RangeFixParameters p;
  p.range_sigma_min = 2.0;
  p.range_sigma_max = 8.0;
  EXPECT_DOUBLE_EQ(p.middle_range_sigma_m(), 4.0);
}

}  // namespace
}  // namespace urban_gnss
