#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <fstream>
#include <map>
#include <sstream>

#include "matchers.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"
#include "urban_gnss_localization/simulation/constellation.hpp"

namespace urban_gnss {
namespace {

using std::chrono::hours;
using std::chrono::seconds;

const GeodeticPosition kBerlin{52.52, 13.405, 34.0};
constexpr Stamp kNoon2024 = seconds(1718452800);  // 2024-06-15 12:00 UTC

std::vector<OrbitingSatellite> all_satellites() {
  std::vector<OrbitingSatellite> all = gps_baseline();
  for (const auto& more : {galileo_reference(), glonass_nominal()}) all.insert(all.end(), more.begin(), more.end());
  return all;
}

const OrbitingSatellite& find(const std::vector<OrbitingSatellite>& satellites, const SatelliteId& id) {
  return *std::find_if(satellites.begin(), satellites.end(), [&](const auto& s) { return s.id == id; });
}

TEST(SatelliteName, IsThatOfRinex) {
  EXPECT_EQ(satellite_name({Constellation::kGps, 5}), "G05");
  EXPECT_EQ(satellite_name({Constellation::kSbas, 23}), "S23");
  EXPECT_EQ(satellite_name({Constellation::kGalileo, 11}), "E11");
  EXPECT_EQ(satellite_name({Constellation::kBeidou, 0}), "C00");
  EXPECT_EQ(satellite_name({Constellation::kImes, 1}), "?01");
  EXPECT_EQ(satellite_name({Constellation::kQzss, 3}), "J03");
  EXPECT_EQ(satellite_name({Constellation::kGlonass, 24}), "R24");
  EXPECT_EQ(satellite_name({Constellation::kNavic, 9}), "I09");
  EXPECT_EQ(satellite_name({Constellation::kUnknown, 7}), "?07");
  EXPECT_EQ(satellite_name({Constellation::kGps, 193}), "G193");
}

TEST(Kepler, EquationIsSolved) {
  for (const double e : {0.0, 1e-9, 0.01, 0.2, 0.7, 0.99}) {
    for (double mean = -20.0; mean <= 20.0; mean += 0.0137) {
      const double eccentric = eccentric_anomaly(mean, e);
      ASSERT_NEAR(eccentric - e * std::sin(eccentric), mean, 1e-14 * (1.0 + std::abs(mean)) + 2e-14) << e;
      ASSERT_LE(std::abs(eccentric - mean), e + 1e-14);
    }
    for (const double mean : {0.0, -0.0, 1e-12, kPi, -kPi, 2.0 * kPi}) {
      const double eccentric = eccentric_anomaly(mean, e);
      EXPECT_NEAR(eccentric - e * std::sin(eccentric), mean, 2e-14) << e << ", " << mean;
    }
  }
}

TEST(SiderealTime, OfPublishedInstants) {
  // Meeus, Astronomical Algorithms (2nd ed.), examples 12.a and 12.b.
  EXPECT_NEAR(greenwich_mean_sidereal_time(seconds(545011200)), degrees_to_radians(197.693195), 1e-8);
  EXPECT_NEAR(greenwich_mean_sidereal_time(seconds(545080860)), degrees_to_radians(128.7378734), 1e-8);
  // GPS SPS Performance Standard, table 3.2-1: 18 h 36 min 14.4 s at the epoch of the baseline constellation.
  EXPECT_NEAR(greenwich_mean_sidereal_time(seconds(741484800)),
              degrees_to_radians(15.0 * (18.0 + 36.0 / 60.0 + 14.4 / 3600.0)), degrees_to_radians(0.01));
}

TEST(SiderealTime, IsInOneTurnAndRunsEvenly) {
  for (int day = -20000; day < 40000; day += 37) {
    const Stamp utc = hours(24 * day) + seconds(day % 86400);
    const double angle = greenwich_mean_sidereal_time(utc);
    ASSERT_GE(angle, 0.0);
    ASSERT_LT(angle, 2.0 * kPi);
    const double step = angle_difference(greenwich_mean_sidereal_time(utc + seconds(100)), angle);
    ASSERT_NEAR(step / 100.0, 7.292115855e-5, 1e-12);
  }
}

TEST(Constellation, IsWhole) {
  const auto satellites = all_satellites();
  ASSERT_EQ(satellites.size(), 72u);
  std::map<Constellation, std::map<int, int>> planes;  // satellites per node, in degrees
  for (const auto& s : satellites) {
    ++planes[s.id.constellation][static_cast<int>(std::lround(radians_to_degrees(s.orbit.node_rad)))];
    EXPECT_GE(s.id.svid, 1);
    EXPECT_LE(s.id.svid, 24);
  }
  ASSERT_EQ(planes[Constellation::kGps].size(), 6u);
  for (const auto& plane : planes[Constellation::kGps]) EXPECT_EQ(plane.second, 4);
  for (const Constellation c : {Constellation::kGalileo, Constellation::kGlonass}) {
    ASSERT_EQ(planes[c].size(), 3u);
    for (const auto& plane : planes[c]) EXPECT_EQ(plane.second, 8);
  }
}

TEST(Constellation, RadiusInclinationAndPeriodOfTheOrbits) {
  struct Expected {
    double radius_km, inclination_deg, period_s;
  };
  // Periods: 2 revolutions in a nodal day (GPS), 14 h 04 min 42 s (Galileo), 11 h 15 min 44 s (GLONASS).
  const std::map<Constellation, Expected> expected{{Constellation::kGps, {26559.7, 55.0, 43077.4}},
                                                   {Constellation::kGalileo, {29599.8, 56.0, 50682.0}},
                                                   {Constellation::kGlonass, {25508.0, 64.8, 40544.0}}};
  for (const auto& s : all_satellites()) {
    const Expected& e = expected.at(s.id.constellation);
    double highest = 0.0;
    int crossings = 0;
    double first_s = 0.0;
    double last_s = 0.0;
    double before = ecef_position(s.orbit, kNoon2024).z();
    for (int t = 60; t < 5 * 86400; t += 60) {
      const Eigen::Vector3d p = ecef_position(s.orbit, kNoon2024 + seconds(t));
      ASSERT_NEAR(p.norm(), e.radius_km * 1e3, 100.0);
      highest = std::max(highest, std::asin(p.z() / p.norm()));
      if (before < 0.0 && p.z() >= 0.0) {
        last_s = t - 60.0 * p.z() / (p.z() - before);
        if (crossings++ == 0) first_s = last_s;
      }
      before = p.z();
    }
    EXPECT_NEAR(radians_to_degrees(highest), e.inclination_deg, 0.02);
    EXPECT_NEAR((last_s - first_s) / (crossings - 1), e.period_s, 2.0) << satellite_name(s.id);
  }
}

TEST(Constellation, GroundTracksRepeat) {
  // GPS after 2 revolutions (a nodal day), Galileo after 17 in 10 days, GLONASS after 17 in 8. What the period is off
  // by shifts the satellite on its track: 1 s is 4 km.
  for (const auto& s : all_satellites()) {
    const double nodal_day_s = 2.0 * kPi / (7.292115855e-5 - s.orbit.node_rate_radps);
    const int days = s.id.constellation == Constellation::kGps       ? 1
                     : s.id.constellation == Constellation::kGalileo ? 10
                                                                     : 8;
    const Eigen::Vector3d start = ecef_position(s.orbit, kNoon2024);
    const Eigen::Vector3d end = ecef_position(s.orbit, kNoon2024 + from_seconds(days * nodal_day_s));
    EXPECT_LT((end - start).norm(), days * 10e3) << satellite_name(s.id);
    const Eigen::Vector3d half = ecef_position(s.orbit, kNoon2024 + from_seconds(0.5 * days * nodal_day_s));
    EXPECT_GT((half - start).norm(), 1e6) << satellite_name(s.id);
  }
}

TEST(Constellation, BaselineNodesAreRightAscensions) {
  // A3 is 11.676 deg past its node at the epoch, when the sidereal time is 279.06 deg.
  const auto satellites = gps_baseline();
  const Eigen::Vector3d p = ecef_position(find(satellites, {Constellation::kGps, 3}).orbit, seconds(741484800));
  const double u = degrees_to_radians(11.676);
  EXPECT_NEAR(p.z() / p.norm(), std::sin(u) * std::sin(degrees_to_radians(55.0)), 1e-9);
  const double from_node = std::atan2(std::sin(u) * std::cos(degrees_to_radians(55.0)), std::cos(u));
  const double longitude = degrees_to_radians(272.847 - 15.0 * (18.0 + 36.0 / 60.0 + 14.4 / 3600.0)) + from_node;
  EXPECT_NEAR(angle_difference(std::atan2(p.y(), p.x()), longitude), 0.0, degrees_to_radians(0.01));
}

struct Sighting {
  SatelliteId id;
  double elevation_deg, azimuth_deg;
};

/// Angle between a reported and a computed direction, deg.
double separation_deg(const Sighting& sighting, const VisibleSatellite& satellite) {
  const Eigen::Vector3d reported =
      line_of_sight({degrees_to_radians(sighting.azimuth_deg), degrees_to_radians(sighting.elevation_deg)});
  const Eigen::Vector3d computed = line_of_sight(satellite.look);
  return radians_to_degrees(std::atan2(reported.cross(computed).norm(), reported.dot(computed)));
}

TEST(Sky, SlotsAreWhereReceiversReportedTheirSatellites) {
  // A u-blox ZED-F9P in Dunedin, New Zealand, GSV sentences of 2019-04-12 00:39:56 UTC (gpsd's test/daemon). Which slot
  // a Galileo satellite is in: MGEX, "Galileo". GLONASS keeps its slots to 5 deg of arc, Galileo to 2 deg; seen from
  // the ground that is up to 1.3 times as much. 1.5 deg more are for inclination, node and whole degrees. Slots are 45
  // deg apart.
  constexpr auto kGalileo = Constellation::kGalileo;
  constexpr auto kGlonass = Constellation::kGlonass;
  const Sighting sightings[] = {
      {{kGalileo, 14}, 61, 237},  // E12 in B06
      {{kGalileo, 20}, 63, 342},  // E19 in C04
      {{kGalileo, 13}, 9, 227},   // E11 in B05
      {{kGalileo, 16}, 11, 44},   // E26 in B08
      {{kGalileo, 22}, 11, 134},  // E07 in C06
      {{kGlonass, 1}, 53, 144},  {{kGlonass, 2}, 58, 305}, {{kGlonass, 8}, 9, 137},  {{kGlonass, 17}, 64, 223},
      {{kGlonass, 18}, 13, 214}, {{kGlonass, 23}, 14, 30}, {{kGlonass, 24}, 62, 24}, {{kGlonass, 9}, 6, 174},
  };
  SkyParameters parameters;
  parameters.glonass = true;
  parameters.elevation_mask = 0.0;
  const Stamp utc = seconds(1555029596);
  const Sky sky(parameters, {-45.8775505, 170.5001113, 100.0}, utc);
  const auto visible = sky.above_horizon(utc);
  for (const Sighting& sighting : sightings) {
    const auto found =
        std::find_if(visible.begin(), visible.end(), [&](const VisibleSatellite& v) { return v.id == sighting.id; });
    ASSERT_NE(found, visible.end()) << satellite_name(sighting.id);
    EXPECT_LT(separation_deg(sighting, *found), sighting.id.constellation == kGalileo ? 4.5 : 8.0)
        << satellite_name(sighting.id) << ": " << radians_to_degrees(found->look.elevation_rad) << ", "
        << radians_to_degrees(found->look.azimuth_rad);
  }
}

TEST(Sky, NumberOfGpsSatellitesAllOverTheWorld) {
  SkyParameters parameters;
  parameters.galileo = false;
  double sum = 0.0;
  int samples = 0;
  std::size_t fewest = 99;
  std::size_t most = 0;
  std::vector<VisibleSatellite> visible;
  for (int latitude = -90; latitude <= 90; latitude += 15) {
    for (int longitude = -180; longitude < 180; longitude += 30) {
      const Sky sky(parameters, {static_cast<double>(latitude), static_cast<double>(longitude), 0.0}, kNoon2024);
      for (int minute = 0; minute < 1440; minute += 15) {
        sky.above_horizon(kNoon2024 + std::chrono::minutes(minute), visible);
        fewest = std::min(fewest, visible.size());
        most = std::max(most, visible.size());
        sum += static_cast<double>(visible.size());
        ++samples;
      }
    }
  }
  EXPECT_GE(fewest, 6u);
  EXPECT_LE(most, 12u);
  EXPECT_NEAR(sum / samples, 8.3, 0.3);
  RecordProperty("mean", std::to_string(sum / samples));
}

TEST(Sky, AtThePolesNoSatelliteStandsHigherThanItsOrbitAllows) {
  // Seen from a pole, the highest is above latitude i: tan(el) = (r sin i - R) / (r cos i).
  SkyParameters parameters;
  parameters.galileo = false;
  const double r = 26559.7;
  const double i = degrees_to_radians(55.0);
  const double limit = std::atan2(r * std::sin(i) - 6356.752, r * std::cos(i));
  for (const double latitude : {90.0, -90.0}) {
    const Sky sky(parameters, {latitude, 0.0, 0.0}, kNoon2024);
    double highest = 0.0;
    for (int minute = 0; minute < 1440; ++minute) {
      for (const auto& v : sky.above_horizon(kNoon2024 + std::chrono::minutes(minute))) {
        highest = std::max(highest, v.look.elevation_rad);
      }
    }
    EXPECT_NEAR(highest, limit, 1e-3);
  }
  // Over Berlin they pass the zenith, but leave a hole in the north.
  const Sky berlin(parameters, kBerlin, kNoon2024);
  double highest = 0.0;
  for (int minute = 0; minute < 1440; ++minute) {
    for (const auto& v : berlin.above_horizon(kNoon2024 + std::chrono::minutes(minute))) {
      highest = std::max(highest, v.look.elevation_rad);
      const bool is_north = std::abs(v.look.azimuth_rad) < degrees_to_radians(15.0);
      const double elevation_deg = radians_to_degrees(v.look.elevation_rad);
      EXPECT_FALSE(is_north && elevation_deg > 25.0 && elevation_deg < 60.0) << satellite_name(v.id);
    }
  }
  EXPECT_GT(highest, degrees_to_radians(75.0));
}

TEST(Sky, DirectionAndRangeReachTheSatellite) {
  SkyParameters parameters;
  parameters.glonass = true;
  const Sky sky(parameters, kBerlin, kNoon2024);
  // Local axes from their definition on the ellipsoid, a = 6378137 m, f = 1/298.257223563.
  const double lat = degrees_to_radians(kBerlin.latitude_deg);
  const double lon = degrees_to_radians(kBerlin.longitude_deg);
  const double e2 = 0.00669437999014132;
  const double n = 6378137.0 / std::sqrt(1.0 - e2 * std::sin(lat) * std::sin(lat));
  const Eigen::Vector3d up(std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon), std::sin(lat));
  const Eigen::Vector3d east(-std::sin(lon), std::cos(lon), 0.0);
  const Eigen::Vector3d north = up.cross(east);
  Eigen::Vector3d origin = (n + kBerlin.altitude_m) * up;
  origin.z() -= n * e2 * std::sin(lat);

