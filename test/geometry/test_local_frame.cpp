#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "urban_gnss_localization/geometry/local_frame.hpp"

namespace urban_gnss {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// The datums that break projections and zones: each quadrant, the 180° meridian from both sides, poles, zone borders.
const GeodeticPosition kDatums[] = {{33.89, 130.84, 30.0},   {-33.86, 151.21, 20.0},  {40.71, -74.01, 10.0},
                                    {-22.91, -43.17, 5.0},   {-16.8, 179.99999, 0.0}, {-16.8, -179.99999, 0.0},
                                    {-16.8, 180.0, 0.0},     {-16.8, -180.0, 0.0},    {0.0, 0.0, 0.0},
                                    {89.9999, 45.0, 100.0},  {90.0, 0.0, 0.0},        {-90.0, 0.0, 2835.0},
                                    {-89.9999, -120.0, 0.0}, {60.0, 6.0, 0.0},        {84.0, 12.0, -50.0}};

double distance(const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return (a - b).norm(); }

std::string fault_of(const GeodeticPosition& datum) {
  try {
    LocalFrame frame(datum);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(LocalFrame, DatumIsTheOrigin) {
  for (const GeodeticPosition& datum : kDatums) {
    EXPECT_LT(LocalFrame(datum).to_local(datum).norm(), 1e-8) << datum.latitude_deg << ' ' << datum.longitude_deg;
  }
}

TEST(LocalFrame, RoundTripsFromMetresToMetres) {
  for (const GeodeticPosition& datum : kDatums) {
    const LocalFrame frame(datum);
    for (const double east : {-20000.0, -1.0, 0.0, 350.0}) {
      for (const double north : {-500.0, 0.0, 1.0, 20000.0}) {
        const Eigen::Vector3d enu(east, north, 12.0);
        const GeodeticPosition position = frame.to_geodetic(enu);
        EXPECT_LT(distance(frame.to_local(position), enu), 1e-6) << datum.latitude_deg << ' ' << datum.longitude_deg;
        EXPECT_TRUE(is_latitude(position.latitude_deg));
        EXPECT_TRUE(is_longitude(position.longitude_deg));
      }
    }
  }
}

TEST(LocalFrame, EastNorthAndUpHaveTheirSignsInAllQuadrants) {
  for (const double latitude : {-45.0, 45.0}) {
    for (const double longitude : {-135.0, -45.0, 45.0, 135.0}) {
      const LocalFrame frame({latitude, longitude, 0.0});
      EXPECT_GT(frame.to_local({latitude, longitude + 0.001, 0.0}).x(), 70.0);
      EXPECT_LT(frame.to_local({latitude, longitude - 0.001, 0.0}).x(), -70.0);
      EXPECT_GT(frame.to_local({latitude + 0.001, longitude, 0.0}).y(), 110.0);
      EXPECT_LT(frame.to_local({latitude - 0.001, longitude, 0.0}).y(), -110.0);
      EXPECT_NEAR(frame.to_local({latitude, longitude, 7.0}).z(), 7.0, 1e-8);
    }
  }
}

// A millionth of a degree along the meridian and along the parallel, from the ellipsoid's radii of curvature
// M = a (1 - e^2) / (1 - e^2 sin^2)^(3/2) and N = a / sqrt(1 - e^2 sin^2).
TEST(LocalFrame, LengthsAreThoseOfTheEllipsoid) {
  constexpr double kRadius = 6378137.0;
  constexpr double kFlattening = 1.0 / 298.257223563;
  constexpr double kEccentricity2 = kFlattening * (2.0 - kFlattening);
  constexpr double kRadians = 3.14159265358979323846 / 180.0;
  for (const double latitude : {-70.0, -33.0, 0.0, 10.0, 51.0}) {
    const double sine = std::sin(latitude * kRadians);
    const double w = 1.0 - kEccentricity2 * sine * sine;
    const double per_degree_north = kRadians * kRadius * (1.0 - kEccentricity2) / std::pow(w, 1.5);
    const double per_degree_east = kRadians * kRadius / std::sqrt(w) * std::cos(latitude * kRadians);
    const LocalFrame frame({latitude, 100.0, 0.0});
    EXPECT_NEAR(frame.to_local({latitude + 1e-4, 100.0, 0.0}).y(), 1e-4 * per_degree_north, 1e-4);
    EXPECT_NEAR(frame.to_local({latitude, 100.0 + 1e-4, 0.0}).x(), 1e-4 * per_degree_east, 1e-6);
  }
}

TEST(LocalFrame, NothingHappensAtTheDateLine) {
  const LocalFrame east({-16.8, 179.9999, 0.0});
  const Eigen::Vector3d across = east.to_local({-16.8, -179.9999, 0.0});
  EXPECT_NEAR(across.x(), 21.3, 0.1);
  EXPECT_NEAR(across.y(), 0.0, 1e-3);
  EXPECT_LT(distance(LocalFrame({-16.8, 180.0, 0.0}).to_local({-16.8, -180.0, 0.0}), Eigen::Vector3d::Zero()), 1e-8);
  EXPECT_NEAR(LocalFrame({-16.8, -179.9999, 0.0}).to_local({-16.8, 179.9999, 0.0}).x(), -across.x(), 1e-6);
}

TEST(LocalFrame, CrossesThePoleStraight) {
  const LocalFrame frame({89.9999, 30.0, 0.0});  // 11.17 m from the pole
  const Eigen::Vector3d pole = frame.to_local({90.0, 30.0, 0.0});
  const Eigen::Vector3d beyond = frame.to_local({89.9999, -150.0, 0.0});
  EXPECT_NEAR(pole.y(), 11.17, 0.01);
  EXPECT_NEAR(beyond.y(), 2.0 * pole.y(), 1e-6);
  EXPECT_NEAR(beyond.x(), 0.0, 1e-6);
  // At the pole itself every longitude is the same place, and the datum's longitude gives the axes.
  const LocalFrame at_pole({90.0, 0.0, 0.0});
  EXPECT_LT(distance(at_pole.to_local({90.0, 77.0, 0.0}), Eigen::Vector3d::Zero()), 1e-8);
  EXPECT_LT(at_pole.to_local({89.9999, 0.0, 0.0}).y(), -11.0);
  EXPECT_GT(at_pole.to_local({89.9999, 90.0, 0.0}).x(), 11.0);
}

TEST(LocalFrame, DatumThatIsNoPlaceIsRefusedByName) {
  EXPECT_NE(fault_of({91.0, 0.0, 0.0}).find("latitude = 91"), std::string::npos);
  EXPECT_NE(fault_of({kNaN, 0.0, 0.0}).find("latitude"), std::string::npos);
  EXPECT_NE(fault_of({0.0, 180.5, 0.0}).find("longitude = 180.5"), std::string::npos);
  EXPECT_NE(fault_of({0.0, -kInfinity, 0.0}).find("longitude"), std::string::npos);
  EXPECT_NE(fault_of({0.0, 0.0, kNaN}).find("altitude"), std::string::npos);
  EXPECT_NE(fault_of({0.0, 0.0, 2e7}).find("altitude"), std::string::npos);
  EXPECT_EQ(fault_of({90.0, 180.0, 0.0}), "");
  EXPECT_EQ(fault_of({-90.0, -180.0, -400.0}), "");

  const std::string all = fault_of({-91.0, 500.0, kNaN});
  for (const char* field : {"latitude", "longitude", "altitude"}) EXPECT_NE(all.find(field), std::string::npos) << all;
}

TEST(LocalFrame, WhatIsNoPlaceConvertsToNaNAndDoesNotThrow) {
  const LocalFrame frame({33.89, 130.84, 30.0});
  for (const GeodeticPosition& position :
       {GeodeticPosition{kNaN, 0.0, 0.0}, GeodeticPosition{0.0, kNaN, 0.0}, GeodeticPosition{0.0, 0.0, kNaN},
        GeodeticPosition{90.1, 0.0, 0.0}, GeodeticPosition{kInfinity, 0.0, 0.0}, GeodeticPosition{0.0, kInfinity, 0.0},
        GeodeticPosition{0.0, 0.0, -kInfinity}}) {
    EXPECT_TRUE(frame.to_local(position).array().isNaN().all());
  }
  for (const double value : {kNaN, kInfinity, -kInfinity}) {
    const GeodeticPosition position = frame.to_geodetic({0.0, value, 0.0});
    EXPECT_TRUE(std::isnan(position.latitude_deg) && std::isnan(position.longitude_deg));
    EXPECT_TRUE(std::isnan(position.altitude_m));
  }
}

// East of one place is, in the frame of another, where a step to the east leads.
TEST(LocalFrame, ConvergenceTurnsEastIntoTheFrame) {
  for (const double latitude_deg : {-70.0, -33.0, 0.0, 48.0, 65.0, 89.0}) {
    const LocalFrame frame({latitude_deg, 179.9, 100.0});
    EXPECT_NEAR(frame.convergence_rad(frame.datum()), 0.0, 1e-12);
    for (const double east_deg : {-2.0, 0.01, 1.0}) {
      GeodeticPosition place{latitude_deg + 0.3, 179.9 + east_deg, 50.0};
      const Eigen::Vector3d here = frame.to_local(place);
      place.longitude_deg += 1e-6;
      const Eigen::Vector3d step = frame.to_local(place) - here;
      EXPECT_NEAR(frame.convergence_rad({latitude_deg + 0.3, 179.9 + east_deg, 50.0}), std::atan2(step.y(), step.x()),
                  1e-5);
    }
  }
  const LocalFrame far({65.0, 20.0, 0.0});  // 90 km east of the datum
  EXPECT_NEAR(far.convergence_rad({65.0, 21.91, 0.0}), 0.03, 0.001);
  EXPECT_EQ(far.convergence_rad({std::nan(""), 0.0, 0.0}), 0.0);
}

}  // namespace
}  // namespace urban_gnss
