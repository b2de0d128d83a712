#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "satellite_sky.hpp"
#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/gnss/cn0_curve.hpp"
#include "urban_gnss_localization/gnss/dilution_of_precision.hpp"
#include "urban_gnss_localization/gnss/stationary_part.hpp"
#include "urban_gnss_localization/gnss/ure_calibration.hpp"

namespace urban_gnss {
namespace {

/// Fixes by least squares of ranges with errors of `sigma_m`, which follow a first-order process of `lasting_s`.
std::vector<StationaryFix> recording(double sigma_m, int count, double lasting_s, double interval_s, std::uint64_t seed,
                                     bool with_residuals = true) {
  RandomEngine engine = make_engine(seed);
  const auto sky = open_sky();
  Eigen::MatrixXd h = Eigen::MatrixXd::Ones(static_cast<Eigen::Index>(sky.size()), 4);  // place and clock
  for (std::size_t i = 0; i < sky.size(); ++i) {
    h.row(static_cast<Eigen::Index>(i)).head<3>() = -line_of_sight(sky[i].look);
  }
  Eigen::VectorXd errors(h.rows());
  for (Eigen::Index i = 0; i < errors.size(); ++i) errors[i] = sigma_m * draw_normal(engine);
  const double kept = lasting_s > 0.0 ? std::exp(-interval_s / lasting_s) : 0.0;
  std::vector<StationaryFix> fixes;
  for (int k = 0; k < count; ++k) {
    for (Eigen::Index i = 0; i < errors.size(); ++i) {
      errors[i] = kept * errors[i] + std::sqrt(1.0 - kept * kept) * sigma_m * draw_normal(engine);
    }
    const Eigen::VectorXd solution = (h.transpose() * h).ldlt().solve(h.transpose() * errors);
    const Eigen::VectorXd residuals = errors - h * solution;
    StationaryFix fix;
    fix.stamp = from_seconds(100.0 + interval_s * k);
    fix.position = Eigen::Vector2d(12.0, -7.0) + solution.head<2>();
    fix.satellites = open_sky();
    for (Eigen::Index i = 0; with_residuals && i < residuals.size(); ++i) {
      fix.satellites[static_cast<std::size_t>(i)].residual_m = residuals[i];
    }
    fixes.push_back(fix);
  }
  return fixes;
}

std::string refusal(const std::vector<StationaryFix>& fixes, const UreCalibrationSettings& settings = {}) {
  try {
    calibrate_ure(fixes, settings);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

TEST(UreCalibration, FixesAndResidualsTellTheSigmaOfTheRanges) {
  for (const double sigma : {0.5, 3.75}) {
    const UreCalibration found = calibrate_ure(recording(sigma, 4000, 0.0, 1.0, 3), {});
    EXPECT_NEAR(found.sigma_m / sigma, 1.0, 4.5 * 0.5 / std::sqrt(4000.0));
    EXPECT_NEAR(*found.residual_sigma_m / sigma, 1.0, 4.5 / std::sqrt(2.0 * 5.0 * 4000.0));
    EXPECT_EQ(found.fixes, 4000u);
  }
}

TEST(UreCalibration, ErrorsThatLastCountForLess) {
  double squares = 0.0;
  constexpr int kRuns = 60;
  for (int seed = 0; seed < kRuns; ++seed) {
    const UreCalibration found = calibrate_ure(recording(3.0, 600, 20.0, 1.0, 100 + seed), {});
    squares += found.sigma_m * found.sigma_m / kRuns;
    EXPECT_LT(found.independent_errors, 150.0);
    EXPECT_GT(found.relative_error, 0.04);
  }
  EXPECT_NEAR(std::sqrt(squares), 3.0, 0.3) << "the mean place takes out a part of them, which is put back";
}

TEST(UreCalibration, KnownPlaceShowsWhatTheFixesShare) {
  std::vector<StationaryFix> fixes = recording(1.0, 300, 0.0, 1.0, 5, false);
  for (StationaryFix& fix : fixes) fix.position.x() += 10.0;
  UreCalibrationSettings settings;
  EXPECT_NEAR(calibrate_ure(fixes, settings).sigma_m, 1.0, 0.2);
  settings.place = Eigen::Vector2d(12.0, -7.0);
  EXPECT_GT(calibrate_ure(fixes, settings).sigma_m, 5.0);
  EXPECT_FALSE(calibrate_ure(fixes, settings).residual_sigma_m);
}

TEST(UreCalibration, SaysWhatIsMissing) {
  EXPECT_NE(refusal({}).find("no fix"), std::string::npos);
  auto fixes = recording(1.0, 20, 0.0, 1.0, 1);
  EXPECT_NE(refusal(fixes).find("20 of 20 fixes can be used, at least 30"), std::string::npos) << refusal(fixes);
  EXPECT_NE(refusal(recording(1e-4, 300, 0.0, 1.0, 1)).find("static hold"), std::string::npos);
  for (StationaryFix& fix : fixes) fix.satellites.resize(3);
  EXPECT_NE(refusal(fixes).find("directions of at least 4 satellites"), std::string::npos) << refusal(fixes);
  UreCalibrationSettings strict;
  strict.max_hdop = 0.1;
  EXPECT_NE(refusal(recording(1.0, 50, 0.0, 1.0, 1), strict).find("50 an HDOP above"), std::string::npos);
}

TEST(Cn0Curve, FindsLevelRiseAndScatterBesideBlockedSignals) {
  RandomEngine engine = make_engine(2);
  std::vector<SatelliteObservation> signals;
  for (int k = 0; k < 2000; ++k) {
    SatelliteObservation each = satellite(1 + k % 9, 10.0 * (k % 36), 5.0 + k % 80);
    each.cn0_dbhz = 44.0 + 8.0 * (std::sin(each.look.elevation_rad) - 0.6) + 1.5 * draw_normal(engine);
    if (k % 10 == 0) each.cn0_dbhz -= 15.0;
    signals.push_back(each);
  }
  const Cn0Curve curve = fit_cn0_curve(signals);
  EXPECT_NEAR(curve.level_dbhz, 44.0, 0.4);
  EXPECT_NEAR(curve.rise_db, 8.0, 0.8);
  EXPECT_NEAR(curve.scatter_db, 1.5, 0.3);
  EXPECT_NEAR(curve.weak_dbhz(), 44.0 - 2.33 * 1.5, 1.0);
  EXPECT_NEAR(curve.odds_width_db(), 1.5 / 2.33, 0.2);
  EXPECT_EQ(curve.bands.size(), 9u);
  EXPECT_LT(curve.bands.front().median_dbhz, curve.bands.back().median_dbhz);
}

TEST(Cn0Curve, OneElevationTellsNoRise) {
  std::vector<SatelliteObservation> signals;
  for (int k = 0; k < 200; ++k) {
    signals.push_back(satellite(1 + k % 5, 70.0 * (k % 5), 37.0));
    signals.back().cn0_dbhz = 42.0;
  }
  const Cn0Curve curve = fit_cn0_curve(signals);
  EXPECT_FALSE(curve.has_rise);
  EXPECT_NEAR(curve.level_dbhz, 42.0, 1e-6);
  signals.resize(50);
  EXPECT_THROW(fit_cn0_curve(signals), std::runtime_error);
}

std::vector<TimedPosition> places(double still_from, double still_to, double until, double speed) {
  std::vector<TimedPosition> fixes;
  RandomEngine engine = make_engine(4);
  double x = 0.0;
  for (double time = 0.0; time <= until; time += 1.0) {
    if (time < still_from || time > still_to) x += speed;
    fixes.push_back({from_seconds(time), {x + draw_normal(engine), draw_normal(engine)}});
  }
  return fixes;
}

TEST(StationaryPart, IsTheLongestTimeWithoutMotion) {
  const auto part = longest_stationary_part(places(100.0, 300.0, 400.0, 2.0), {});
  ASSERT_TRUE(part);
  EXPECT_NEAR(to_seconds(part->begin), 100.0, 6.0);
  EXPECT_NEAR(to_seconds(part->end), 300.0, 6.0);
  EXPECT_NEAR(longest_stationary_part(places(0.0, 1e9, 400.0, 2.0), {})->duration_s(), 400.0, 1e-9);
}

TEST(StationaryPart, SlowMotionIsSeenByVelocityAndDistance) {
  std::vector<RawVelocity> velocities;
  for (int k = 0; k <= 400; ++k) {
    velocities.push_back({});
    velocities.back().stamp = from_seconds(k);
    velocities.back().velocity = {k < 200 ? 0.5 : 0.02, 0.0};
  }
  EXPECT_NEAR(to_seconds(longest_stationary_part(places(200.0, 1e9, 400.0, 0.5), velocities)->begin), 200.0, 6.0);
  // 0.2 m/s, which no fix of 1 m sees from one to the next.
  EXPECT_LT(longest_stationary_part(places(1e9, 0.0, 400.0, 0.2), {})->duration_s(), 80.0);
  EXPECT_FALSE(longest_stationary_part({}, {}));
}

}  // namespace
}  // namespace urban_gnss
