#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "driver_messages.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/receivers/gps_time.hpp"

namespace urban_gnss {
namespace {

using namespace driver;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

struct Pvt {
  std::uint32_t second{0};  ///< after kSecond
  std::int32_t nano{211571};
  std::uint8_t valid{7}, fix_type{3}, flags{1}, flags2{0xE0};
  std::uint16_t year{2018};
};

MessageBytes navpvt(const Pvt& pvt) {
  MessageBytes bytes;
  bytes.put(kTimeOfWeek_ms + 1000 * pvt.second).put(pvt.year).put(std::uint8_t{3}).put(std::uint8_t{29});
  bytes.put(std::uint8_t{17}).put(std::uint8_t{23}).put(static_cast<std::uint8_t>(27 + pvt.second)).put(pvt.valid);
  bytes.put(std::uint32_t{1011}).put(pvt.nano).put(pvt.fix_type).put(pvt.flags).put(pvt.flags2).put(std::uint8_t{10});
  bytes.put(std::int32_t{-1174133}).put(std::int32_t{515103393}).put(std::int32_t{64671}).put(std::int32_t{19075});
  bytes.put(std::uint32_t{2461}).put(std::uint32_t{4843}).put(std::int32_t{-23}).put(std::int32_t{-3});
  return bytes.put(std::int32_t{-199}).put(std::int32_t{23}).put(std::int32_t{0}).put(std::uint32_t{361});
}

MessageBytes fix(std::uint32_t second, std::uint32_t nanosecond = 211571) {
  MessageBytes bytes;
  bytes.header(kSecond + second, nanosecond).put(std::int8_t{0}).put(std::uint16_t{1}).put(51.5).put(-0.1).put(64.0);
  for (const double variance : {6.0, 0.0, 0.0, 0.0, 6.0, 0.0, 0.0, 0.0, 23.0}) bytes.put(variance);
  return bytes.put(std::uint8_t{2});
}

struct Sv {
  std::uint8_t system, number, cn0;
  std::int8_t elevation;
  std::int16_t azimuth, residual;
  std::uint32_t flags;
};

MessageBytes navsat(std::uint32_t second, const std::vector<Sv>& satellites) {
  MessageBytes bytes;
  bytes.put(kTimeOfWeek_ms + 1000 * second).put(std::uint8_t{1}).put(static_cast<std::uint8_t>(satellites.size()));
  bytes.zeros(2).put(static_cast<std::uint32_t>(satellites.size()));
  for (const Sv& sv : satellites) {
    bytes.put(sv.system).put(sv.number).put(sv.cn0).put(sv.elevation).put(sv.azimuth).put(sv.residual).put(sv.flags);
  }
  return bytes;
}

const std::vector<Sv> kSky = {
    {0, 5, 25, 13, 60, 179, 6428}, {0, 4, 40, -91, 0, 0, 2087}, {6, 11, 39, 83, -92, 15, 6431},
    {6, 255, 38, -91, 0, 0, 7},    {0, 2, 0, 4, 360, 0, 4625},  {2, 7, 30, 45, 180, -20, 6423},
    {9, 1, 30, 45, 180, 0, 6431},
};

Stamp at(double seconds_after) { return Stamp(kSecond * 1000000000LL) + from_seconds(seconds_after); }

TEST(GpsTime, OfARecordedFix) {
  EXPECT_EQ(to_stamp(UtcTime{2018, 3, 29, 17, 23, 27, 211571}), Stamp(1522344207000211571));
  EXPECT_EQ(to_stamp(UtcTime{1970, 1, 1, 0, 0, 0, -1}), Stamp(-1));
  EXPECT_EQ(time_of_week_ms(Stamp(1522344207000211571)), 408225000);
  EXPECT_TRUE(is_time({2261, 12, 31, 23, 59, 60, -1000000000}));
  for (const UtcTime& none : {UtcTime{29801, 3, 29}, UtcTime{2018, 13, 1}, UtcTime{2018, 1, 0}, UtcTime{2018, 1, 1, 24},
                              UtcTime{2018, 1, 1, 0, 0, 0, 1LL << 62}}) {
    EXPECT_FALSE(is_time(none));
  }
  // Leap second at the end of 2016: GPS was ahead by 17 s before and is by 18 s since.
  const Stamp new_year = to_stamp(UtcTime{2017, 1, 1, 0, 0, 0, 0});
  EXPECT_EQ(time_of_week_ms(new_year) - time_of_week_ms(new_year - Stamp(1000000000)), 2000);
  EXPECT_EQ(time_of_week_difference_ms(5, 604799995), 10);
  EXPECT_EQ(time_of_week_difference_ms(604799995, 5), -10);
}

TEST(UbloxDecoder, ASolutionIsOfNavPvt) {
  Feed feed("ublox");
  feed.add(ReceiverRole::kNavPvt, kNavPvt, navpvt({}));
  ASSERT_THAT(feed.output().fixes, SizeIs(1));
  ASSERT_THAT(feed.output().velocities, SizeIs(1));
  const RawFix& given = feed.output().fixes[0];
  EXPECT_EQ(given.stamp, Stamp(1522344207000211571));
  EXPECT_TRUE(given.has_fix);
  EXPECT_DOUBLE_EQ(given.position.latitude_deg, 51.5103393);
  EXPECT_DOUBLE_EQ(given.position.longitude_deg, -0.1174133);
  EXPECT_DOUBLE_EQ(given.position.altitude_m, 64.671);
  EXPECT_NEAR(given.covariance(1, 1), 2.461 * 2.461, 1e-9);
  EXPECT_NEAR(given.covariance(2, 2), 4.843 * 4.843, 1e-9);
  const RawVelocity& velocity = feed.output().velocities[0];
  EXPECT_EQ(velocity.stamp, given.stamp);
  EXPECT_NEAR((velocity.velocity - Eigen::Vector2d(-0.003, -0.023)).norm(), 0.0, 1e-12);
  EXPECT_NEAR(velocity.covariance(0, 0), 0.361 * 0.361, 1e-9);
}

TEST(UbloxDecoder, ItsStampIsUtcOnlyWhereThatIsKnown) {
  const Stamp arrival = at(0.3);
  Pvt not_resolved, not_confirmable, negative, no_year;
  not_resolved.valid = 3;
  not_confirmable.flags2 = 0;
  negative.nano = -400000;
  no_year.year = 29801;  // more nanoseconds than 64 bits hold
  for (const auto& [pvt, expected] : {std::pair(not_resolved, arrival), std::pair(not_confirmable, arrival),
                                      std::pair(negative, at(-400e-6)), std::pair(no_year, arrival)}) {
    Feed feed("ublox");
    feed.add(ReceiverRole::kNavPvt, kNavPvt, navpvt(pvt), arrival);
    ASSERT_THAT(feed.output().fixes, SizeIs(1));
    EXPECT_EQ(feed.output().fixes[0].stamp, expected);
  }
}

TEST(UbloxDecoder, NoFixIsSaidSo) {
  Pvt no_fix, not_ok, time_only;
  no_fix.fix_type = 0;
  not_ok.flags = 0;
  time_only.fix_type = 5;
  for (const Pvt& pvt : {no_fix, not_ok, time_only}) {
    Feed feed("ublox");
    feed.add(ReceiverRole::kNavPvt, kNavPvt, navpvt(pvt));
    ASSERT_THAT(feed.output().fixes, SizeIs(1));
    EXPECT_FALSE(feed.output().fixes[0].has_fix);
    EXPECT_THAT(feed.output().velocities, IsEmpty());
    EXPECT_EQ(feed.counts().no_fixes, 1U);
  }
}

TEST(UbloxDecoder, SatellitesGetTheStampOfTheSolutionOfTheirTimeOfWeek) {
  for (const bool satellites_first : {false, true}) {
    Feed feed("ublox");
    if (satellites_first) feed.add(ReceiverRole::kNavSat, kNavSat, navsat(1, kSky));
    for (std::uint32_t second = 0; second < 4; ++second) {
      feed.add(ReceiverRole::kNavPvt, kNavPvt, navpvt({second}));
    }
    if (!satellites_first) feed.add(ReceiverRole::kNavSat, kNavSat, navsat(1, kSky));
    ASSERT_THAT(feed.output().satellites, SizeIs(1));
    const SatelliteEpoch& epoch = feed.output().satellites[0];
    EXPECT_EQ(epoch.stamp, feed.output().fixes[1].stamp);
    EXPECT_EQ(feed.counts().fixes_with_satellites, 1U);
    EXPECT_EQ(feed.counts().fixes_with_residuals, 1U);
    ASSERT_THAT(epoch.satellites, SizeIs(5));  // not the one without a number, not the one of an unknown system
    const auto& used = epoch.satellites[0];
    EXPECT_EQ(satellite_name(used.id), "G05");
    EXPECT_NEAR(used.residual_m, 17.9, 1e-9);
    EXPECT_NEAR(used.look.elevation_rad, degrees_to_radians(13.0), 1e-12);
    EXPECT_EQ(used.cn0_dbhz, 25.0);
    const auto& without_direction = epoch.satellites[1];
    EXPECT_FALSE(has_direction(without_direction));
    EXPECT_TRUE(std::isnan(without_direction.residual_m));
    EXPECT_NEAR(epoch.satellites[2].look.azimuth_rad, degrees_to_radians(268.0), 1e-12);
    const auto& not_tracked = epoch.satellites[3];
    EXPECT_FALSE(not_tracked.tracked);
    EXPECT_TRUE(std::isnan(not_tracked.cn0_dbhz));
    EXPECT_EQ(not_tracked.look.azimuth_rad, 0.0);
    EXPECT_EQ(satellite_name(epoch.satellites[4].id), "E07");
    EXPECT_TRUE(std::isnan(epoch.satellites[4].residual_m));  // it is not used
  }
}

TEST(UbloxDecoder, WithoutNavPvtTheDriversOwnMessagesServe) {
  Feed feed("ublox");
  for (std::uint32_t second = 0; second < 3; ++second) {
    feed.add(ReceiverRole::kFix, kNavSatFix, fix(second));
    feed.add(ReceiverRole::kVelocity, kTwist,
             MessageBytes().header(kSecond + second, 211571).put(1.0).put(2.0).zeros(32));
  }
  feed.add(ReceiverRole::kNavSat, kNavSat, navsat(1, kSky));
  EXPECT_THAT(feed.output().fixes, SizeIs(3));
  EXPECT_THAT(feed.output().velocities, SizeIs(3));
  ASSERT_THAT(feed.output().satellites, SizeIs(1));
  EXPECT_EQ(feed.output().satellites[0].stamp, at(1.000211571));
  EXPECT_EQ(feed.counts().fixes_with_residuals, 1U);
  EXPECT_EQ(feed.input().frame_id(), "gps");
}

TEST(UbloxDecoder, EachSolutionIsGivenOnceInAnyOrder) {
  for (const bool fix_first : {false, true}) {
    Feed feed("ublox");
    for (std::uint32_t second = 0; second < 4; ++second) {
      if (fix_first) feed.add(ReceiverRole::kFix, kNavSatFix, fix(second));
      feed.add(ReceiverRole::kNavPvt, kNavPvt, navpvt({second}));
      if (!fix_first) feed.add(ReceiverRole::kFix, kNavSatFix, fix(second));
    }
    EXPECT_EQ(feed.counts().fixes, 4U);
    EXPECT_EQ(feed.counts().velocities, 4U);
  }
}

TEST(UbloxDecoder, ResidualsOfAnotherSolutionAreNotUsed) {
  Feed feed("ublox");
  feed.add(ReceiverRole::kNavSat, kNavSat, navsat(1, kSky));
  feed.add(ReceiverRole::kNavPvt, kNavPvt, navpvt({0}));
  feed.add(ReceiverRole::kNavPvt, kNavPvt, navpvt({2}));
  feed.add(ReceiverRole::kNavPvt, kNavPvt, navpvt({3}));
  feed.finish();
  ASSERT_THAT(feed.output().satellites, SizeIs(1));
  EXPECT_EQ(feed.output().satellites[0].stamp, at(1.000211571));
  for (const auto& satellite : feed.output().satellites[0].satellites) EXPECT_TRUE(std::isnan(satellite.residual_m));
  EXPECT_EQ(feed.counts().fixes_with_satellites, 0U);
  EXPECT_THAT(feed.output().warnings, Contains(HasSubstr("iTOW")));
}

TEST(UbloxDecoder, OlderReceiversSendNavSvinfo) {
  Feed feed("ublox");
  feed.add(ReceiverRole::kNavPvt, kNavPvt, navpvt({}));
  MessageBytes bytes;
  bytes.put(kTimeOfWeek_ms).put(std::uint8_t{2}).put(std::uint8_t{4}).zeros(2).put(std::uint32_t{2});
  for (const std::uint8_t number : {5, 76}) {
    bytes.put(std::uint8_t{0}).put(number).put(std::uint8_t{13}).put(std::uint8_t{7}).put(std::uint8_t{44});
    bytes.put(std::int8_t{50}).put(std::int16_t{100}).put(std::int32_t{-250});
  }
  feed.add(ReceiverRole::kNavSvinfo, kNavSvinfo, bytes);
  ASSERT_THAT(feed.output().satellites, SizeIs(1));
  EXPECT_EQ(satellite_name(feed.output().satellites[0].satellites[1].id), "R12");
  EXPECT_NEAR(feed.output().satellites[0].satellites[1].residual_m, -2.5, 1e-9);
}

TEST(UbloxDecoder, AMissingFieldIsNamedOnce) {
  Feed feed("ublox");
  Connection without = kNavSat;
  without.definition.replace(without.definition.find("int16 prRes"), 11, "int16 other");
  for (int i = 0; i < 3; ++i) feed.add(ReceiverRole::kNavSat, without, navsat(0, kSky));
  feed.add(ReceiverRole::kNavPvt, kNavPvt, navpvt({}));
  ASSERT_THAT(feed.output().warnings, SizeIs(1));
  EXPECT_THAT(feed.output().warnings[0], AllOf(HasSubstr("navsat"), HasSubstr("ublox_msgs/NavSAT"),
                                               HasSubstr("md5ofublox_msgs/NavSAT"), HasSubstr("sv[].prRes")));
  EXPECT_EQ(feed.input().unreadable().at("navsat"), 3U);
  EXPECT_EQ(feed.counts().fixes, 1U);
}

}  // namespace
}  // namespace urban_gnss
