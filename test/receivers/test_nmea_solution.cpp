#include <gmock/gmock.h>

#include "nmea_text.hpp"
#include "urban_gnss_localization/common/positive_definite.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/receivers/nmea_decoder.hpp"
#include "urban_gnss_localization/receivers/nmea_solution.hpp"

namespace urban_gnss {
namespace {

const std::string kPlace = "3725.5,N,12205.5,W,";
const std::string kGga = "GNGGA,120000," + kPlace + "1,12,2.0,4.4,M,-30.0,M,,";
const std::string kRmc = "GNRMC,120000,A," + kPlace + "10.0,90.0,070220,,,A";

ReceiverOutput decode(const std::vector<std::string>& bodies, const NmeaParameters& parameters = {}) {
  NmeaDecoder decoder(parameters);
  for (const std::string& body : bodies) decoder.add(nmea(body), Stamp(1));
  decoder.finish();
  return decoder.take();
}
RawFix fix_of(const std::vector<std::string>& bodies, const NmeaParameters& parameters = {}) {
  return decode(bodies, parameters).fixes.at(0);
}
std::string gga_of_quality(const std::string& quality) {
  return "GNGGA,120000," + kPlace + quality + ",12,2.0,4.4,M,-30.0,M,,";
}
double sigma_east(const RawFix& fix) { return std::sqrt(fix.covariance(0, 0)); }

TEST(NmeaSolution, ThereIsAFixWhereOneAffirmsAndNoneDenies) {
  EXPECT_TRUE(fix_of({kGga, kRmc}).has_fix);
  EXPECT_TRUE(fix_of({kGga}).has_fix);
  EXPECT_TRUE(fix_of({kRmc}).has_fix);
  EXPECT_TRUE(fix_of({"GNGLL," + kPlace + "120000,A,A"}).has_fix);
  EXPECT_TRUE(fix_of({"GNGNS,120000," + kPlace + "AN,05,1.3,156.9,8.3,,"}).has_fix);
  EXPECT_FALSE(fix_of({gga_of_quality("0"), kRmc}).has_fix);
  EXPECT_FALSE(fix_of({kGga, "GNRMC,120000,V," + kPlace + "0.0,0.0,070220,,,A"}).has_fix);
  EXPECT_FALSE(fix_of({kGga, "GNRMC,120000,A," + kPlace + "0.0,0.0,070220,,,N"}).has_fix);
  EXPECT_FALSE(fix_of({kGga, "GNGLL," + kPlace + "120000,V,N"}).has_fix);
  EXPECT_FALSE(fix_of({"GNGNS,120000," + kPlace + "NNN,00,,,,,"}).has_fix);
  EXPECT_FALSE(fix_of({gga_of_quality("")}).has_fix);                      // nobody says that there is one
  EXPECT_FALSE(fix_of({"GNGGA,120000,,,,,1,12,2.0,4.4,M,,M,,"}).has_fix);  // without a place
}

TEST(NmeaSolution, WhatIsReckonedToldOrSimulatedIsNoFix) {
  for (const char* quality : {"6", "7", "8"}) EXPECT_FALSE(fix_of({gga_of_quality(quality), kRmc}).has_fix) << quality;
  for (const char* mode : {"E", "M", "S"}) {
    EXPECT_FALSE(fix_of({"GNRMC,120000,A," + kPlace + "0.0,0.0,070220,,," + mode}).has_fix) << mode;
  }
  EXPECT_THAT(decode({gga_of_quality("6")}).warnings.at(0), testing::HasSubstr("quality 6"));
  EXPECT_TRUE(decode({gga_of_quality("6"), kRmc}).velocities.empty());
  NmeaParameters bench;
  bench.accept_simulated = true;
  EXPECT_TRUE(fix_of({gga_of_quality("8")}, bench).has_fix);
}

TEST(NmeaSolution, RmcAloneHasNeitherAltitudeNorSigma) {
  const RawFix fix = fix_of({kRmc});
  EXPECT_TRUE(std::isnan(fix.position.altitude_m));
  EXPECT_EQ(fix.covariance_type, CovarianceType::kUnknown);
}

TEST(NmeaSolution, AltitudeIsAboveTheEllipsoidAndUnknownIn2d) {
  EXPECT_DOUBLE_EQ(fix_of({kRmc, kGga}).position.altitude_m, -25.6);
  EXPECT_TRUE(std::isnan(fix_of({kGga, "GPGSA,A,2,05,12,30,,,,,,,,,,2.0,2.0,0.0"}).position.altitude_m));
  const ReceiverOutput without = decode({"GNGGA,120000," + kPlace + "1,12,2.0,4.4,M,,M,,"});
  EXPECT_DOUBLE_EQ(without.fixes.at(0).position.altitude_m, 4.4);
  EXPECT_THAT(without.warnings.at(0), testing::HasSubstr("geoid"));
}

TEST(NmeaSolution, SigmaIsProportionalToHdopAndNotItsSquare) {
  const NmeaParameters defaults;
  const RawFix fix = fix_of({kGga, "GNGSA,A,3,13,,,,,,,,,,,,2.8,2.0,1.5"});
  EXPECT_EQ(fix.covariance_type, CovarianceType::kApproximated);
  EXPECT_DOUBLE_EQ(sigma_east(fix), defaults.noise.range_sigma * 2.0 / std::sqrt(2.0));
  EXPECT_DOUBLE_EQ(std::sqrt(fix.covariance(2, 2)), defaults.noise.range_sigma * 1.5);
  EXPECT_LT(sigma_east(fix_of({gga_of_quality("2")})), sigma_east(fix));
  EXPECT_LT(sigma_east(fix_of({gga_of_quality("5")})), sigma_east(fix_of({gga_of_quality("2")})));
  EXPECT_LT(sigma_east(fix_of({gga_of_quality("4")})), sigma_east(fix_of({gga_of_quality("5")})));
  for (const char* hdop : {"99.99", "0.0", "", "-1"}) {
    const RawFix unknown = fix_of({"GNGGA,120000," + kPlace + "1,12," + hdop + ",4.4,M,-30.0,M,,"});
    EXPECT_EQ(unknown.covariance_type, CovarianceType::kUnknown) << hdop;
  }
}

TEST(NmeaSolution, GstIsTheCovariance) {
  const RawFix axes = fix_of({kGga, "GNGST,120000.00,20,,,,2.0,3.0,4.0"});
  EXPECT_EQ(axes.covariance_type, CovarianceType::kKnown);
  EXPECT_TRUE(axes.covariance.isApprox(Eigen::Vector3d(9.0, 4.0, 16.0).asDiagonal().toDenseMatrix()));
  // An ellipse with its major axis to the north-east.
  const double side = std::sqrt((9.0 + 1.0) / 2.0);
  const std::string sides = std::to_string(side);
  const RawFix ellipse = fix_of({kGga, "GNGST,120000.00,20,3.0,1.0,45.0," + sides + "," + sides + ",4.0"});
  EXPECT_NEAR(ellipse.covariance(0, 0), 5.0, 1e-9);
  EXPECT_NEAR(ellipse.covariance(1, 1), 5.0, 1e-9);
  EXPECT_NEAR(ellipse.covariance(0, 1), 4.0, 1e-9);
  // An ellipse that has nothing to do with the sigmas: these count.
  const RawFix contradiction = fix_of({kGga, "GNGST,120000.00,20,0.3,0.1,45.0,2.0,3.0,4.0"});
  EXPECT_NEAR(contradiction.covariance(0, 0), 9.0, 1e-9);
  EXPECT_NEAR(contradiction.covariance(0, 1), 0.0, 1e-9);
}

TEST(NmeaSolution, AGstThatSaysNothingLeavesTheDop) {
  for (const char* gst : {",,,,,,", "0,0,0,0,0,0,0", "20,,,,-1,3,4", "20,,,,1e9,3,4", "20,,,,99999999,3,4"}) {
    EXPECT_EQ(fix_of({kGga, std::string("GNGST,120000.00,") + gst}).covariance_type, CovarianceType::kApproximated)
        << gst;
  }
}

TEST(NmeaSolution, ADeclaredSigmaHasAFloor) {
  const RawFix fix = fix_of({kGga, "GNGST,120000.00,1,0.001,0.0001,30.0,0.001,0.0005,0.001"});
  const NmeaParameters defaults;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(fix.covariance);
  EXPECT_GE(std::sqrt(axes.eigenvalues().x()), 0.999 * defaults.noise.sigma_floor);
}

TEST(NmeaSolution, GstOfAnotherTimeIsOfAnotherSolution) {
  EXPECT_EQ(fix_of({kGga, "GNGST,120001.00,20,,,,2.0,3.0,4.0"}).covariance_type, CovarianceType::kApproximated);
}

TEST(NmeaSolution, VelocityIsSpeedAndCourse) {
  const auto velocity = [](const std::string& speed_and_course) {
    return decode({"GNRMC,120000,A," + kPlace + speed_and_course + ",070220,,,A"}).velocities;
  };
  EXPECT_NEAR(velocity("10.0,180.0").at(0).velocity.y(), -10.0 * 1852.0 / 3600.0, 1e-12);
  const double course = degrees_to_radians(30.0);
  EXPECT_TRUE(
      velocity("3.6,30.0").at(0).velocity.isApprox(1.852 * Eigen::Vector2d(std::sin(course), std::cos(course))));
  EXPECT_TRUE(velocity(",").empty());
  EXPECT_TRUE(velocity("9.9,").empty());        // fast without a course
  EXPECT_TRUE(velocity("99999,30.0").empty());  // no robot
  EXPECT_TRUE(velocity("-1,30.0").empty());
}

TEST(NmeaSolution, StandingHasNoCourse) {
  const RawVelocity standing = decode({"GNRMC,120000,A," + kPlace + "0.4,,070220,,,A"}).velocities.at(0);
  EXPECT_EQ(standing.velocity, Eigen::Vector2d::Zero());
  EXPECT_NEAR(std::sqrt(standing.covariance(0, 0)), 0.4 * 1852.0 / 3600.0, 1e-12);
  EXPECT_TRUE(is_positive_definite<2>(standing.covariance));
}

TEST(NmeaSolution, VtgCountsWhereRmcIsMissing) {
  const double expected = 5.5 * 1852.0 / 3600.0;
  for (const char* vtg : {"GPVTG,90.0,T,,M,5.5,N,10.2,K,A", "GPVTG,90.0,T,,M,5.5,N,10.2,K",
                          "GPVTG,90.0,T,,,5.5,N,10.2,K,A", "GPVTG,90.0,88.0,5.5,10.2"}) {
    EXPECT_NEAR(decode({kGga, vtg}).velocities.at(0).velocity.x(), expected, 1e-9) << vtg;
  }
  EXPECT_NEAR(decode({kGga, "GPVTG,90.0,T,,M,,N,36.0,K,A"}).velocities.at(0).velocity.x(), 10.0, 1e-9);
  EXPECT_NEAR(decode({kGga, kRmc, "GPVTG,0.0,T,,M,1.0,N,,K,A"}).velocities.at(0).velocity.x(), 10.0 * 1852.0 / 3600.0,
              1e-9);
}

}  // namespace
}  // namespace urban_gnss
