#include <gtest/gtest.h>

#include <functional>

#include "pipeline_rig.hpp"
#include "urban_gnss_localization/pipeline/correction_slew.hpp"

namespace urban_gnss {
namespace {

constexpr double kStep_s = 0.1;
constexpr double kSpeed_mps = 0.5;

/// A robot on an arc, whose estimate is its odometry in another frame and a correction.
struct Drive {
  explicit Drive(double max_correction_speed) : slew(CorrectionSlewParameters{max_correction_speed}) {}

  /// The robot as tf has it after the next output.
  Pose2 step() {
    output.stamp += from_seconds(kStep_s);
    const Twist2 twist{2.0, 0.1};
    output.twist = twist;
    output.odometry_pose = move(output.odometry_pose, twist, kStep_s);
    output.estimate.pose = compose(map_to_odometry, output.odometry_pose);
    return compose(slew.follow(output), output.odometry_pose);
  }
  double behind_m() const { return (shown.position() - output.estimate.pose.position()).norm(); }

  CorrectionSlew slew;
  LocalizationOutput output;
  Pose2 map_to_odometry{5.0, -3.0, 1.0};
  Pose2 shown;
};

TEST(CorrectionSlew, IsOffUnlessItIsAskedFor) {
  Drive drive(CorrectionSlewParameters().max_correction_speed);
  drive.step();
  drive.map_to_odometry.x += 10.0;
  const Pose2 shown = drive.step();
  EXPECT_TRUE(near(shown, drive.output.estimate.pose, 1e-9));
  EXPECT_EQ(drive.slew.behind_m(), 0.0);
}

TEST(CorrectionSlew, ALargeCorrectionIsSpreadOverItsTime) {
  Drive drive(kSpeed_mps);
  drive.shown = drive.step();
  drive.map_to_odometry.x += 10.0;
  int steps = 0;
  for (; steps < 1000 && (steps == 0 || drive.slew.behind_m() > 0.0); ++steps) {
    const Pose2 expected = move(drive.shown, drive.output.twist, kStep_s);
    drive.shown = drive.step();
    EXPECT_LE((drive.shown.position() - expected.position()).norm(), kSpeed_mps * kStep_s + 1e-6);
    EXPECT_NEAR(drive.slew.behind_m(), drive.behind_m(), 1e-6);
  }
  EXPECT_NEAR(steps * kStep_s, 10.0 / kSpeed_mps, 2 * kStep_s);
  EXPECT_TRUE(near(drive.shown, drive.output.estimate.pose, 1e-9));
}

TEST(CorrectionSlew, ATurnIsSpreadToo) {
  Drive drive(kSpeed_mps);
  drive.shown = drive.step();
  // About the robot, which stays where it is.
  const Pose2 robot = drive.output.estimate.pose;
  drive.map_to_odometry = compose({robot.x, robot.y, robot.yaw + 1.0}, inverse(drive.output.odometry_pose));
  const double before = drive.shown.yaw;
  drive.shown = drive.step();
  EXPECT_NEAR(angle_difference(drive.shown.yaw, before + 0.1 * kStep_s), kSpeed_mps * kStep_s, 1e-3);
}

TEST(CorrectionSlew, ANewStartAResetOdometryAndAClockSetBackAreFollowedAtOnce) {
  const auto is_at_once = [](const std::function<void(Drive&)>& change) {
    Drive drive(kSpeed_mps);
    drive.step();
    drive.map_to_odometry.x += 10.0;
    change(drive);
    const Pose2 shown = drive.step();
    return near(shown, drive.output.estimate.pose, 1e-9) && drive.slew.behind_m() == 0.0;
  };
  EXPECT_FALSE(is_at_once([](Drive&) {}));
  EXPECT_TRUE(is_at_once([](Drive& drive) { ++drive.output.starts; }));
  EXPECT_TRUE(is_at_once([](Drive& drive) { drive.output.odometry_pose = {100.0, 0.0, 0.0}; }));
  EXPECT_TRUE(is_at_once([](Drive& drive) { drive.output.stamp -= from_seconds(1000.0); }));
}

TEST(CorrectionSlew, ThePipelineCountsStarts) {
  Rig rig(kGiven);
  rig.run(0.0, 1.0);
  const auto before = rig.pipeline.take_outputs();
  rig.pipeline.set_pose({{100.0, 0.0, 0.0}, Eigen::Matrix3d::Identity()});
  rig.run(1.1, 2.0);
  const auto after = rig.pipeline.take_outputs();
  EXPECT_EQ(before.front().starts, before.back().starts);
  EXPECT_EQ(after.back().starts, before.back().starts + 1);
}

}  // namespace
}  // namespace urban_gnss
