#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>

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

TEST(EllipseMarker, IsWhereThePositionIsWith95Percent) {
  urban_gnss::PoseEstimate estimate;
  estimate.pose = {10.0, -20.0, 0.7};
  estimate.covariance.topLeftCorner<2, 2>() << 9.0, 3.0, 3.0, 4.0;
  const Marker marker = urban_gnss::ellipse_marker(estimate, {1.0F, 0.0F, 0.0F, 1.0F}, 2, ros::Time(5.0), "map");
  EXPECT_EQ(marker.id, 2);
  EXPECT_EQ(marker.header.frame_id, "map");
  ASSERT_GT(marker.points.size(), 20U);
  const Eigen::Matrix2d information = estimate.covariance.topLeftCorner<2, 2>().inverse();
  double largest_m = 0.0;
  for (const geometry_msgs::Point& point : marker.points) {
    const Eigen::Vector2d offset(point.x - 10.0, point.y + 20.0);
    EXPECT_NEAR(offset.dot(information * offset), 5.99, 0.01);
    largest_m = std::max(largest_m, offset.norm());
  }
  EXPECT_NEAR(largest_m, 7.90, 0.03) << "2.448 times the root of the larger eigenvalue, 10.41 m^2";
  EXPECT_NEAR(marker.points.front().x, marker.points.back().x, 1e-9) << "closed";
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
