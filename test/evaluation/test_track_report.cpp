#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <string>

#include "urban_gnss_localization/evaluation/track_export.hpp"
#include "urban_gnss_localization/evaluation/track_report.hpp"

namespace {

using urban_gnss::DecidedFix;
using urban_gnss::FixDecision;
using urban_gnss::FixOutcome;
using urban_gnss::from_seconds;
using urban_gnss::LocalFrame;
using urban_gnss::Stamp;
using urban_gnss::TimedPose;
using urban_gnss::TrackReport;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
const Stamp kMaxGap = from_seconds(1.0);

DecidedFix decided(double t, FixDecision decision, double nis) {
  DecidedFix fix;
  fix.stamp = from_seconds(t);
  fix.place = {t, 1.0};
  fix.sigma_m = 2.0;
  fix.outcome = FixOutcome{fix.stamp, decision, nis, 9.0, 2, false, false, is_rejected(decision) ? "too <far>" : ""};
  return fix;
}

/// 1 m/s to the east for 10 s, 10 poses a second, without any from 4 s to 6 s; a fix each second, the fifth rejected.
TrackReport drive() {
  TrackReport report;
  report.name = "drive/odometry/filtered";
  report.map.emplace(urban_gnss::GeodeticPosition{48.0, 11.0, 500.0});
  for (int i = 0; i <= 100; ++i) {
    if (i > 40 && i < 60) continue;
    TimedPose pose;
    pose.stamp = from_seconds(0.1 * i);
    pose.pose = {0.1 * i, 0.0, 0.0};
    pose.covariance = Eigen::Vector3d(1.0, 9.0, 0.1).asDiagonal();
    report.estimate.push_back(pose);
    report.speeds_mps.push_back(i == 0 ? kNan : 1.0);
  }
  for (int t = 0; t <= 10; ++t) {
    const bool far = t == 5;
    report.fixes.push_back(decided(t, far ? FixDecision::kRejectedGate : FixDecision::kAccepted, far ? 20.0 : 1.0));
  }
  report.states = {{from_seconds(0.0), "initializing", false, "waiting"}, {from_seconds(2.5), "tracking", true, ""}};
  return report;
}

TEST(TrackReport, CountsWhatWasDecided) {
  const auto summary = summarize(drive(), kMaxGap);
  EXPECT_EQ(summary.estimates, 82U);
  EXPECT_DOUBLE_EQ(summary.duration_s, 10.0);
  EXPECT_NEAR(summary.distance_m, 8.0, 1e-9) << "the gap is not driven through";
  EXPECT_DOUBLE_EQ(summary.sigma_m.median, 3.0);
  EXPECT_DOUBLE_EQ(summary.speed_mps.mean, 1.0);
  ASSERT_EQ(summary.gaps.size(), 1U);
  EXPECT_EQ(summary.gaps[0].begin, from_seconds(4.0));
  EXPECT_EQ(summary.gaps[0].end, from_seconds(6.0));
  EXPECT_EQ(summary.decisions, (std::map<std::string, std::size_t>{{"accepted", 10}, {"rejected_gate", 1}}));
  EXPECT_DOUBLE_EQ(summary.nis.max, 20.0);
  EXPECT_DOUBLE_EQ(summary.nis_above_threshold, 1.0 / 11.0);
  EXPECT_TRUE(summary.gaps_of_fixes.empty()) << "2 s are less than three intervals";
  EXPECT_DOUBLE_EQ(summary.seconds_in_state.at("initializing"), 2.5);
  EXPECT_DOUBLE_EQ(summary.seconds_in_state.at("tracking"), 7.5);
  EXPECT_DOUBLE_EQ(summary.healthy_share, 0.75);
  EXPECT_EQ(summary.seconds_not_healthy, (std::map<std::string, double>{{"waiting", 2.5}}));
}

TEST(TrackReport, FindsWhereFixesWereNotUsed) {
  TrackReport report = drive();
  for (const int i : {4, 6}) report.fixes[i].outcome->decision = FixDecision::kRejectedGate;
  const auto gaps = summarize(report, kMaxGap).gaps_of_fixes;
  ASSERT_EQ(gaps.size(), 1U);
  EXPECT_EQ(gaps[0].begin, from_seconds(3.0));
  EXPECT_EQ(gaps[0].end, from_seconds(7.0));
}

TEST(TrackReport, NothingIsKnownOfNothing) {
  const auto summary = summarize(TrackReport(), kMaxGap);
  EXPECT_EQ(summary.estimates, 0U);
  EXPECT_TRUE(std::isnan(summary.sigma_m.median));
  EXPECT_TRUE(std::isnan(summary.healthy_share));
  const auto json = to_json(TrackReport(), summary, 10);
  EXPECT_TRUE(json["estimate"]["t"].empty());
  EXPECT_EQ(json.count("datum"), 0U);
  EXPECT_TRUE(to_json(summary)["nis"]["median"].is_null());
}

TEST(TrackReport, ThePageGetsColumnsOfOneLength) {
  const TrackReport report = drive();
  const auto json = to_json(report, summarize(report, kMaxGap), 30);
  EXPECT_EQ(json["estimate"]["t"].size(), 28U) << "every third of 82";
  for (const char* name : {"x", "y", "xx", "xy", "yy", "sigma", "speed"}) {
    EXPECT_EQ(json["estimate"][name].size(), 28U) << name;
  }
  EXPECT_DOUBLE_EQ(json["estimate"]["t"][1].get<double>(), 0.3);
  EXPECT_TRUE(json["estimate"]["speed"][0].is_null());
  EXPECT_EQ(json["fixes"]["decision"][5], "rejected_gate");
  EXPECT_EQ(json["fixes"]["reason"][5], "too <far>");
  EXPECT_EQ(json["gaps"], nlohmann::json({{4.0, 6.0}}));
  EXPECT_EQ(json["datum"], nlohmann::json({48.0, 11.0, 500.0}));
}

TEST(TrackExport, Utc) {
  EXPECT_EQ(urban_gnss::utc_text(Stamp(0)), "1970-01-01T00:00:00.000Z");
  EXPECT_EQ(urban_gnss::utc_text(Stamp(1621217463250999999)), "2021-05-17T02:11:03.250Z");
  EXPECT_EQ(urban_gnss::utc_text(Stamp(-1)), "1969-12-31T23:59:59.999Z");
}

TEST(TrackExport, GeoJson) {
  std::ostringstream out;
  urban_gnss::write_geojson(out, {drive()}, kMaxGap);
  const auto json = nlohmann::json::parse(out.str());
  EXPECT_EQ(json["type"], "FeatureCollection");
  ASSERT_EQ(json["features"].size(), 12U) << "an estimate and eleven fixes";
  const auto& line = json["features"][0];
  EXPECT_EQ(line["geometry"]["type"], "MultiLineString");
  ASSERT_EQ(line["geometry"]["coordinates"].size(), 2U) << "the gap is not bridged";
  EXPECT_EQ(line["geometry"]["coordinates"][0].size(), 21U) << "0.2 s apart";
  const auto first = line["geometry"]["coordinates"][0][0];
  EXPECT_NEAR(first[0].get<double>(), 11.0, 1e-9) << "longitude first";
  EXPECT_NEAR(first[1].get<double>(), 48.0, 1e-9);
  const auto& fix = json["features"][6];
  EXPECT_EQ(fix["properties"]["decision"], "rejected_gate");
  EXPECT_EQ(fix["properties"]["reason"], "too <far>");
  // 5 m east and 1 m north, by the radii of the ellipsoid at 48 degrees: 6389911 m and 6370784 m, 500 m up.
  EXPECT_NEAR(fix["geometry"]["coordinates"][0].get<double>() - 11.0, 5.0 / 6390411.0 / std::cos(0.8377580) * 57.29578,
              1e-9);
  EXPECT_NEAR(fix["geometry"]["coordinates"][1].get<double>() - 48.0, 1.0 / 6371284.0 * 57.29578, 2e-8);
}

TEST(TrackExport, KmlAndGpx) {
  TrackReport report = drive();
  report.name = "a & b/odometry/filtered";
  report.truth = report.estimate;
  std::ostringstream kml;
  urban_gnss::write_kml(kml, {report}, kMaxGap);
  EXPECT_NE(kml.str().find("<name>a &amp; b/odometry/filtered</name>"), std::string::npos);
  EXPECT_NE(kml.str().find("<description>rejected_gate: too &lt;far&gt;</description>"), std::string::npos);
  EXPECT_NE(kml.str().find("<coordinates>\n11.00000000,48.00000000\n"), std::string::npos);
  EXPECT_NE(kml.str().find("<when>1970-01-01T00:00:05.000Z</when></TimeStamp><styleUrl>#rejected"), std::string::npos);
  std::ostringstream gpx;
  urban_gnss::write_gpx(gpx, {report}, kMaxGap);
  for (const char* part : {"<name>a &amp; b/odometry/filtered</name>", ": fixes</name>", ": rejected fixes</name>",
                           ": truth</name>", "<trkpt lat=\"48.00000000\" lon=\"11.00000000\"><time>1970-01-01T"}) {
    EXPECT_NE(gpx.str().find(part), std::string::npos) << part;
  }
}

TEST(TrackExport, WithoutADatumThereIsNoPlace) {
  TrackReport report = drive();
  report.map.reset();
  std::ostringstream out;
  try {
    urban_gnss::write_kml(out, {report}, kMaxGap);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("drive/odometry/filtered: without a datum"), std::string::npos);
  }
}

}  // namespace
