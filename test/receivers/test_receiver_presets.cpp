#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "driver_messages.hpp"

namespace urban_gnss {
namespace {

using namespace driver;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

TEST(ReceiverPresets, AnUnknownNameListsThoseThatThereAre) {
  try {
    find_receiver_preset("ubox");
    FAIL();
  } catch (const std::invalid_argument& error) {
    for (const ReceiverPreset& preset : receiver_presets()) EXPECT_THAT(error.what(), HasSubstr(preset.name));
  }
}

TEST(ReceiverPresets, NamesOfTopicsAndTypes) {
  const ReceiverTopic& topic = find_receiver_preset("ublox").topics[0];
  EXPECT_EQ(full_name("", topic), "navpvt");
  EXPECT_EQ(full_name("/", topic), "/navpvt");
  EXPECT_EQ(full_name("earth_gps", topic), "earth_gps/navpvt");
  EXPECT_TRUE(is_type_of(topic, "ublox_msgs/NavPVT"));
  EXPECT_TRUE(is_type_of(topic, "other_msgs/NavPVT7"));
  EXPECT_FALSE(is_type_of(topic, "ublox_msgs/NavSAT"));
}

TEST(ReceiverPresets, AnAutopilotsEstimateIsNoReceiver) {
  EXPECT_THAT(why_not_a_receiver("/mavros/global_position/global"), HasSubstr("already fused"));
  EXPECT_THAT(why_not_a_receiver("/uav1/mavros/global_position/local"), HasSubstr("already fused"));
  EXPECT_THAT(why_not_a_receiver("/mavros/global_position/raw/fix"), IsEmpty());
  EXPECT_THAT(why_not_a_receiver("global"), IsEmpty());
}

MessageBytes mavros_fix(double first, std::uint8_t type) {
  MessageBytes bytes;
  bytes.header(kSecond, 5, "base_link").put(std::int8_t{0}).put(std::uint16_t{1}).put(51.5).put(-0.1).put(64.0);
  bytes.put(first).zeros(3 * 8).put(4.0).zeros(3 * 8).put(9.0);
  return bytes.put(type);
}

TEST(MavrosDecoder, FixAndVelocityAreTakenAsTheyAre) {
  Feed feed("mavros");
  feed.add(ReceiverRole::kFix, kNavSatFix, mavros_fix(4.0, 2));
  feed.add(ReceiverRole::kVelocity, kTwist, MessageBytes().header(kSecond, 5).put(1.0).put(-2.0).zeros(32));
  ASSERT_THAT(feed.output().fixes, SizeIs(1));
  EXPECT_EQ(feed.output().fixes[0].covariance(0, 0), 4.0);
  ASSERT_THAT(feed.output().velocities, SizeIs(1));
  EXPECT_EQ(feed.output().velocities[0].stamp, feed.output().fixes[0].stamp);
  EXPECT_EQ(feed.output().velocities[0].velocity, Eigen::Vector2d(1.0, -2.0));
  EXPECT_EQ(feed.input().frame_id(), "base_link");
}

TEST(MavrosDecoder, MinusOneIsNoCovariance) {
  for (const std::uint8_t type : {0, 2}) {
    Feed feed("mavros");
    feed.add(ReceiverRole::kFix, kNavSatFix, mavros_fix(-1.0, type));
    EXPECT_EQ(feed.output().fixes.at(0).covariance_type, CovarianceType::kUnknown);
    EXPECT_TRUE(feed.output().fixes[0].covariance.isZero());
  }
}

TEST(ReceiverInput, WhatIsNoNumberDoesNotGoOn) {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  for (const double bad : {kInfinite, -kInfinite, std::nan(""), 1e300}) {
    ReceiverOutput output;
    output.fixes.resize(1);
    output.fixes[0].position = {48.0, 11.0, bad};
    output.fixes[0].covariance_type = CovarianceType::kKnown;
    output.fixes[0].covariance = Eigen::Vector3d(4.0, -1.0, 9.0).asDiagonal();
    output.velocities.resize(2);
    output.velocities[0].velocity.y() = bad;
    output.velocities[1].velocity = {1.0, 2.0};
    output.velocities[1].covariance << 0.1, bad, bad, 0.1;
    output.satellites.push_back({Stamp(0), {{}}, bad});
    SatelliteObservation& satellite = output.satellites[0].satellites[0];
    satellite.look = {bad, bad};
    satellite.cn0_dbhz = satellite.residual_m = bad;
    make_sound(output);
    EXPECT_TRUE(output.fixes[0].has_fix);
    EXPECT_FALSE(std::isinf(output.fixes[0].position.altitude_m));
    EXPECT_EQ(output.fixes[0].covariance_type, CovarianceType::kUnknown);
    EXPECT_TRUE(output.fixes[0].covariance.isZero());
    EXPECT_EQ(output.velocities.size(), std::isfinite(bad) ? 2u : 1u);
    EXPECT_TRUE(output.velocities.back().covariance.isZero()) << "a correlation beyond 1 is none, either";
    EXPECT_EQ(output.satellites[0].angle_resolution_rad, 0.0);
    for (const double value :
         {satellite.look.azimuth_rad, satellite.look.elevation_rad, satellite.cn0_dbhz, satellite.residual_m}) {
      EXPECT_TRUE(std::isnan(value)) << bad << ": also where a float cannot hold it";
    }
  }
  ReceiverOutput nowhere;
  nowhere.fixes.resize(1);
  nowhere.fixes[0].position.latitude_deg = kInfinite;
  make_sound(nowhere);
  EXPECT_FALSE(nowhere.fixes[0].has_fix);
}

TEST(MavrosDecoder, AStampOfZeroIsThatOfTheArrivalAndSaidSo) {
  Feed feed("mavros");
  const Stamp arrival(5000000000);
  MessageBytes bytes;
  bytes.header(0, 0).put(1.0).put(-2.0).zeros(32);
  feed.add(ReceiverRole::kVelocity, kTwist, bytes, arrival);
  feed.add(ReceiverRole::kVelocity, kTwist, bytes, arrival);
  EXPECT_EQ(feed.output().velocities.at(1).stamp, arrival);
  ASSERT_THAT(feed.output().warnings, SizeIs(1));
  EXPECT_THAT(feed.output().warnings[0], HasSubstr("header.stamp is 0"));
}

TEST(ReceiverInput, BeginsAnewWhereTheClockIsSetBack) {
  Feed feed("mavros");
  feed.add(ReceiverRole::kFix, kNavSatFix, mavros_fix(4.0, 2), Stamp(100000000000));
  feed.add(ReceiverRole::kFix, kNavSatFix, mavros_fix(4.0, 2), Stamp(99500000000));
  EXPECT_THAT(feed.output().warnings, IsEmpty());
  feed.add(ReceiverRole::kFix, kNavSatFix, mavros_fix(4.0, 2), Stamp(90000000000));
  ASSERT_THAT(feed.output().warnings, SizeIs(1));
  EXPECT_THAT(feed.output().warnings[0], HasSubstr("set back"));
  EXPECT_THAT(feed.output().fixes, SizeIs(3));
}

TEST(ReceiverInput, AMalformedDefinitionIsSaidOnceAndDoesNoHarm) {
  Feed feed("mavros");
  for (int i = 0; i < 3; ++i) feed.add(ReceiverRole::kFix, {"a/B", "Header header\n"}, mavros_fix(4.0, 2));
  feed.add(ReceiverRole::kFix, kNavSatFix, mavros_fix(4.0, 2));
  EXPECT_THAT(feed.output().fixes, SizeIs(1));
  ASSERT_THAT(feed.output().warnings, SizeIs(1));
  EXPECT_THAT(feed.output().warnings[0], HasSubstr("lacks the type std_msgs/Header"));
}

/// Whatever bytes come, in whatever place: errors, and nothing that is not finite.
TEST(ReceiverInput, SurvivesAnyMessage) {
  const std::vector<std::pair<ReceiverRole, Connection>> kinds = {
      {ReceiverRole::kNavPvt, kNavPvt},       {ReceiverRole::kNavSat, kNavSat},
      {ReceiverRole::kNavSvinfo, kNavSvinfo}, {ReceiverRole::kFix, kNavSatFix},
      {ReceiverRole::kVelocity, kTwist},      {ReceiverRole::kGpsFix, kGpsFix},
      {ReceiverRole::kGpsStatus, kGpsStatus}, {ReceiverRole::kTrackstat, kTrackstat},
      {ReceiverRole::kGpgsv, kGpgsv}};
  std::mt19937_64 random(13);
  std::size_t fixes = 0;
  for (const std::string preset : {"ublox", "gpsd", "septentrio", "novatel", "mavros"}) {
    Feed feed(preset);
    for (int round = 0; round < 3000; ++round) {
      const auto& [role, connection] = kinds[random() % kinds.size()];
      MessageBytes bytes;
      const std::size_t size = random() % 400;
      // Mostly zeros, so that some of it can be read.
      while (bytes.bytes().size() < size) bytes.put(static_cast<std::uint8_t>(random() % 3 == 0 ? random() : 0));
      feed.add(role, connection, bytes, Stamp(100000000LL * round));
    }
    for (std::size_t cut = 0; cut < 300; ++cut) feed.add(ReceiverRole::kNavPvt, kNavPvt, MessageBytes().zeros(cut));
    for (std::size_t cut = 0; cut < 300; ++cut) feed.add(ReceiverRole::kGpsFix, kGpsFix, MessageBytes().zeros(cut));
    feed.finish();
    for (const RawFix& fix : feed.output().fixes) EXPECT_TRUE(fix.covariance.allFinite());
    for (const RawVelocity& velocity : feed.output().velocities) EXPECT_TRUE(velocity.velocity.allFinite());
    fixes += feed.output().fixes.size();
  }
  EXPECT_GT(fixes, 0U);
}

}  // namespace
}  // namespace urban_gnss
