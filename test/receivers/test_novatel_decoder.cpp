#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "driver_messages.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"

namespace urban_gnss {
namespace {

using namespace driver;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr std::uint32_t kGlonass = 1U << 16U;

struct Channel {
  std::int16_t prn;
  std::uint32_t status;
  float cn0, residual;
  std::string reject;
};

MessageBytes fix(std::uint32_t second, std::uint32_t nanosecond = 0) {
  MessageBytes bytes;
  bytes.header(kSecond + second, nanosecond).header(0, 0).zeros(2 + 4 + 2 + 16 + 2 + 2);
  bytes.put(51.5).put(-0.1).put(30.0).put(90.0).put(2.0).zeros(8).put(1000.0 + second).zeros(5 * 8);
  for (int i = 0; i < 9; ++i) bytes.put(i % 4 == 0 ? 1.0 : 0.0);
  return bytes.put(std::uint8_t{2});
}

MessageBytes trackstat(std::uint32_t second, std::uint32_t nanosecond, const std::vector<Channel>& channels) {
  MessageBytes bytes;
  bytes.header(kSecond + second, nanosecond).text("SOL_COMPUTED").text("SINGLE").put(5.0F);
  bytes.put(static_cast<std::uint32_t>(channels.size()));
  for (const Channel& channel : channels) {
    bytes.put(channel.prn).put(std::int16_t{0}).put(channel.status).put(2.2e7).put(100.0F).put(channel.cn0).put(50.0F);
    bytes.put(channel.residual).text(channel.reject).put(1.0F);
  }
  return bytes;
}

MessageBytes gpgsv(std::uint32_t second, std::uint8_t number, std::uint8_t of, const std::vector<int>& satellites) {
  MessageBytes bytes;
  bytes.header(kSecond + second, 0).text("GPGSV").put(of).put(number).put(std::uint8_t{7});
  bytes.put(static_cast<std::uint32_t>(satellites.size()));
  for (const int prn : satellites) {
    bytes.put(static_cast<std::uint8_t>(prn)).put(std::uint8_t{40}).put(static_cast<std::uint16_t>(10 * prn));
    bytes.put(static_cast<std::int8_t>(prn == 9 ? -1 : 42));
  }
  return bytes;
}

const std::vector<Channel> kChannels = {
    {5, 0, 45.0F, 1.5F, "GOOD"},           {5, 9U << 21U, 48.0F, 9.0F, "NOTUSED"}, {7, 9U << 21U, 30.0F, 0.0F, "OBSL2"},
    {7, 0, 33.0F, -4.0F, "LOWPOWER"},      {40, kGlonass, 44.0F, -2.5F, "GOOD"},   {0, 0, 0.0F, 0.0F, "NA"},
    {9, 0, 20.0F, 3.0F, "ELEVATIONERROR"},
};

Stamp at(double seconds_after) { return Stamp(kSecond * 1000000000LL) + from_seconds(seconds_after); }

TEST(NovatelDecoder, JoinsResidualsAndDirectionsBySatellite) {
  Feed feed("novatel");
  feed.add(ReceiverRole::kGpgsv, kGpgsv, gpgsv(0, 1, 2, {5, 7, 9}));
  feed.add(ReceiverRole::kGpgsv, kGpgsv, gpgsv(0, 2, 2, {67}));
  feed.add(ReceiverRole::kGpsFix, kGpsFix, fix(0));
  feed.add(ReceiverRole::kGpsFix, kGpsFix, fix(1));
  const std::size_t before = feed.output().satellites.size();
  feed.add(ReceiverRole::kTrackstat, kTrackstat, trackstat(1, 30000000, kChannels));
  ASSERT_THAT(feed.output().fixes, SizeIs(2));
  EXPECT_THAT(feed.output().velocities, SizeIs(2));
  ASSERT_EQ(feed.output().satellites.size(), before + 1);
  const SatelliteEpoch& epoch = feed.output().satellites.back();
  EXPECT_EQ(epoch.stamp, feed.output().fixes[1].stamp);
  ASSERT_THAT(epoch.satellites, SizeIs(4));
  EXPECT_EQ(satellite_name(epoch.satellites[0].id), "G05");
  EXPECT_FLOAT_EQ(static_cast<float>(epoch.satellites[0].residual_m), 1.5F);
  EXPECT_EQ(epoch.satellites[0].cn0_dbhz, 45.0);
  EXPECT_NEAR(epoch.satellites[0].look.azimuth_rad, degrees_to_radians(50.0), 1e-12);
  EXPECT_EQ(satellite_name(epoch.satellites[1].id), "G07");
  EXPECT_TRUE(std::isnan(epoch.satellites[1].residual_m));
  EXPECT_EQ(epoch.satellites[1].cn0_dbhz, 33.0);  // the stronger channel
  EXPECT_EQ(satellite_name(epoch.satellites[3].id), "R03");
  EXPECT_FLOAT_EQ(static_cast<float>(epoch.satellites[3].residual_m), -2.5F);
  EXPECT_TRUE(has_direction(epoch.satellites[3]));
  EXPECT_EQ(feed.counts().fixes_with_residuals, 1U);
}

TEST(NovatelDecoder, WithoutTrackstatTheDirectionsAreGivenAlone) {
  Feed feed("novatel");
  feed.add(ReceiverRole::kGpsFix, kGpsFix, fix(0));
  feed.add(ReceiverRole::kGpgsv, kGpgsv, gpgsv(0, 1, 2, {5, 7, 9}));
  EXPECT_THAT(feed.output().satellites, IsEmpty());
  feed.add(ReceiverRole::kGpgsv, kGpgsv, gpgsv(0, 2, 2, {67}));
  ASSERT_THAT(feed.output().satellites, SizeIs(1));
  EXPECT_THAT(feed.output().satellites[0].satellites, SizeIs(4));
  EXPECT_FALSE(feed.output().satellites[0].satellites[2].tracked);
  EXPECT_EQ(feed.output().satellites[0].stamp, feed.output().fixes.at(0).stamp);
}

TEST(NovatelDecoder, ResidualsAreThoseOfTheNearestFix) {
  Feed feed("novatel");
  for (std::uint32_t i = 0; i < 10; ++i) feed.add(ReceiverRole::kGpsFix, kGpsFix, fix(i));
  // Between two fixes: nobody knows yet which is nearer.
  feed.add(ReceiverRole::kTrackstat, kTrackstat, trackstat(9, 700000000, kChannels));
  EXPECT_THAT(feed.output().satellites, IsEmpty());
  feed.add(ReceiverRole::kGpsFix, kGpsFix, fix(10));
  ASSERT_THAT(feed.output().satellites, SizeIs(1));
  EXPECT_EQ(feed.output().satellites[0].stamp, at(10.0));
  // Far from any.
  feed.add(ReceiverRole::kTrackstat, kTrackstat, trackstat(15, 0, kChannels));
  feed.finish();
  ASSERT_THAT(feed.output().satellites, SizeIs(2));
  EXPECT_EQ(feed.output().satellites[1].stamp, at(15.0));
  for (const auto& each : feed.output().satellites[1].satellites) EXPECT_TRUE(std::isnan(each.residual_m));
}

TEST(NovatelDecoder, RejectCodesMayBeNumbers) {
  Connection numbered = kTrackstat;
  numbered.definition.replace(numbered.definition.find("string reject"), 13, "uint32 reject");
  MessageBytes bytes;
  bytes.header(kSecond, 0).text("").text("").put(5.0F).put(std::uint32_t{2});
  for (const std::uint32_t reject : {0U, 17U}) {
    bytes.put(static_cast<std::int16_t>(5 + reject)).zeros(2 + 4 + 8 + 4).put(40.0F).put(50.0F).put(2.0F).put(reject);
    bytes.put(1.0F);
  }
  Feed feed("novatel");
  feed.add(ReceiverRole::kGpsFix, kGpsFix, fix(0));
  feed.add(ReceiverRole::kTrackstat, numbered, bytes);
  ASSERT_THAT(feed.output().satellites, SizeIs(1));
  EXPECT_EQ(feed.output().satellites[0].satellites[0].residual_m, 2.0);
  EXPECT_TRUE(std::isnan(feed.output().satellites[0].satellites[1].residual_m));
}

}  // namespace
}  // namespace urban_gnss