  const auto visible = sky.above_horizon(kNoon2024);
  ASSERT_GT(visible.size(), 15u);
  EXPECT_TRUE(std::is_sorted(visible.begin(), visible.end(),
                             [](const VisibleSatellite& a, const VisibleSatellite& b) { return a.id < b.id; }));
  std::size_t above_mask = 0;
  for (const auto& s : sky.satellites()) {
    const Eigen::Vector3d offset = ecef_position(s.orbit, kNoon2024) - origin;
    if (std::asin(up.dot(offset.normalized())) >= parameters.elevation_mask) ++above_mask;
  }
  EXPECT_EQ(visible.size(), above_mask);
  for (const auto& v : visible) {
    const Eigen::Vector3d enu = v.range_m * line_of_sight(v.look);
    const Eigen::Vector3d reached = origin + enu.x() * east + enu.y() * north + enu.z() * up;
    const Eigen::Vector3d satellite = ecef_position(find(sky.satellites(), v.id).orbit, kNoon2024);
    EXPECT_LT((reached - satellite).norm(), 1e-2) << satellite_name(v.id);
    EXPECT_GE(v.look.elevation_rad, parameters.elevation_mask);
  }
}

TEST(Sky, EveryParameterHasAnEffect) {
  const auto count = [](const std::string& yaml) {
    return Sky(with(SkyParameters{}, yaml), kBerlin, kNoon2024).above_horizon(kNoon2024).size();
  };
  const std::size_t both = count("{}");
  EXPECT_EQ(count("{gps: false}") + count("{galileo: false}"), both);
  EXPECT_GT(count("{glonass: true}"), both);
  EXPECT_LT(count("{elevation_mask: 0.6}"), both);
  EXPECT_GT(count("{elevation_mask: 0.0}"), both - 1);
  EXPECT_EQ(parameter_names(SkyParameters{}),
            (std::vector<std::string>{"gps", "galileo", "glonass", "almanac", "elevation_mask"}));
}

TEST(Sky, AlmanacReplacesGps) {
  const std::string directory = ::testing::TempDir();
  {
    std::ofstream file(directory + "/constellation_test.alm");
    file << "**** Week 377 almanac for PRN-01 ****\nID: 01\nHealth: 000\nEccentricity: 0.0066\n"
            "Time of Applicability(s): 319488\nOrbital Inclination(rad): 0.989\nRate of Right Ascen(r/s): -7.5E-9\n"
            "SQRT(A)  (m 1/2): 5153.68\nRight Ascen at Week(rad): -0.56\nArgument of Perigee(rad): -1.78\n"
            "Mean Anom(rad): 0.47\nweek: 377\n";
  }
  SkyParameters parameters;
  parameters.almanac = "constellation_test.alm";
  const Sky sky(parameters, kBerlin, kNoon2024, directory);
  EXPECT_EQ(sky.satellites().size(), 1u + 24u);
  parameters.almanac = directory + "/constellation_test.alm";
  EXPECT_EQ(Sky(parameters, kBerlin, kNoon2024, "/nonexistent").satellites().size(), 25u);
  parameters.almanac = "constellation_test.alm";
  EXPECT_THROW(Sky(parameters, kBerlin, kNoon2024, "/nonexistent"), std::runtime_error);
}

TEST(Sky, BadInputIsRefused) {
  EXPECT_THROW(Sky({}, {91.0, 0.0, 0.0}, kNoon2024), std::invalid_argument);
  EXPECT_THROW(Sky({}, {0.0, std::nan(""), 0.0}, kNoon2024), std::invalid_argument);
  const auto faults_of = [](const std::string& yaml) {
    SkyParameters parameters;
    ParameterReader reader(YAML::Load(yaml));
    return reader.read(parameters).finish();
  };
  EXPECT_TRUE(faults_of("{}").empty());
  ASSERT_EQ(faults_of("{gps: false, galileo: false}").size(), 1u);
  EXPECT_EQ(faults_of("{gps: false, galileo: false}")[0].rfind("gps", 0), 0u);
  ASSERT_EQ(faults_of("{gps: false, almanac: a.alm}").size(), 1u);
  EXPECT_EQ(faults_of("{gps: false, almanac: a.alm}")[0].rfind("almanac", 0), 0u);
  EXPECT_EQ(faults_of("{elevation_mask: 1.6}").size(), 1u);
  EXPECT_EQ(faults_of("{elevation_mask: -0.1}").size(), 1u);
}

}  // namespace
}  // namespace urban_gnss
