#include <gtest/gtest.h>

#include <limits>

#include "satellite_sky.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(Satellite, HasADirectionFromTheHorizonToTheZenith) {
  SatelliteObservation s = satellite(1, 10.0, 30.0);
  for (const LookAngles& look :
       {LookAngles{0.0, 0.0}, LookAngles{-1.0, 0.5 * kPi}, LookAngles{7.0, static_cast<double>(0.5F * 3.14159265F)}}) {
    s.look = look;
    EXPECT_TRUE(has_direction(s)) << look.azimuth_rad << ", " << look.elevation_rad;
  }
  for (const LookAngles& look :
       {LookAngles{0.0, -1e-9}, LookAngles{0.0, 1.58}, LookAngles{0.0, 45.0}, LookAngles{0.0, kNaN},
        LookAngles{0.0, kInfinity}, LookAngles{kNaN, 0.5}, LookAngles{kInfinity, 0.5}}) {
    s.look = look;
    EXPECT_FALSE(has_direction(s)) << look.azimuth_rad << ", " << look.elevation_rad;
  }
}

TEST(Satellite, IsReceivedWithDirectionAndSignal) {
  SatelliteObservation s = satellite(1, 10.0, 30.0);
  for (const double cn0 : {kNaN, kInfinity, 0.0, -3.0}) {
    s.cn0_dbhz = cn0;
    EXPECT_FALSE(has_cn0(s)) << cn0;
    EXPECT_FALSE(is_received(s)) << cn0;
  }
  s.cn0_dbhz = 30.0;
  EXPECT_TRUE(is_received(s));
  s.tracked = false;
  EXPECT_FALSE(is_received(s));
  s.tracked = true;
  s.look.elevation_rad = -0.1;
  EXPECT_FALSE(is_received(s));
}

}  // namespace
}  // namespace urban_gnss
