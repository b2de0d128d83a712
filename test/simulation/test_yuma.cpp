#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "urban_gnss_localization/simulation/yuma.hpp"

namespace urban_gnss {
namespace {

using std::chrono::hours;
using std::chrono::seconds;

/// The algorithm of IS-GPS-200, table 20-IV, for an almanac, step by step. Time is GPS seconds of the almanac's week.
Eigen::Vector3d is_gps_200(double toa, double e, double i, double node_rate, double root_a, double node_at_week,
                           double perigee, double m0, double t) {
  const double a = root_a * root_a;
  const double tk = t - toa;
  const double m = m0 + std::sqrt(3.986005e14 / std::pow(a, 3)) * tk;
  double anomaly = m;
  for (int k = 0; k < 200; ++k) anomaly = m + e * std::sin(anomaly);
  const double v = 2.0 * std::atan(std::sqrt((1.0 + e) / (1.0 - e)) * std::tan(anomaly / 2.0));
  const double u = v + perigee;
  const double r = a * (1.0 - e * std::cos(anomaly));
  const double node = node_at_week + (node_rate - 7.2921151467e-5) * tk - 7.2921151467e-5 * toa;
  const Eigen::Matrix3d rotation =
      (Eigen::AngleAxisd(node, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(i, Eigen::Vector3d::UnitX()) *
       Eigen::AngleAxisd(u, Eigen::Vector3d::UnitZ()))
          .toRotationMatrix();
  return r * rotation.col(0);
}

/// Two blocks in the form of the US Coast Guard's files, the second unhealthy.
std::string almanac_text(const std::string& week = "377", const std::string& health = "063") {
  return "******** Week  377 almanac for PRN-01 ********\r\n"
         "ID:                         01\r\n"
         "Health:                     000\r\n"
         "Eccentricity:               0.6597995758E-002\r\n"
         "Time of Applicability(s):  319488.0000\r\n"
         "Orbital Inclination(rad):   0.9893061549\r\n"
         "Rate of Right Ascen(r/s):  -0.7508884204E-008\r\n"
         "SQRT(A)  (m 1/2):           5153.683594\r\n"
         "Right Ascen at Week(rad):  -0.5644326501E+000\r\n"
         "Argument of Perigee(rad):  -1.781409342\r\n"
         "Mean Anom(rad):             0.4668447322E+000\r\n"
         "Af0(s):                     0.8964538574E-004\r\n"
         "Af1(s/s):                   0.3637978807E-011\r\n"
         "week:                        " +
         week +
         "\r\n\r\n"
         "******** Week 377 almanac for PRN-02 ********\n"
         "ID: 02\nHealth: " +
         health +
         "\nEccentricity: 0.02\nTime of Applicability(s): 61440\nOrbital Inclination(rad): 0.96\n"
         "Rate of Right Ascen(r/s): -8.0E-9\nSQRT(A)  (m 1/2): 5153.6\nRight Ascen at TOA(rad): 2.5\n"
         "Argument of Perigee(rad): 0.5\nMean Anom(rad): -2.0\nweek: " +
         week + "\n";
}

constexpr Stamp kGpsEpoch = seconds(315964800);
constexpr Stamp kWeek = hours(7 * 24);

std::vector<OrbitingSatellite> read(const std::string& text, Stamp near = kGpsEpoch + 2425 * kWeek) {
  std::istringstream in(text);
  return read_yuma(in, "almanac.alm", near);
}

std::string error_of(const std::string& text) {
  try {
    read(text);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no error";
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(Yuma, PositionsAreThoseOfTheInterfaceSpecification) {
  const auto satellites = read(almanac_text("377", "000"));
  ASSERT_EQ(satellites.size(), 2u);
  EXPECT_EQ(satellite_name(satellites[0].id), "G01");
  for (double t = -400000.0; t < 1000000.0; t += 12345.6) {
    const Stamp utc = kGpsEpoch + (377 + 2048) * kWeek + from_seconds(t - 18.0);
    const Eigen::Vector3d first = is_gps_200(319488.0, 0.6597995758e-2, 0.9893061549, -0.7508884204e-8, 5153.683594,
                                             -0.5644326501, -1.781409342, 0.4668447322, t);
    const Eigen::Vector3d second = is_gps_200(61440.0, 0.02, 0.96, -8e-9, 5153.6, 2.5, 0.5, -2.0, t);
    ASSERT_LT((ecef_position(satellites[0].orbit, utc) - first).norm(), 1e-3) << t;
    ASSERT_LT((ecef_position(satellites[1].orbit, utc) - second).norm(), 1e-3) << t;
  }
}

TEST(Yuma, UnhealthySatellitesAreLeftOut) {
  EXPECT_EQ(read(almanac_text()).size(), 1u);
  EXPECT_EQ(read(almanac_text("377", "1")).size(), 1u);
  EXPECT_EQ(read(almanac_text("377", "0")).size(), 2u);
}

TEST(Yuma, WeekIsTheNearestOfItsEra) {
  const auto week_of = [](int week, int near) {
    const auto satellites = read(almanac_text(std::to_string(week)), kGpsEpoch + near * kWeek + hours(1));
    return (satellites.at(0).orbit.reference - kGpsEpoch) / kWeek;
  };
  EXPECT_EQ(week_of(377, 377), 377);
  EXPECT_EQ(week_of(377, 1401), 1401);
  EXPECT_EQ(week_of(377, 2425), 2425);
  EXPECT_EQ(week_of(377, 2425 - 500), 2425);
  EXPECT_EQ(week_of(377, 2425 - 520), 1401);
  EXPECT_EQ(week_of(1023, 2048), 2047);  // the last week of an era, read in the first of the next
  EXPECT_EQ(week_of(0, 2047), 2048);
  EXPECT_EQ(week_of(2200, 1176), 2200);  // a whole week number
  EXPECT_EQ(week_of(900, 10), 900);      // nothing is before 1980
}

TEST(Yuma, BadLinesAreNamed) {
  const std::string good = almanac_text();
  const auto error_with = [&](const std::string& from, const std::string& to) {
    return error_of(replaced(good, from, to));
  };
  EXPECT_EQ(error_of(good), "no error");
  EXPECT_EQ(error_with("0.9893061549", "0.98x"),
            "almanac.alm:6: orbital inclination = \"0.98x\": must be a number from 0 to 3.14159");
  EXPECT_EQ(error_with("0.9893061549", ""),
            "almanac.alm:6: orbital inclination = \"\": must be a number from 0 to 3.14159");
  EXPECT_EQ(error_with("0.9893061549", "nan").rfind("almanac.alm:6: ", 0), 0u);
  EXPECT_EQ(error_with("5153.683594", "26560000").rfind("almanac.alm:8: sqrt(a)", 0), 0u);
  EXPECT_EQ(error_with("0.6597995758E-002", "1.0").rfind("almanac.alm:4: eccentricity", 0), 0u);
  EXPECT_EQ(error_with("Health:                     000", "Health: 0.5"),
            "almanac.alm:3: health = \"0.5\": must be a whole number from 0 to 255");
  EXPECT_EQ(error_with("377\r\n\r\n", "8192\r\n\r\n"),
            "almanac.alm:14: week = \"8192\": must be a whole number from 0 to 8191");
  EXPECT_EQ(error_with("Health: 063", "Health 063"),
            "almanac.alm:18: \"Health 063\" is not of the form \"name: value\"");
  EXPECT_EQ(error_with("Mean Anom", "Mean Anomoly of Moon").substr(0, 15), "no error");  // known by its beginning
  EXPECT_EQ(error_with("Eccentricity", "Excentricity"),
            "almanac.alm:4: \"Excentricity\" is no field of a YUMA almanac");
  EXPECT_EQ(error_with("ID: 02\n", "ID: 02\nID: 02\n"), "almanac.alm:18: id comes twice in this block");
  EXPECT_EQ(error_with("ID: 02\n", "ID: 01\n"), "almanac.alm:16: satellite 1 comes twice");
  EXPECT_EQ(error_with("Mean Anom(rad): -2.0\n", ""), "almanac.alm:16: the block has no field \"mean anom\"");
  EXPECT_EQ(error_of("ID: 01\n" + good), "almanac.alm:1: \"ID: 01\" stands before the first heading of asterisks");
  EXPECT_EQ(error_of("\n\n"), "almanac.alm:2: is no YUMA almanac: it has no heading of asterisks");
  EXPECT_EQ(error_of("******** Week 377\n"), "almanac.alm:1: the block has no field \"id\"");
  EXPECT_THROW(read_yuma_file("/nonexistent/almanac.alm", Stamp(0)), std::runtime_error);
}

}  // namespace
}  // namespace urban_gnss
