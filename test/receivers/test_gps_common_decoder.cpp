#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "driver_messages.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"

namespace urban_gnss {
namespace {

using namespace driver;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct Status {
  std::vector<std::int32_t> numbers, elevations, azimuths, ratios;
  std::int16_t status{0};
};

const Status kSky = {{5, 70, 305, 40, 999}, {30, 91, 0, 45, 10}, {-10, 100, 0, 360, 20}, {40, 0, 35, 30, 20}};

MessageBytes& put(MessageBytes& bytes, const Status& status, std::uint32_t secs, std::uint32_t nsecs) {
  bytes.header(secs, nsecs).put(std::uint16_t{0}).array(std::vector<std::int32_t>{1, 0, 1}).put(std::uint16_t{9});
  bytes.array(status.numbers).array(status.elevations).array(status.azimuths).array(status.ratios);
  return bytes.put(status.status).put(std::uint16_t{0});
}

struct Fix {
  double after_s{0.0};  ///< header.stamp, after kSecond
  double time{0.0};
  double track{90.0}, speed{2.0}, err{0.0}, err_horz{0.0}, err_vert{0.0}, err_track{0.0}, err_speed{0.0};
  double variance{0.0};
  std::uint8_t type{0};
  double latitude{51.5};
  Status status;
};

MessageBytes message(const Fix& fix) {
  MessageBytes bytes;
  const auto nanoseconds = static_cast<std::uint32_t>(std::lround(1e9 * (fix.after_s - std::floor(fix.after_s))));
  bytes.header(kSecond + static_cast<std::uint32_t>(fix.after_s), nanoseconds);
  put(bytes, fix.status, 0, 0);
  bytes.put(fix.latitude).put(-0.1).put(30.0).put(fix.track).put(fix.speed).put(0.0).put(fix.time).put(fix.err);
  bytes.put(fix.err_horz).put(fix.err_vert).put(fix.err_track).put(fix.err_speed);
  for (int i = 0; i < 9; ++i) bytes.put(i % 4 == 0 ? fix.variance : 0.0);
  return bytes.put(fix.type);
}

ReceiverOutput decode(const Fix& fix, const std::string& preset = "gpsd") {
  Feed feed(preset);
  feed.add(ReceiverRole::kGpsFix, kGpsFix, message(fix));
  return feed.output();
}

Stamp at(double seconds_after) { return Stamp(kSecond * 1000000000LL) + from_seconds(seconds_after); }

TEST(GpsCommonDecoder, TheCovarianceIsTheDeclaredOneOrOfTheBounds) {
  Fix declared;
  declared.variance = 4.0;
  declared.type = 2;
  declared.err_horz = 100.0;
  EXPECT_EQ(decode(declared).fixes.at(0).covariance(0, 0), 4.0);
  Fix bounds;
  bounds.err_horz = 2.4477;
  bounds.err_vert = 1.96 * 3.0;
  bounds.variance = 4.0;  // of unknown type
  EXPECT_NEAR(decode(bounds).fixes.at(0).covariance(0, 0), 1.0, 1e-9);
  EXPECT_NEAR(decode(bounds).fixes.at(0).covariance(2, 2), 9.0, 1e-9);
  Fix radius;
  radius.err = 4.8954;
  EXPECT_NEAR(decode(radius).fixes.at(0).covariance(1, 1), 4.0, 1e-9);
  Fix nothing;
  nothing.err = kNaN;
  nothing.type = 2;
  EXPECT_EQ(decode(nothing).fixes.at(0).covariance_type, CovarianceType::kUnknown);
}

TEST(GpsCommonDecoder, TheVelocityIsOfSpeedAndTrack) {
  Fix east;
  east.err_speed = 1.96 * 0.1;
  east.err_track = 1.96 * radians_to_degrees(0.2);
  const RawVelocity velocity = decode(east).velocities.at(0);
  EXPECT_NEAR((velocity.velocity - Eigen::Vector2d(2.0, 0.0)).norm(), 0.0, 1e-12);
  EXPECT_NEAR(velocity.covariance(0, 0), 0.01, 1e-9);
  EXPECT_NEAR(velocity.covariance(1, 1), 0.16, 1e-9);
  Fix not_filled;
  not_filled.track = not_filled.speed = 0.0;
  EXPECT_THAT(decode(not_filled).velocities, IsEmpty());
  Fix standing;
  standing.track = kNaN;
  standing.speed = 0.05;
  EXPECT_NEAR(decode(standing).velocities.at(0).covariance(0, 0), 0.01, 1e-9);
  Fix no_track = standing;
  no_track.speed = 5.0;
  EXPECT_THAT(decode(no_track).velocities, IsEmpty());
  Fix do_not_use = no_track;
  do_not_use.track = -2e10;
  EXPECT_THAT(decode(do_not_use).velocities, IsEmpty());
}

TEST(GpsCommonDecoder, SatellitesAreTheVisibleOnes) {
  Fix fix;
  fix.status = kSky;
  const ReceiverOutput output = decode(fix);
  ASSERT_THAT(output.satellites, SizeIs(1));
  EXPECT_EQ(output.satellites[0].stamp, output.fixes.at(0).stamp);
  const auto& satellites = output.satellites[0].satellites;
  ASSERT_THAT(satellites, SizeIs(4));
  EXPECT_EQ(satellite_name(satellites[0].id), "G05");
  EXPECT_NEAR(satellites[0].look.azimuth_rad, degrees_to_radians(350.0), 1e-12);
  EXPECT_EQ(satellite_name(satellites[1].id), "R06");
  EXPECT_FALSE(has_direction(satellites[1]));
  EXPECT_FALSE(satellites[1].tracked);
  EXPECT_EQ(satellite_name(satellites[2].id), "E05");
  EXPECT_FALSE(has_direction(satellites[2]));  // 0 and 0
  EXPECT_TRUE(satellites[2].tracked);
  EXPECT_EQ(satellite_name(satellites[3].id), "S127");
  EXPECT_EQ(satellites[3].look.azimuth_rad, 0.0);
  EXPECT_NEAR(output.satellites[0].angle_resolution_rad, degrees_to_radians(1.0), 1e-12);
}

TEST(GpsCommonDecoder, ListsMayBeEmptyOrOfDifferentLengths) {
  Fix fix;
  fix.status.numbers = {5, 6};
  fix.status.ratios = {40};
  const ReceiverOutput output = decode(fix);
  ASSERT_THAT(output.satellites.at(0).satellites, SizeIs(2));
  EXPECT_FALSE(has_direction(output.satellites[0].satellites[0]));
  EXPECT_FALSE(output.satellites[0].satellites[1].tracked);
  EXPECT_THAT(decode(Fix{}).satellites, IsEmpty());
}

TEST(GpsCommonDecoder, SeptentrioNumbersInItsOwnWay) {
  Fix fix;
  fix.status = {{40, 75, 145}, {30, 30, 30}, {10, 10, 10}, {40, 40, 40}};
  const ReceiverOutput output = decode(fix, "septentrio");
  ASSERT_THAT(output.satellites.at(0).satellites, SizeIs(3));
  EXPECT_EQ(satellite_name(output.satellites[0].satellites[0].id), "R03");
  EXPECT_EQ(satellite_name(output.satellites[0].satellites[1].id), "E05");
  EXPECT_EQ(satellite_name(output.satellites[0].satellites[2].id), "C05");
}

TEST(GpsCommonDecoder, GpsdsTimeIsTheStampWhileItAgreesWithTheRobotsClock) {
  Fix fix;
  fix.after_s = 0.3;
  fix.time = kSecond + 0.0;
  EXPECT_EQ(decode(fix).fixes.at(0).stamp, at(0.0));
  EXPECT_EQ(decode(fix, "septentrio").fixes.at(0).stamp, at(0.3));
  fix.time = kSecond + 18.0;
  EXPECT_EQ(decode(fix).fixes.at(0).stamp, at(0.3));
  EXPECT_THAT(decode(fix).warnings, Contains(HasSubstr("18 s apart")));
}

TEST(GpsCommonDecoder, StampsAscendWhereATimeIsWrongNowAndThen) {
  Feed feed("gpsd");
  // The fraction of gpsd_client with gpsd 3.20 and later: nanoseconds as milliseconds.
  for (int i = 0; i < 40; ++i) {
    Fix fix;
    fix.after_s = 0.2 * i + 0.15;
    fix.time = kSecond + i / 5 + 200.0 * (i % 5);
    feed.add(ReceiverRole::kGpsFix, kGpsFix, message(fix));
  }
  ASSERT_THAT(feed.output().fixes, SizeIs(40));
  for (std::size_t i = 2; i < 40; ++i) {
    const double step_s = to_seconds(feed.output().fixes[i].stamp - feed.output().fixes[i - 1].stamp);
    EXPECT_NEAR(step_s, 0.2, 1e-6);
  }
}

TEST(GpsCommonDecoder, AFixThatComesAgainOnlyAddsSatellites) {
  Feed feed("gpsd");
  Fix fix;
  fix.time = kSecond;
  fix.status = {{5, 6}, {30, 40}, {10, 20}, {40, 41}};
  feed.add(ReceiverRole::kGpsFix, kGpsFix, message(fix));
  feed.add(ReceiverRole::kGpsFix, kGpsFix, message(fix));
  fix.status = {{70}, {30}, {10}, {40}};
  fix.after_s = 0.1;
  feed.add(ReceiverRole::kGpsFix, kGpsFix, message(fix));
  EXPECT_THAT(feed.output().fixes, SizeIs(1));
  EXPECT_THAT(feed.output().velocities, SizeIs(1));
  ASSERT_THAT(feed.output().satellites, SizeIs(2));
  EXPECT_THAT(feed.output().satellites[1].satellites, SizeIs(3));
  EXPECT_EQ(feed.output().satellites[1].stamp, feed.output().fixes[0].stamp);
  EXPECT_EQ(feed.counts().epochs, 1U);
}

TEST(GpsCommonDecoder, AStatusOfItsOwnTopicIsPairedWithTheNearestFix) {
  Feed feed("gpsd");
  for (int second = 0; second < 4; ++second) {
    Fix fix;
    fix.after_s = second;
    feed.add(ReceiverRole::kGpsFix, kGpsFix, message(fix));
    MessageBytes status;
    feed.add(ReceiverRole::kGpsStatus, kGpsStatus,
             put(status, kSky, kSecond + static_cast<std::uint32_t>(second), 50000000));
  }
  ASSERT_THAT(feed.output().satellites, SizeIs(4));
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(feed.output().satellites[i].stamp, feed.output().fixes[i].stamp);
  EXPECT_EQ(feed.counts().fixes_with_satellites, 4U);
}

TEST(GpsCommonDecoder, NothingThatIsNotFiniteComesOut) {
  Fix fix;
  fix.latitude = kNaN;
  fix.speed = std::numeric_limits<double>::infinity();
  fix.variance = kNaN;
  fix.type = 3;
  fix.status.status = -1;
  const ReceiverOutput output = decode(fix);
  EXPECT_FALSE(output.fixes.at(0).has_fix);
  EXPECT_TRUE(std::isfinite(output.fixes[0].position.latitude_deg));
  EXPECT_TRUE(output.fixes[0].covariance.allFinite());
  EXPECT_THAT(output.velocities, IsEmpty());
}

}  // namespace
}  // namespace urban_gnss
