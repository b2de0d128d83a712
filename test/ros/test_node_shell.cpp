#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <ros/time.h>

#include <limits>
#include <stdexcept>

#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/node_shell.hpp"
#include "urban_gnss_localization/ros/sensor_frames.hpp"

namespace urban_gnss {
namespace {

using testing::HasSubstr;

const ros::Time kNow(1.8e9);
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct Diagnosis : diagnostic_updater::DiagnosticStatusWrapper {
  explicit Diagnosis(const NodeShell& shell) {
    summary(diagnostic_msgs::DiagnosticStatus::OK, "tracking");
    shell.diagnose(*this);
  }
  std::string value(const std::string& key) const {
    for (const auto& each : values) {
      if (each.key == key) return each.value;
    }
    return "none of this name";
  }
};

TEST(StampCheck, TakesWhatAClockCanSay) {
  StampCheck check;
  for (const double time : {0.0, 100.0, 1.5e9, 1.8e9, 1.8e9 + 18.0, 1.8e9 + 3599.0}) {
    EXPECT_EQ(check.fault("odom", ros::Time(time), kNow), "") << time;
  }
}

TEST(StampCheck, RefusesWhatIsNoTime) {
  StampCheck check;
  for (int i = 0; i < 20; ++i) {
    EXPECT_THAT(check.fault("odom", ros::Time(4294967295U, 0), kNow), HasSubstr("is no time"));
    ros::Time time(1000.0);
    time.nsec = 4294967295U;
    EXPECT_THAT(check.fault("odom", time, kNow), HasSubstr("is no time"));
  }
}

TEST(StampCheck, OneStampOfTheFutureIsNoneAndAClockThatIsAheadIsFollowed) {
  StampCheck check;
  for (int i = 0; i < 20; ++i) {
    EXPECT_THAT(check.fault("odom", kNow + ros::Duration(7200.0 + i), kNow), HasSubstr("2.0 h ahead"));
    EXPECT_EQ(check.fault("odom", kNow + ros::Duration(i), kNow), "");
  }
  int refused = 0;
  for (int i = 0; i < 20; ++i) {
    refused += check.fault("odom", kNow + ros::Duration(7200.0 + i), kNow).empty() ? 0 : 1;
    EXPECT_EQ(check.fault("imu", kNow, kNow), "") << "another topic";
  }
  EXPECT_EQ(refused, 4);
  refused = 0;
  for (int i = 0; i < 20; ++i) refused += check.fault("fix", ros::Time(1.8e9 + i), ros::Time()).empty() ? 0 : 1;
  EXPECT_EQ(refused, 0) << "a simulated clock that nobody drives";
}

TEST(NodeShell, NothingThatIsThrownEscapesAndItIsCounted) {
  EventLog log;
  NodeShell shell(log);
  EXPECT_EQ(Diagnosis(shell).level, diagnostic_msgs::DiagnosticStatus::OK);
  EXPECT_TRUE(shell.run("odom", [] {}));
  EXPECT_FALSE(shell.run("odom", [] { throw std::runtime_error("of no use"); }));
  EXPECT_FALSE(shell.run("odom", [] { throw 7; }));
  const Diagnosis diagnosis(shell);
  EXPECT_EQ(diagnosis.level, diagnostic_msgs::DiagnosticStatus::ERROR);
  EXPECT_EQ(diagnosis.value("callbacks that failed"), "2");
  EXPECT_EQ(diagnosis.value("last error"), "odom failed: an exception of unknown type");
}

TEST(SensorFrames, AFixWithoutFrameDoesNotForgetTheAntennas) {
  SensorFrames frames(Frames{}, true, Eigen::Vector2d::Zero());
  frames.observe_fix("gps");
  for (int i = 0; i < 100; ++i) frames.observe_fix("");
  EXPECT_TRUE(frames.take_events().empty());
  EXPECT_FALSE(frames.is_complete());
  frames.complain();
  const auto events = frames.take_events();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_THAT(events.front().text, HasSubstr("to the fix's frame gps"));
}

TEST(NodeShell, WhatIsNoEstimateDoesNotGoOut) {
  EventLog log;
  NodeShell shell(log);
  LocalizationOutput output;
  output.estimate.covariance.setIdentity();
  EXPECT_TRUE(shell.lets_out("odometry/filtered", to_message(output, Frames{})));
  for (int entry = 0; entry < 9; ++entry) {
    LocalizationOutput bad = output;
    bad.estimate.covariance(entry / 3, entry % 3) = entry % 2 == 0 ? -2.0 : kNaN;
    EXPECT_FALSE(shell.lets_out("odometry/filtered", to_message(bad, Frames{}))) << entry;
  }
  LocalizationOutput moving = output;
  moving.twist.yaw_rate_radps = kNaN;
  EXPECT_FALSE(shell.lets_out("odometry/filtered", to_message(moving, Frames{})));
  LocalizationOutput lost = output;
  lost.estimate.pose.yaw = kNaN;
  EXPECT_FALSE(shell.lets_out("tf", to_map_to_odom(lost.estimate.pose, lost.stamp, Frames{}, 0.0)));
  BiasEstimate bias;
  EXPECT_TRUE(shell.lets_out("gps/bias", to_message(bias, "map")));
  bias.radius_m = kNaN;
  EXPECT_FALSE(shell.lets_out("gps/bias", to_message(bias, "map")));
  const Diagnosis diagnosis(shell);
  EXPECT_EQ(diagnosis.level, diagnostic_msgs::DiagnosticStatus::ERROR);
  EXPECT_EQ(diagnosis.value("messages not published"), "12");
}

TEST(MessageFaults, APoseThatIsToldHasAQuaternionAndACovariance) {
  geometry_msgs::PoseWithCovariance good;
  good.pose.orientation.w = 1.0;
  good.covariance[0] = good.covariance[7] = good.covariance[35] = 0.25;
  EXPECT_EQ(message_fault(good), "");
  geometry_msgs::PoseWithCovariance pose = good;
  pose.pose.orientation.w = 0.0;
  EXPECT_THAT(message_fault(pose), HasSubstr("orientation is 0"));
  pose.pose.orientation.w = 7.0;
  EXPECT_THAT(message_fault(pose), HasSubstr("orientation has length 7"));
  for (std::size_t entry = 0; entry < 36; ++entry) {
    for (const double bad : {kNaN, -1.0, std::numeric_limits<double>::infinity()}) {
      pose = good;
      pose.covariance[entry] = bad;
      EXPECT_NE(message_fault(pose), "") << entry << ' ' << bad;
    }
  }
}

TEST(EventLog, LinesAreWrittenWhileTheSimulatedClockStands) {
  ros::Time::setNow(ros::Time());  // what use_sim_time without /clock gives
  testing::internal::CaptureStderr();
  EventLog log;
  log.warn("waiting for the clock");
  log.warn("waiting for the clock");
  const std::string said = testing::internal::GetCapturedStderr();
  ros::Time::init();
  const std::size_t first = said.find("waiting for the clock");
  ASSERT_NE(first, std::string::npos) << said;
  EXPECT_EQ(said.find("waiting for the clock", first + 1), std::string::npos) << "throttled: " << said;
}

TEST(EventLog, LinesAreShortAndHaveNoControlCharacters) {
  EXPECT_EQ(log_line("a plain line"), "a plain line");
  EXPECT_EQ(log_line("two\nlines\x1b[31m"), "two?lines?[31m");
  const std::string line = log_line(std::string(1000000, 'a'));
  EXPECT_LT(line.size(), 230u);
  EXPECT_THAT(line, HasSubstr("... (999800 more)"));
}

}  // namespace
}  // namespace urban_gnss
