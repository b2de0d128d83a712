#include <gtest/gtest.h>

#include "tracking_report.hpp"
#include "urban_gnss_localization/ros/markers.hpp"

namespace {

using urban_gnss::LocalizationReport;
using urban_gnss::LocalizationState;
using urban_gnss::status_marker;
using urban_gnss::tracking_report;
using visualization_msgs::Marker;

TEST(StatusMarker, GoesAlongWithTheRobotAndSaysHowItIs) {
  LocalizationReport report = tracking_report();
  const Marker marker = status_marker(report, "robot1/base_link");
  EXPECT_EQ(marker.type, Marker::TEXT_VIEW_FACING);
  EXPECT_EQ(marker.header.frame_id, "robot1/base_link");
  EXPECT_TRUE(marker.header.stamp.isZero()) << "rviz takes the newest tf";
  EXPECT_TRUE(marker.frame_locked);
  EXPECT_EQ(marker.text, "OK: 1.2 m, 34 of 35 fixes used");
  EXPECT_GT(marker.color.g, marker.color.r);
  EXPECT_NEAR(marker.scale.z, 1.0, 0.01);
  report.position_sigma_m = 0.02;
  EXPECT_NEAR(status_marker(report, "base_link").scale.z, 0.7, 1e-9) << "can be read";
}

TEST(StatusMarker, LongReasonsAreWrapped) {
  LocalizationReport report;
  report.state = LocalizationState::kLost;
  report.reason = "every fix is farther than max_bias_radius";
  const Marker marker = status_marker(report, "base_link");
  EXPECT_EQ(marker.text, "ERROR: every fix is farther than max_bias_radius;\n0 of 0 fixes used");
  EXPECT_GT(marker.color.r, marker.color.g);
}

}  // namespace
