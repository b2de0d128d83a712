#include <gtest/gtest.h>

#include "tracking_report.hpp"
#include "urban_gnss_localization/pipeline/status_line.hpp"

namespace {

using urban_gnss::level_of;
using urban_gnss::LocalizationReport;
using urban_gnss::LocalizationState;
using urban_gnss::status_line;
using urban_gnss::StatusLevel;
using urban_gnss::tracking_report;

TEST(StatusLine, InAWord) {
  EXPECT_EQ(status_line(tracking_report()), "OK: 1.2 m, 34 of 35 fixes used");
  LocalizationReport report = tracking_report();
  report.position_sigma_m = 123.4;
  report.reason = "gps/fix declares HDOP^2";
  EXPECT_EQ(status_line(report), "OK: gps/fix declares HDOP^2; 123 m, 34 of 35 fixes used");
}

TEST(StatusLine, WhatIsWrongComesFirst) {
  LocalizationReport report = tracking_report();
  report.state = LocalizationState::kDeadReckoning;
  report.healthy = false;
  report.reason = "no fix was used for 12 s";
  EXPECT_EQ(status_line(report), "WARN: no fix was used for 12 s; 1.2 m, 34 of 35 fixes used");
  report.state = LocalizationState::kLost;
  report.reason = "every fix is farther than max_bias_radius";
  EXPECT_EQ(status_line(report), "ERROR: every fix is farther than max_bias_radius; 1.2 m, 34 of 35 fixes used");
  EXPECT_EQ(static_cast<int>(level_of(report)), 2) << "diagnostic_msgs/DiagnosticStatus ERROR";
}

TEST(StatusLine, WithoutAnEstimate) {
  LocalizationReport report;
  report.reason = "waiting for odometry";
  EXPECT_EQ(status_line(report), "WARN: waiting for odometry; 0 of 0 fixes used");
}

TEST(StatusLine, WhileItWaitsWithFixesItDoesNotSayThatThereAreNone) {
  LocalizationReport report;
  report.reason = "waiting for the datum";
  report.last_fix.stamp = urban_gnss::from_seconds(12.0);
  EXPECT_EQ(status_line(report), "WARN: waiting for the datum; fixes come, none was examined yet");
}

TEST(StatusLine, AGateThatFindsNothingIsAWarning) {
  LocalizationReport report = tracking_report();
  report.is_gate_inert = true;
  EXPECT_EQ(level_of(report), StatusLevel::kWarn);
}

}  // namespace
