#include <gmock/gmock.h>

#include "nmea_text.hpp"
#include "urban_gnss_localization/common/positive_definite.hpp"
#include "urban_gnss_localization/receivers/nmea_decoder.hpp"

namespace urban_gnss {
namespace {

using namespace std::chrono_literals;

const Stamp kNoon = 18299 * Stamp(24h) + 12h;  // 2020-02-07

std::string rmc(const std::string& time, const std::string& rest = "A,3725.5,N,12205.5,W,10.0,90.0,070220,,,A") {
  return "GNRMC," + time + "," + rest;
}
std::string gga(const std::string& time, const std::string& quality = "1") {
  return "GNGGA," + time + ",3725.5,N,12205.5,W," + quality + ",12,1.0,4.4,M,-30.0,M,,";
}

ReceiverOutput decode(const std::vector<std::string>& bodies, const NmeaParameters& parameters = {},
                      const NmeaClock& clock = {}) {
  NmeaDecoder decoder(parameters, clock);
  for (const std::string& body : bodies) decoder.add(nmea(body));
  decoder.finish();
  return decoder.take();
}

TEST(NmeaDecoder, SentencesOfOneTimeAreOneSolutionWithOneStamp) {
  const ReceiverOutput output = decode({rmc("120000.00"), gga("120000.00"), "GPGSV,1,1,01,02,25,181,42,1",
                                        "GNGLL,3725.5,N,12205.5,W,120000.00,A,A", rmc("120001.00"), gga("120001.00"),
                                        "GPGSV,1,1,01,02,25,181,43,1"});
  ASSERT_EQ(output.fixes.size(), 2U);
  ASSERT_EQ(output.velocities.size(), 2U);
  ASSERT_EQ(output.satellites.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    const Stamp stamp = kNoon + (i == 0 ? 0s : 1s);
    EXPECT_EQ(output.fixes[i].stamp, stamp);
    EXPECT_EQ(output.velocities[i].stamp, stamp);
    EXPECT_EQ(output.satellites[i].stamp, stamp);
    EXPECT_EQ(output.satellites[i].satellites[0].cn0_dbhz, i == 0 ? 42.0 : 43.0);
  }
  EXPECT_TRUE(output.fixes[0].has_fix);
  EXPECT_NEAR(output.fixes[0].position.latitude_deg, 37.0 + 25.5 / 60.0, 1e-12);
  EXPECT_NEAR(output.fixes[0].position.altitude_m, -25.6, 1e-12);
  EXPECT_NEAR(output.velocities[0].velocity.x(), 10.0 * 1852.0 / 3600.0, 1e-12);  // course 90: east
  EXPECT_NEAR(output.velocities[0].velocity.y(), 0.0, 1e-12);
  EXPECT_FALSE(is_positive_definite<2>(output.velocities[0].covariance));
  EXPECT_TRUE(output.warnings.empty());
}

TEST(NmeaDecoder, SatellitesThatComeFirstAreOfTheNextSolution) {
  const ReceiverOutput output =
      decode({"GPGSA,A,3,02,,,,,,,,,,,,1,1,1", "GPGSV,1,1,01,02,25,181,41", gga("120000"), rmc("120000"),
              "GPGSA,A,3,02,,,,,,,,,,,,1,1,1", "GPGSV,1,1,01,02,25,181,42", gga("120001"), rmc("120001"),
              "GPGSV,1,1,01,02,25,181,43", gga("120002"), rmc("120002")});
  ASSERT_EQ(output.satellites.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(output.satellites[i].stamp, output.fixes[i].stamp);
    EXPECT_EQ(output.satellites[i].satellites[0].cn0_dbhz, 41.0 + static_cast<double>(i));
  }
}

TEST(NmeaDecoder, MidnightIsTheNextDay) {
  const ReceiverOutput output =
      decode({rmc("235959.50", "A,3725.5,N,12205.5,W,1,9,280220,,,A"), gga("235959.50"), gga("000000.00"),
              rmc("000000.00", "A,3725.5,N,12205.5,W,1,9,290220,,,A"), gga("000000.50"), gga("000001.00")});
  ASSERT_EQ(output.fixes.size(), 4U);
  for (std::size_t i = 1; i < 4; ++i) EXPECT_EQ(output.fixes[i].stamp - output.fixes[i - 1].stamp, 500ms);
  EXPECT_EQ(output.fixes[1].stamp, 18321 * Stamp(24h));
}

TEST(NmeaDecoder, WithoutADateTheGivenDayCounts) {
  EXPECT_TRUE(decode({gga("120000")}).fixes.empty());
  const auto near = decode({gga("235959"), gga("000000")}, {}, NmeaClock::near(kNoon + 12h));
  ASSERT_EQ(near.fixes.size(), 2U);
  EXPECT_EQ(near.fixes[1].stamp, kNoon + 12h);
  const auto given = decode({rmc("235959"), rmc("000000")}, {}, NmeaClock::from_day(0));
  ASSERT_EQ(given.fixes.size(), 2U);
  EXPECT_EQ(given.fixes[0].stamp, Stamp(24h - 1s));  // not 2020, as the sentences say
  EXPECT_EQ(given.fixes[1].stamp, Stamp(24h));
}

TEST(NmeaDecoder, ArrivalStampsAreTheRobotsClock) {
  NmeaDecoder decoder;
  decoder.add(nmea("GPGSV,1,1,01,02,25,181,41"), 100s);
  decoder.add(nmea(gga("120000")), 100s + 20ms);
  decoder.add(nmea(rmc("120000")), 100s + 40ms);
  decoder.finish();
  const ReceiverOutput output = decoder.take();
  ASSERT_EQ(output.fixes.size(), 1U);
  EXPECT_EQ(output.fixes[0].stamp, 100s + 20ms);
  EXPECT_EQ(output.satellites.at(0).stamp, 100s + 20ms);
}

TEST(NmeaDecoder, ALearntEndIsNotWaitedFor) {
  NmeaDecoder decoder;
  for (int k = 0; k < 6; ++k) {
    const std::string time = "12000" + std::to_string(k);
    const Stamp at = 100s + k * 1s;
    decoder.add(nmea(rmc(time)), at);
    decoder.add(nmea(gga(time)), at + 10ms);
    const std::size_t before = decoder.take().fixes.size();
    decoder.add(nmea("GPGSV,1,1,01,02,25,181,41"), at + 20ms);
    const ReceiverOutput output = decoder.take();
    // The fourth is the first whose end is known; those before come when the next one begins.
    EXPECT_EQ(before, k >= 1 && k <= 3 ? 1U : 0U) << k;
    EXPECT_EQ(output.fixes.size(), k >= 3 ? 1U : 0U) << k;
    EXPECT_EQ(output.satellites.size(), k >= 3 ? 1U : 0U) << k;
  }
  decoder.finish();
  EXPECT_TRUE(decoder.take().empty());
}

TEST(NmeaDecoder, SatellitesBehindALearntEndStillHaveTheirSolutionsStamp) {
  NmeaDecoder decoder;
  ReceiverOutput all;
  for (int k = 0; k < 6; ++k) {
    const std::string time = "12000" + std::to_string(k);
    decoder.add(nmea(rmc(time)), 100s + k * 1s);
    if (k == 4) decoder.add(nmea("GPGSV,1,1,01,02,25,181,41"), 100s + k * 1s + 10ms);
    const ReceiverOutput output = decoder.take();
    all.fixes.insert(all.fixes.end(), output.fixes.begin(), output.fixes.end());
    all.satellites.insert(all.satellites.end(), output.satellites.begin(), output.satellites.end());
  }
  ASSERT_EQ(all.satellites.size(), 1U);
  EXPECT_EQ(all.satellites[0].stamp, 104s);
  EXPECT_GE(all.fixes.size(), 5U);
}

TEST(NmeaDecoder, APauseBeginsASolutionForANodeThatStartedInTheMiddle) {
  NmeaDecoder decoder;
  for (int k = 0; k < 4; ++k) {
    const Stamp at = 100s + k * 1s;
    if (k > 0) decoder.add(nmea("GPGSV,1,1,01,02,25,181,4" + std::to_string(k)), at);
    decoder.add(nmea(gga("12000" + std::to_string(k))), at + 10ms);
  }
  decoder.finish();
  const ReceiverOutput output = decoder.take();
  ASSERT_EQ(output.fixes.size(), 4U);
  for (const SatelliteEpoch& epoch : output.satellites) {
    if (epoch.stamp < 102s) continue;  // the interval is not known before
    EXPECT_EQ(epoch.satellites[0].cn0_dbhz, 40.0 + to_seconds(epoch.stamp - 100s - 10ms));
  }
}

TEST(NmeaDecoder, AReceiverWithoutTheTimeIsHeardByItsArrivals) {
  const std::vector<std::string> bodies{"GPRMC,,V,,,,,,,,,,N", "GPVTG,,,,,,,,,N", "GPGGA,,,,,,0,00,99.99,,,,,,",
                                        "GPGLL,,,,,,V,N"};
  NmeaDecoder decoder;
  for (int k = 0; k < 3; ++k) {
    for (const std::string& body : bodies) decoder.add(nmea(body), 100s + k * 1s);
  }
  decoder.finish();
  const ReceiverOutput output = decoder.take();
  ASSERT_EQ(output.fixes.size(), 3U);
  EXPECT_EQ(output.fixes[2].stamp, 102s);
  EXPECT_FALSE(output.fixes[2].has_fix);
  EXPECT_TRUE(std::isnan(output.fixes[2].position.latitude_deg));
  EXPECT_TRUE(decode({bodies[0], bodies[2], bodies[0]}).fixes.empty());  // no stamp for them
}

TEST(NmeaDecoder, AClockThatStandsStillIsOfSeveralSolutions) {
  NmeaDecoder decoder;
  for (int k = 0; k < 5; ++k) decoder.add(nmea(gga("120000", "0")), 100s + k * 1100ms);
  decoder.finish();
  EXPECT_EQ(decoder.take().fixes.size(), 5U);
}

TEST(NmeaDecoder, WithoutAFixTheReceiversClockIsBelievedForAMinute) {
  const std::string lost = "V,,,,,,,010108,,,N";
  const ReceiverOutput output = decode({rmc("000039", lost), rmc("115959"), rmc("120000"), rmc("120001", lost),
                                        rmc("120050", lost), rmc("140000", lost), rmc("140001")});
  ASSERT_EQ(output.fixes.size(), 5U);
  EXPECT_EQ(output.fixes[2].stamp, kNoon + 1s);
  EXPECT_FALSE(output.fixes[2].has_fix);
  EXPECT_FALSE(output.fixes[3].has_fix);
  EXPECT_EQ(output.fixes[4].stamp, kNoon + 2h + 1s);
}

TEST(NmeaDecoder, ALateSentenceOpensNoSecondSolution) {
  NmeaDecoder decoder({}, NmeaClock::near(kNoon));
  for (const auto& body : {gga("120000"), gga("120001"), rmc("120000"), rmc("120001")}) decoder.add(nmea(body));
  decoder.finish();
  EXPECT_EQ(decoder.take().fixes.size(), 2U);
  EXPECT_EQ(decoder.counts().late_sentences, 1U);
}

}  // namespace
}  // namespace urban_gnss
