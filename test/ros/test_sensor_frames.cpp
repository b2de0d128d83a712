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
  SensorFrames frames{Frames{}, true, Eigen::Vector2d::Zero()};
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

TEST(SensorFrames, AToldPlaceOfTheAntennaStaysAndOneThatIsElsewhereByTfIsSaidOnce) {
  Node node;
  node.put_antenna_at(1.0, 0.0);
  node.frames = SensorFrames(Frames{}, true, {0.3, 0.0});
  for (int k = 0; k < 3; ++k) {
    node.frames.observe_fix("antenna");
    node.frames.look_up(node.tf, node.rig.pipeline);
    node.frames.complain();
  }
  EXPECT_THAT(node.said(),
              testing::ElementsAre("antenna_offset is x 0.3 m, y 0 m, but by tf antenna is at x 1 m, y 0 m "
                                   "in base_link: antenna_offset is taken"));
  node.rig.run(0.0, 2.0);
  ASSERT_FALSE(node.rig.fake->fixes.empty());
  EXPECT_NEAR(node.rig.fake->fixes.front().antenna_in_body.x(), 0.0, 1e-6);  // the rig's parameter, not tf's
}

TEST(SensorFrames, AToldPlaceOfTheAntennaNeedsNoTf) {
  for (const bool has_tf : {false, true}) {
    Node node;
    if (has_tf) node.put_antenna_at(1.04, 0.0);  // within what a tape measure tells
    node.frames = SensorFrames(Frames{}, true, {1.0, 0.0});
    for (int k = 0; k < 20; ++k) node.frames.observe_fix(has_tf ? "antenna" : "");
    node.frames.look_up(node.tf, node.rig.pipeline);
    node.frames.complain();
    EXPECT_THAT(node.said(), testing::IsEmpty());
  }
}

TEST(SensorFrames, FramesOfTheOdometryThatAreOthersAreSaidOnce) {
  Node node;
  for (int k = 0; k < 3; ++k) node.frames.observe_odometry("wheel_odom", "base_footprint");
  EXPECT_THAT(node.said(),
              testing::ElementsAre(HasSubstr("header.frame_id is 'wheel_odom', odom_frame is 'odom'"),
                                   HasSubstr("child_frame_id is 'base_footprint', base_link_frame is 'base_link'")));
}

TEST(SensorFrames, ALeadingSlashIsNoOtherFrame) {
  Node node;
  node.frames.observe_odometry("/odom", "/base_link");
  EXPECT_THAT(node.said(), testing::IsEmpty());
  node.frames.observe_fix("/antenna");
  node.put_antenna_at(1.0, 0.0);
  node.frames.look_up(node.tf, node.rig.pipeline);
  EXPECT_THAT(node.said(), testing::ElementsAre(HasSubstr("antenna at x 1 m")));
}

TEST(SensorFrames, FixesWithoutAFrameAreSaidOnce) {
  SensorFrames frames{Frames{}, true, Eigen::Vector2d::Zero()};
  for (int k = 0; k < 20; ++k) frames.observe_fix("");
  const std::vector<PipelineEvent> events = frames.take_events();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_THAT(events[0].text, HasSubstr("fixes have no frame_id"));
}

}  // namespace
}  // namespace urban_gnss
