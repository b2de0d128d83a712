#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tf2/buffer_core.h>

#include "pipeline_rig.hpp"
#include "urban_gnss_localization/ros/sensor_frames.hpp"

namespace urban_gnss {
namespace {

using testing::HasSubstr;

/// A node that hears of an antenna in its own frame.
struct Node {
  Node() { frames.observe_fix("antenna"); }

  void put_antenna_at(double x, double y) {
    const geometry_msgs::TransformStamped place = to_transform({x, y, 0.0}, ros::Time(1.0), "base_link", "antenna");
    tf.setTransform(place, "test", true);
  }
  std::vector<std::string> said() {
    std::vector<std::string> texts;
    for (const PipelineEvent& event : frames.take_events()) texts.push_back(event.text);
    return texts;
  }

  tf2::BufferCore tf;
  Rig rig{kGiven};
  SensorFrames frames{Frames{}, true};
};

TEST(SensorFrames, TheLeverArmOfTheAntennaComesFromTf) {
  Node node;
  node.put_antenna_at(1.5, -0.25);
  EXPECT_FALSE(node.frames.is_complete());
  node.frames.look_up(node.tf, node.rig.pipeline);
  EXPECT_TRUE(node.frames.is_complete());
  EXPECT_THAT(node.said(), testing::ElementsAre(HasSubstr("antenna at x 1.5 m, y -0.25 m")));
  node.rig.run(0.0, 2.0);
  ASSERT_FALSE(node.rig.fake->fixes.empty());
  EXPECT_NEAR(node.rig.fake->fixes.front().antenna_in_body.x(), 1.5, 1e-6);
  EXPECT_NEAR(node.rig.fake->fixes.front().antenna_in_body.y(), -0.25, 1e-6);
}

TEST(SensorFrames, AMissingOneIsSaidOnce) {
  Node node;
  for (int second = 0; second < 5; ++second) {
    node.frames.observe_fix("antenna");
    node.frames.look_up(node.tf, node.rig.pipeline);
    node.frames.complain();
  }
  EXPECT_THAT(node.said(), testing::ElementsAre(HasSubstr("no tf from base_link to the fix's frame antenna")));
  node.put_antenna_at(1.0, 0.0);
  node.frames.look_up(node.tf, node.rig.pipeline);
  EXPECT_THAT(node.said(), testing::ElementsAre(HasSubstr("antenna at x 1 m")));
}

}  // namespace
}  // namespace urban_gnss
