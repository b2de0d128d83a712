#include <gmock/gmock.h>

#include <random>

#include "urban_gnss_localization/common/positive_definite.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/receivers/gpsd_decoder.hpp"

namespace urban_gnss {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

const Stamp kNoon = 18299 * Stamp(24h) + 12h;  // 2020-02-07

std::string at(int second) { return "\"time\":\"2020-02-07T12:00:0" + std::to_string(second) + ".000Z\""; }
std::string tpv(int second, const std::string& rest = "") {
  return R"({"class":"TPV","device":"/dev/a","mode":3,)" + at(second) + R"(,"lat":37.5,"lon":-122.25,"altHAE":-25.5)" +
         (rest.empty() ? "" : "," + rest) + "}";
}
std::string sky(const std::string& satellites) {
  return R"({"class":"SKY","device":"/dev/a","hdop":2.0,"satellites":[)" + satellites + "]}";
}
std::string satellite(int gnssid, int svid, double cn0) {
  return R"({"PRN":1,"gnssid":)" + std::to_string(gnssid) + R"(,"svid":)" + std::to_string(svid) +
         R"(,"az":181.0,"el":25.0,"ss":)" + std::to_string(cn0) + R"(,"used":true})";
}

ReceiverOutput decode(const std::vector<std::string>& lines, const GpsdParameters& parameters = {}) {
  GpsdDecoder decoder(parameters);
  for (const std::string& line : lines) decoder.add(line);
  decoder.settle();
  return decoder.take();
}
double sigma_east(const std::vector<std::string>& lines) {
  return std::sqrt(decode(lines).fixes.at(0).covariance(0, 0));
}

TEST(GpsdReports, TimesAreUtc) {
  EXPECT_EQ(parse_gpsd_time("2020-02-07T12:00:00.250Z"), kNoon + 250ms);
  EXPECT_EQ(parse_gpsd_time("2020-02-07T12:00:00Z"), kNoon);
  for (const char* bad : {"", "2020-02-07", "2020-02-30T12:00:00.000Z", "2020-02-07 12:00:00.000Z",
                          "2020-02-07T25:00:00.000Z", "xxxx-02-07T12:00:00.000Z", "20-02-07T12:00:00.0000000Z"}) {
    EXPECT_FALSE(parse_gpsd_time(bad)) << bad;
  }
}

TEST(GpsdDecoder, SatellitesAreOfTheReportAtTheEndOfTheCycle) {
  const std::string gst = R"({"class":"GST","device":"/dev/a",)" + at(1) + R"(,"lat":3.0,"lon":2.0,"alt":5.0})";
  const ReceiverOutput output =
      decode({tpv(0), sky(satellite(0, 5, 40)), sky(satellite(0, 5, 41) + "," + satellite(6, 1, 30)), gst, tpv(1),
              sky(satellite(0, 7, 40)), tpv(2)});
  ASSERT_EQ(output.satellites.size(), 2U);
  EXPECT_EQ(output.satellites[0].stamp, kNoon + 1s);
  EXPECT_EQ(output.satellites[0].satellites.size(), 2U);
  EXPECT_EQ(output.satellites[0].satellites[0].cn0_dbhz, 41.0);
  EXPECT_EQ(output.satellites[1].stamp, kNoon + 2s);
  EXPECT_EQ(output.fixes.at(0).covariance_type, CovarianceType::kUnknown);
  EXPECT_EQ(output.fixes.at(1).covariance_type, CovarianceType::kKnown);
}

TEST(GpsdDecoder, ReportsOfOneTimeAreOneSolution) {
  const ReceiverOutput output = decode({tpv(0), sky(satellite(0, 5, 40) + "," + satellite(6, 1, 30)),
                                        tpv(0, R"("speed":2.0,"track":90.0)"), tpv(1), sky(satellite(0, 5, 41))});
  ASSERT_EQ(output.fixes.size(), 2U);
  ASSERT_EQ(output.velocities.size(), 1U);
  ASSERT_EQ(output.satellites.size(), 2U);
  EXPECT_EQ(output.fixes[0].stamp, kNoon);
  EXPECT_EQ(output.velocities[0].stamp, kNoon);
  EXPECT_EQ(output.satellites[0].stamp, kNoon);
  EXPECT_EQ(output.satellites[1].stamp, kNoon + 1s);
  EXPECT_EQ(output.fixes[0].position, (GeodeticPosition{37.5, -122.25, -25.5}));
  EXPECT_NEAR(output.velocities[0].velocity.x(), 2.0, 1e-12);
  EXPECT_FALSE(is_positive_definite<2>(output.velocities[0].covariance));
  ASSERT_EQ(output.satellites[0].satellites.size(), 2U);
  EXPECT_EQ(satellite_name(output.satellites[0].satellites[1].id), "R01");
  EXPECT_NEAR(output.satellites[0].satellites[0].look.azimuth_rad, degrees_to_radians(181.0), 1e-12);
  EXPECT_NEAR(output.satellites[0].angle_resolution_rad, degrees_to_radians(1.0), 1e-12);
  EXPECT_TRUE(output.warnings.empty());
}

TEST(GpsdDecoder, AGstTellsWhoseTheSatellitesBeforeItAre) {
  const auto gst = [](int second) {
    return R"({"class":"GST","device":"/dev/a",)" + at(second) + R"(,"lat":3.0,"lon":2.0,"alt":5.0})";
  };
  const ReceiverOutput output =
      decode({tpv(0), sky(satellite(0, 5, 40)), gst(0), tpv(1), sky(satellite(0, 5, 41)), gst(1), tpv(2)});
  ASSERT_EQ(output.satellites.size(), 2U);
  EXPECT_EQ(output.satellites[0].stamp, kNoon);
  EXPECT_EQ(output.satellites[0].satellites[0].cn0_dbhz, 40.0);
  EXPECT_EQ(output.satellites[1].stamp, kNoon + 1s);
  EXPECT_EQ(output.fixes.at(1).covariance_type, CovarianceType::kKnown);
}

TEST(GpsdDecoder, PartsOfASkyArePutTogether) {
  const ReceiverOutput output =
      decode({tpv(0), sky(satellite(0, 5, 40)), sky(satellite(0, 5, 38) + "," + satellite(2, 7, 33)),
              sky(satellite(2, 7, 35) + "," + satellite(2, 7, 20))});
  ASSERT_EQ(output.satellites.size(), 1U);
  ASSERT_EQ(output.satellites[0].satellites.size(), 2U);
  EXPECT_EQ(output.satellites[0].satellites[0].cn0_dbhz, 38.0);  // the newer
  EXPECT_EQ(output.satellites[0].satellites[1].cn0_dbhz, 35.0);
}

TEST(GpsdDecoder, OfSeveralSignalsTheFirstCounts) {
  const ReceiverOutput output =
      decode({tpv(0), sky(R"({"gnssid":0,"svid":1,"ss":40,"sigid":3},{"gnssid":0,"svid":1,"ss":30},)"
                          R"({"gnssid":0,"svid":2,"ss":0},{"gnssid":0,"svid":2,"ss":25,"sigid":3})")});
  EXPECT_EQ(output.satellites.at(0).satellites.at(0).cn0_dbhz, 30.0);
  EXPECT_EQ(output.satellites.at(0).satellites.at(1).cn0_dbhz, 25.0);
}

TEST(GpsdDecoder, ArrivalIsTheRobotsClock) {
  GpsdDecoder decoder;
  decoder.add(tpv(0), 100s);
  decoder.add(tpv(0), 100s + 300ms);
  decoder.settle();
  EXPECT_EQ(decoder.take().fixes.at(0).stamp, 100s);
  GpsdParameters utc;
  utc.stamps = GpsdStamps::kUtc;
  GpsdDecoder by_utc(utc);
  by_utc.add(tpv(0), 100s);
  by_utc.settle();
  EXPECT_EQ(by_utc.take().fixes.at(0).stamp, kNoon);
}

TEST(GpsdDecoder, WhatComesAfterSettlingIsNoSecondSolution) {
  GpsdDecoder decoder;
  decoder.add(tpv(0), 100s);
  decoder.settle();
  EXPECT_EQ(decoder.take().fixes.size(), 1U);
  decoder.add(tpv(0), 100s + 400ms);
  decoder.add(sky(satellite(0, 5, 40)), 100s + 400ms);  // its first satellites
  decoder.settle();
  const ReceiverOutput late = decoder.take();
  EXPECT_TRUE(late.fixes.empty());
  EXPECT_EQ(late.satellites.at(0).stamp, 100s);
  decoder.add(sky(satellite(0, 6, 40)), 100s + 900ms);  // before the next solution
  decoder.add(tpv(1), 101s);
  decoder.settle();
  const ReceiverOutput next = decoder.take();
  EXPECT_EQ(next.satellites.at(0).stamp, 101s);
  EXPECT_EQ(next.satellites.at(0).satellites.at(0).id.svid, 6);
}

TEST(GpsdDecoder, WithoutATimeTheArrivalTellsSolutionsApart) {
  GpsdDecoder decoder;
  for (const Stamp arrival : {Stamp(100s), Stamp(100s + 20ms), Stamp(101s), Stamp(101s + 20ms)}) {
    decoder.add(R"({"class":"TPV","mode":1})", arrival);
  }
  decoder.settle();
  const ReceiverOutput output = decoder.take();
  ASSERT_EQ(output.fixes.size(), 2U);
  EXPECT_FALSE(output.fixes[0].has_fix);
  EXPECT_TRUE(decode({R"({"class":"TPV","mode":1})"}).fixes.empty());
}

TEST(GpsdDecoder, TheCovarianceIsGstsElseOf95Percent) {
  const std::string gst = R"({"class":"GST","device":"/dev/a",)" + at(0) + R"(,"lat":3.0,"lon":2.0,"alt":5.0})";
  const RawFix declared = decode({tpv(0, R"("epx":20.0,"epy":20.0,"epv":20.0)"), gst}).fixes.at(0);
  EXPECT_EQ(declared.covariance_type, CovarianceType::kKnown);
  EXPECT_TRUE(declared.covariance.isApprox(Eigen::Vector3d(4.0, 9.0, 25.0).asDiagonal().toDenseMatrix()));
  EXPECT_NEAR(sigma_east({tpv(0, R"("epx":19.6,"epy":9.8,"epv":9.8)")}), 10.0, 1e-3);
  EXPECT_NEAR(sigma_east({tpv(0, R"("eph":24.477)")}), 10.0, 1e-3);
  EXPECT_NEAR(sigma_east({tpv(0), sky(satellite(0, 5, 40))}), GpsdParameters().noise.range_sigma * 2.0 / std::sqrt(2.0),
              1e-9);
  EXPECT_EQ(decode({tpv(0)}).fixes.at(0).covariance_type, CovarianceType::kUnknown);
}

TEST(GpsdDecoder, UbloxDeclaresOneSigma) {
  const std::string devices = R"({"class":"DEVICES","devices":[{"class":"DEVICE","path":"/dev/a","driver":"u-blox"}]})";
  const std::string report = tpv(0, R"("eph":3.0,"epv":4.0,"epx":50.0,"epy":50.0,"eps":0.2,"speed":1.0,"track":0.0)");
  const ReceiverOutput output = decode({devices, report});
  EXPECT_NEAR(output.fixes.at(0).covariance(0, 0), 4.5, 1e-9);
  EXPECT_NEAR(output.velocities.at(0).covariance(0, 0), 0.04, 1e-9);
  EXPECT_GT(decode({report}).fixes.at(0).covariance(0, 0), 100.0);
}

TEST(GpsdDecoder, WhatIsNoFix) {
  EXPECT_FALSE(decode({R"({"class":"TPV","mode":1,)" + at(0) + R"(,"lat":37.5,"lon":-122.25})"}).fixes.at(0).has_fix);
  EXPECT_FALSE(decode({tpv(0, R"("status":5)")}).fixes.at(0).has_fix);
  EXPECT_FALSE(decode({tpv(0, R"("status":8)")}).fixes.at(0).has_fix);
  EXPECT_TRUE(decode({tpv(0, R"("status":6)")}).fixes.at(0).has_fix);  // with satellites
  EXPECT_FALSE(decode({R"({"class":"TPV","mode":3,)" + at(0) + R"(,"lat":97.5,"lon":-122.25})"}).fixes.at(0).has_fix);
  const RawFix flat =
      decode({R"({"class":"TPV","mode":2,)" + at(0) + R"(,"lat":37.5,"lon":-122.25,"altHAE":3})"}).fixes.at(0);
  EXPECT_TRUE(flat.has_fix);
  EXPECT_TRUE(std::isnan(flat.position.altitude_m));
}

TEST(GpsdDecoder, OfSeveralDevicesOneIsUsed) {
  const std::string other = R"({"class":"TPV","device":"/dev/b","mode":3,)" + at(1) + R"(,"lat":1.0,"lon":2.0})";
  const ReceiverOutput first = decode({tpv(0), other, tpv(1)});
  EXPECT_EQ(first.fixes.size(), 2U);
  EXPECT_THAT(first.warnings.at(0), HasSubstr("/dev/b"));
  GpsdParameters parameters;
  parameters.device = "/dev/b";
  const ReceiverOutput named = decode({tpv(0), other, tpv(1)}, parameters);
  ASSERT_EQ(named.fixes.size(), 1U);
  EXPECT_EQ(named.fixes[0].position.latitude_deg, 1.0);
}

TEST(GpsdDecoder, ResidualsAreThoseOfUsedSatellites) {
  const ReceiverOutput output = decode(
      {tpv(0), sky(R"({"gnssid":0,"svid":1,"az":1,"el":2,"ss":30,"used":true,"prRes":-1.5},)"
                   R"({"gnssid":0,"svid":2,"az":1,"el":2,"ss":30,"used":false,"prRes":0.0},)"
                   R"({"PRN":75,"az":1,"el":2,"ss":30,"used":false},{"gnssid":9,"svid":2},{"gnssid":0,"svid":0},7)")});
  const auto& satellites = output.satellites.at(0).satellites;
  ASSERT_EQ(satellites.size(), 3U);
  EXPECT_EQ(satellites[0].residual_m, -1.5);
  EXPECT_TRUE(std::isnan(satellites[1].residual_m));
  EXPECT_EQ(satellite_name(satellites[2].id), "R11");  // gpsd before 3.19
}

TEST(GpsdDecoder, TellsWhatGpsdSays) {
  GpsdDecoder decoder;
  decoder.add(R"({"class":"VERSION","release":"3.22","proto_major":3,"proto_minor":14})");
  EXPECT_EQ(decoder.release(), "3.22");
  EXPECT_TRUE(decoder.take().warnings.empty());
  decoder.add(R"({"class":"ERROR","message":"Can't parse"})");
  EXPECT_THAT(decoder.take().warnings.at(0), HasSubstr("Can't parse"));
  decoder.add(R"({"class":"VERSION","release":"9.1","proto_major":4})");
  EXPECT_THAT(decoder.take().warnings.at(0), HasSubstr("protocol 4"));
}

TEST(GpsdDecoder, AnyBytesAreTaken) {
  std::mt19937 random(4);
  const std::vector<std::string> seeds{tpv(0, R"("speed":2.0,"track":90.0,"epx":1.0,"epy":2.0)"),
                                       tpv(1),
                                       sky(satellite(0, 5, 40)),
                                       "",
                                       "{",
                                       "[]",
                                       "null",
                                       R"({"class":7})",
                                       R"({"class":"TPV","mode":"3","lat":[],"lon":1e999})",
                                       R"({"class":"SKY","satellites":{"a":1}})",
                                       R"({"class":"DEVICES","devices":[1,{}]})"};
  GpsdDecoder decoder;
  Stamp arrival{0};
  for (int i = 0; i < 20000; ++i) {
    std::string line = seeds[random() % seeds.size()];
    if (!line.empty() && random() % 2 == 0) line[random() % line.size()] = static_cast<char>(random() % 256);
    if (random() % 8 == 0) line.resize(random() % (line.size() + 1));
    decoder.add(line, arrival += 9ms);
    if (random() % 8 == 0) decoder.settle();
    const ReceiverOutput output = decoder.take();
    for (const RawFix& fix : output.fixes) {
      EXPECT_TRUE(fix.covariance.allFinite());
      EXPECT_FALSE(fix.has_fix && std::abs(fix.position.latitude_deg) > 90.0);
      EXPECT_FALSE(std::isinf(fix.position.altitude_m));
    }
    for (const RawVelocity& velocity : output.velocities) EXPECT_TRUE(velocity.velocity.allFinite());
  }
}

}  // namespace
}  // namespace urban_gnss
