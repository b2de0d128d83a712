#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "range_rig.hpp"
#include "urban_gnss_localization/gnss/residual_check.hpp"

namespace urban_gnss {
namespace {

using Weight = std::function<double(const SatelliteObservation&)>;

double equal_weight(const SatelliteObservation&) { return 1.0; }
double by_elevation(const SatelliteObservation& s) { return std::pow(std::sin(s.look.elevation_rad), 2); }
double by_cn0(const SatelliteObservation& s) { return std::pow(10.0, s.cn0_dbhz / 10.0); }

/// A sky with noise of 5 m, and one range of 30 m, on the ranges.
Sky noisy(RandomEngine& engine) {
  Sky sky = two_constellations();
  for (SatelliteObservation& each : sky) {
    each.cn0_dbhz = uniform_between(25.0, 48.0, engine);
    each.residual_m = 5.0 * draw_normal(engine);
  }
  sky[1].residual_m += 30.0;
  return sky;
}

Sky solved(const Sky& sky, const Weight& weight) { return at_solution(sky, weight).first; }

/// As the same ranges say them at a place `east_m` beside.
Sky seen_from_beside(Sky sky, double east_m) {
  for (SatelliteObservation& each : sky) each.residual_m += east_m * line_of_sight(each.look).x();
  return sky;
}

TEST(ResidualMisfit, IsNothingAtALeastSquaresSolutionWhateverItsWeights) {
  RandomEngine engine = make_engine(301);
  for (const Weight& weight : {Weight(equal_weight), Weight(by_elevation), Weight(by_cn0),
                               Weight([](const auto& s) { return by_elevation(s) * by_cn0(s); })}) {
    const auto misfit = residual_misfit(solved(noisy(engine), weight));
    ASSERT_TRUE(misfit);
    EXPECT_LT(*misfit, 1e-9);
  }
}

TEST(ResidualMisfit, IsLargeAtAnotherPlace) {
  RandomEngine engine = make_engine(302);
  const Sky sky = solved(noisy(engine), by_elevation);
  EXPECT_GT(residual_misfit(seen_from_beside(sky, 15.0)).value(), 0.5);
}

TEST(ResidualMisfit, SaysNothingOfTooFewRanges) {
  RandomEngine engine = make_engine(303);
  Sky sky = solved(noisy(engine), equal_weight);
  sky.resize(5);  // and four unknowns
  EXPECT_FALSE(residual_misfit(sky));
  EXPECT_FALSE(residual_misfit({}));
}

TEST(ResidualMisfit, LeavesOutWhatIsUnknown) {
  RandomEngine engine = make_engine(304);
  Sky sky = solved(noisy(engine), equal_weight);
  for (const double odd : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    Sky with_odd = sky;
    with_odd.push_back(satellite(31, 10.0, 20.0));
    with_odd.back().residual_m = odd;
    EXPECT_NEAR(*residual_misfit(with_odd), *residual_misfit(sky), 1e-12);
  }
}

TEST(ResidualMisfit, OfNoResidualAtAllIsNothing) {
  Sky sky = two_constellations();
  for (SatelliteObservation& each : sky) each.residual_m = 0.0;
  EXPECT_FALSE(residual_misfit(sky));
}

TEST(ResidualCheck, GoesByTheMedianOfTheLastEpochs) {
  RandomEngine engine = make_engine(305);
  ResidualCheck check{ResidualCheckParameters{}};
  const auto add = [&](int count, double east_m) {
    for (int k = 0; k < count; ++k) check.add(seen_from_beside(solved(noisy(engine), by_cn0), east_m));
    return check.belong();
  };
  EXPECT_TRUE(add(19, 60.0)) << "too few to judge";
  EXPECT_FALSE(add(1, 60.0));
  EXPECT_TRUE(add(21, 0.0));
  EXPECT_TRUE(add(39, 0.0));
  EXPECT_TRUE(add(29, 60.0));
  EXPECT_FALSE(add(2, 60.0));
}

TEST(ResidualCheck, DoesNotSwitchToAndFroAtTheLimit) {
  RandomEngine engine = make_engine(306);
  const Sky at_fix = solved(noisy(engine), by_cn0);
  const Sky near = seen_from_beside(at_fix, 15.0);
  const Sky far = seen_from_beside(at_fix, 100.0);
  ResidualCheckParameters parameters;
  parameters.residual_misfit_limit = residual_misfit(near).value() / 0.8;
  ASSERT_LT(parameters.residual_misfit_limit, residual_misfit(far).value());
  ResidualCheck check{parameters};
  const auto belong_after = [&](const Sky& sky) {
    for (int k = 0; k < 60; ++k) check.add(sky);
    return check.belong();
  };
  EXPECT_TRUE(belong_after(near));
  EXPECT_FALSE(belong_after(far));
  EXPECT_FALSE(belong_after(near)) << "below the limit, but not far enough to be believed again";
  EXPECT_TRUE(belong_after(at_fix));
  EXPECT_TRUE(belong_after(near));
}

}  // namespace
}  // namespace urban_gnss
