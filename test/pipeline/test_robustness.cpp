#include <gmock/gmock.h>

#include "pipeline_rig.hpp"
#include "urban_gnss_localization/geometry/pose_faults.hpp"

namespace urban_gnss {
namespace {

TEST(Robustness, ADatumThatWasFoundSurvivesAReset) {
  Rig rig("{}");
  rig.run(0.0, 20.0);
  ASSERT_TRUE(rig.pipeline.frame());
  const GeodeticPosition datum = rig.pipeline.frame()->datum();
  rig.run(0.0, 1.0);
  EXPECT_TRUE(has_event(rig.pipeline, PipelineEvent::Level::kWarn, "jumped back"));
  ASSERT_TRUE(rig.pipeline.frame());
  EXPECT_EQ(rig.pipeline.frame()->datum(), datum);
  rig.pipeline.reset("requested");
  ASSERT_TRUE(rig.pipeline.frame());
  EXPECT_EQ(rig.pipeline.frame()->datum(), datum);
}

TEST(Robustness, OneOddMessageOfAnyStreamNeverResets) {
  for (const double odd : {-1e3, -3.0, -1.5, 2.5, 9.0, 11.0, 3600.0, 1e9}) {
    for (int stream = 0; stream < 4; ++stream) {
      Rig rig(kGiven);
      const auto run = [&](int from, int to) {
        for (int k = from; k <= to; ++k) {
          rig.pipeline.add_imu_yaw_rate(Rig::at(0.1 * k), Rig::kTwist.yaw_rate_radps);
          if (k % 10 == 0) rig.fix(0.1 * k);
          if (k % 10 == 0) rig.pipeline.add_velocity(Rig::velocity(0.1 * k));
          rig.drive(0.1 * k);
        }
      };
      run(0, 200);
      const double time = 20.0 + odd;
      if (stream == 0) rig.drive(time);
      if (stream == 1) rig.fix(time);
      if (stream == 2) rig.pipeline.add_velocity(Rig::velocity(time));
      if (stream == 3) rig.pipeline.add_imu_yaw_rate(Rig::at(time), 1.0);
      run(201, 400);
      EXPECT_EQ(rig.fake->starts.size(), 1u) << odd << ' ' << stream;
      EXPECT_EQ(rig.pipeline.take_outputs().size(), 401u) << odd << ' ' << stream;
      EXPECT_EQ(rig.fake->fixes.size(), 41u) << odd << ' ' << stream;
      EXPECT_EQ(rig.pipeline.take_outcomes().size(), stream == 1 ? 42u : 41u) << "each fix has its decision: " << odd;
      EXPECT_EQ(rig.fake->velocities.size(), 41u) << odd << ' ' << stream;
      EXPECT_LT((rig.fake->state.pose.position() - Rig::truth(40.0).position()).norm(), 1e-6);
      EXPECT_FALSE(has_event(rig.pipeline, PipelineEvent::Level::kWarn, "reset"));
    }
  }
}

TEST(Robustness, AfterAPauseOfAllStreamsTheFirstMessagesAreHeldAndNoneIsLost) {
  Rig rig(kGiven);
  rig.run(0.0, 20.0);
  rig.pipeline.take_outcomes();
  rig.fix(50.0);
  for (int k = 500; k <= 501; ++k) rig.drive(0.1 * k);
  EXPECT_EQ(*rig.pipeline.latest_odometry(), Rig::at(20.0)) << "two may be wrong";
  rig.drive(50.2);
  EXPECT_EQ(*rig.pipeline.latest_odometry(), Rig::at(50.2));
  rig.run(50.3, 60.0);
  EXPECT_EQ(*rig.pipeline.latest_odometry(), Rig::at(60.0));
  EXPECT_EQ(rig.pipeline.take_outcomes().size(), 11u) << "each fix has its decision";
  EXPECT_EQ(rig.pipeline.odd_stamps(), 0u);
}

TEST(Robustness, RefusesAPoseThatIsNone) {
  const auto refusal = [](const PoseEstimate& pose) -> std::string {
    Rig rig(kGiven);
    rig.run(0.0, 5.0);
    const PoseEstimate before = rig.fake->state;
    try {
      rig.pipeline.set_pose(pose);
    } catch (const std::invalid_argument& error) {
      EXPECT_EQ(rig.fake->state.pose, before.pose);
      return error.what();
    }
    return {};
  };
  const PoseEstimate good{{1.0, 2.0, 0.5}, Eigen::Vector3d(0.25, 0.25, 0.07).asDiagonal()};
  EXPECT_EQ(refusal(good), "");
  for (const double bad : {kNaN, kInfinity, 1e300, -1e9}) {
    PoseEstimate pose = good;
    pose.pose.y = bad;
    EXPECT_THAT(refusal(pose), testing::StartsWith("y = ")) << bad;
  }
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      for (const double bad : {kNaN, kInfinity, -kInfinity, -1.0, 3.0, 1e300}) {
        PoseEstimate pose = good;
        pose.covariance(row, column) = bad;
        const bool is_large_variance = row == column && bad > 0.0 && std::isfinite(bad);
        EXPECT_EQ(refusal(pose).empty(), is_large_variance) << row << column << ' ' << bad << ' ' << refusal(pose);
      }
    }
  }
  PoseEstimate correlated = good;
  correlated.covariance(0, 1) = correlated.covariance(1, 0) = 1.0;
  EXPECT_THAT(refusal(correlated), testing::HasSubstr("covariance of y and x = 1: their variances are 0.25 and 0.25"));
}

TEST(Robustness, WhatIsSetIsTakenWithinBounds) {
  Rig rig("{datum: [33.0, 130.0, 20.0], initial_position_sigma: 3.0, initial_heading_sigma: 0.4}");
  rig.drive(0.0);
  rig.pipeline.set_pose({{1.0, 2.0, 0.5}, Eigen::Vector3d(0.0, 4.0, 0.0).asDiagonal()});
  EXPECT_LT((rig.fake->state.covariance.diagonal() - Eigen::Vector3d(9.0, 4.0, 0.16)).norm(), 1e-12) << "0: unknown";
  rig.pipeline.set_pose({{1.0, 2.0, 0.5}, Eigen::Vector3d(1e300, 4.0, 1e6).asDiagonal()});
  EXPECT_LE(rig.fake->state.covariance(0, 0), 1.001e10);
  EXPECT_NEAR(rig.fake->state.covariance(2, 2), kPi * kPi / 3.0, 1e-9);
}

TEST(Robustness, AStateThatIsNoneIsNeverPublishedAndStartsAnew) {
  for (const double bad : {kNaN, kInfinity, -1.0}) {
    for (int entry = 0; entry < 9; ++entry) {
      Rig rig(kGiven);
      rig.run(0.0, 5.0);
      rig.fake->state.covariance(entry / 3, entry % 3) = bad;
      rig.pipeline.take_outputs();
      rig.run(5.1, 20.0);
      EXPECT_EQ(rig.pipeline.broken_states(), 1u) << entry << ' ' << bad;
      EXPECT_TRUE(has_event(rig.pipeline, PipelineEvent::Level::kError, "the estimate is none"));
      const auto outputs = rig.pipeline.take_outputs();
      EXPECT_GT(outputs.size(), 20u) << "started anew from the fixes";
      for (const LocalizationOutput& each : outputs) EXPECT_EQ(estimate_fault(each.estimate), "");
    }
  }
}

}  // namespace
}  // namespace urban_gnss
