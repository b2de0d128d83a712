#include <gtest/gtest.h>

#include "urban_gnss_localization/ros/visibility_messages.hpp"

namespace urban_gnss {
namespace {

/// 4 columns and 2 rows.
sensor_msgs::PointCloud2 organised() {
  PointCloud points;
  for (int i = 0; i < 8; ++i) points.emplace_back(static_cast<float>(i), 2.0F, 3.0F);
  sensor_msgs::PointCloud2 message = to_message(points, ros::Time(1.0), "lidar");
  message.height = 2;
  message.width = 4;
  message.row_step = 4 * message.point_step;
  return message;
}

TEST(PointCloudMessage, AWrongRowStepIsDerivedWhereThereAreNoGaps) {
  for (const std::uint32_t row_step : {0U, 1U, organised().row_step, 2U * organised().row_step, 4294967295U}) {
    sensor_msgs::PointCloud2 message = organised();
    message.row_step = row_step;
    const PointCloud points = to_point_cloud(message);
    ASSERT_EQ(points.size(), 8u) << row_step;
    EXPECT_EQ(points[5].x(), 5.0F) << row_step;
  }
}

TEST(PointCloudMessage, LessDataThanIsSaidIsRefused) {
  sensor_msgs::PointCloud2 cut = organised();
  cut.data.resize(cut.data.size() - 1);
  EXPECT_THROW(to_point_cloud(cut), std::invalid_argument);
  sensor_msgs::PointCloud2 huge = organised();
  huge.width = huge.height = 4294967295U;
  EXPECT_THROW(to_point_cloud(huge), std::invalid_argument);
  sensor_msgs::PointCloud2 step = organised();
  step.point_step = 4294967295U;
  EXPECT_THROW(to_point_cloud(step), std::invalid_argument);
}

}  // namespace
}  // namespace urban_gnss
