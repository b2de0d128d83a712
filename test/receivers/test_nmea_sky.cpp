#include <gmock/gmock.h>

#include "nmea_text.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/receivers/nmea_satellite_id.hpp"
#include "urban_gnss_localization/receivers/nmea_sky.hpp"

namespace urban_gnss {
namespace {

using testing::ElementsAre;
using testing::Optional;

NmeaSentence sentence(const std::string& body) { return *parse_nmea_sentence(nmea(body)).sentence; }

NmeaSky sky_of(const std::vector<std::string>& bodies) {
  NmeaSky sky;
  for (const std::string& body : bodies) {
    const NmeaSentence each = sentence(body);
    if (each.type == "GSV") sky.add_gsv(each);
    if (each.type == "GSA") sky.add_gsa(each);
    if (each.type == "GRS") sky.add_grs(each);
  }
  return sky;
}

std::vector<std::string> names(const NmeaSky& sky) {
  std::vector<std::string> list;
  for (const auto& satellite : sky.satellites()) list.push_back(satellite_name(satellite.id));
  return list;
}

double residual_of(const NmeaSky& sky, const std::string& name) {
  for (const auto& satellite : sky.satellites()) {
    if (satellite_name(satellite.id) == name) return satellite.residual_m;
  }
  throw std::out_of_range(name);
}

TEST(NmeaSatelliteId, NumbersOfASystemAndOfAll) {
  const auto id = [](const char* talker, const char* system, int number) {
    return nmea_satellite_id(nmea_system(talker, system), number);
  };
  EXPECT_THAT(id("GP", "", 7), Optional(SatelliteId{Constellation::kGps, 7}));
  EXPECT_THAT(id("GP", "", 46), Optional(SatelliteId{Constellation::kSbas, 133}));
  EXPECT_THAT(id("GP", "", 133), Optional(SatelliteId{Constellation::kSbas, 133}));
  EXPECT_THAT(id("GP", "", 75), Optional(SatelliteId{Constellation::kGlonass, 11}));
  EXPECT_THAT(id("GP", "", 193), Optional(SatelliteId{Constellation::kQzss, 1}));
  EXPECT_THAT(id("GL", "", 65), Optional(SatelliteId{Constellation::kGlonass, 1}));
  EXPECT_THAT(id("GL", "", 3), Optional(SatelliteId{Constellation::kGlonass, 3}));
  EXPECT_THAT(id("GA", "", 33), Optional(SatelliteId{Constellation::kGalileo, 33}));
  EXPECT_THAT(id("GN", "3", 7), Optional(SatelliteId{Constellation::kGalileo, 7}));
  EXPECT_THAT(id("GN", "", 307), Optional(SatelliteId{Constellation::kGalileo, 7}));
  EXPECT_THAT(id("BD", "", 11), Optional(SatelliteId{Constellation::kBeidou, 11}));
  EXPECT_THAT(id("GB", "", 45), Optional(SatelliteId{Constellation::kBeidou, 45}));
  EXPECT_THAT(id("GN", "4", 411), Optional(SatelliteId{Constellation::kBeidou, 11}));
  EXPECT_THAT(id("GB", "", 211), Optional(SatelliteId{Constellation::kBeidou, 11}));
  EXPECT_THAT(id("GQ", "", 2), Optional(SatelliteId{Constellation::kQzss, 2}));
  EXPECT_THAT(id("GQ", "", 195), Optional(SatelliteId{Constellation::kQzss, 3}));
  EXPECT_THAT(id("GI", "", 9), Optional(SatelliteId{Constellation::kNavic, 9}));
  EXPECT_FALSE(id("GP", "", 0));
  EXPECT_FALSE(id("GN", "", 999));
}

TEST(NmeaSky, GroupsOfAllTalkersAreOneSky) {
  const NmeaSky sky = sky_of({"GPGSV,1,1,02,05,06,110,19,46,31,150,", "GLGSV,1,1,01,65,53,144,",
                              "GAGSV,1,1,01,02,10,179,20,7", "GBGSV,1,1,01,13,23,233,17,1"});
  EXPECT_THAT(names(sky), ElementsAre("G05", "S133", "E02", "C13", "R01"));
  const SatelliteObservation first = sky.satellites().front();
  EXPECT_NEAR(first.look.azimuth_rad, degrees_to_radians(110.0), 1e-12);
  EXPECT_NEAR(first.look.elevation_rad, degrees_to_radians(6.0), 1e-12);
  EXPECT_EQ(first.cn0_dbhz, 19.0);
  EXPECT_TRUE(first.tracked);
  EXPECT_FALSE(sky.satellites()[1].tracked);
  EXPECT_NEAR(sky.angle_resolution_rad(), degrees_to_radians(1.0), 1e-12);
}

TEST(NmeaSky, OfSeveralSignalsTheFirstCountsWhereItIsTracked) {
  const auto cn0 = [](const std::vector<std::string>& groups) { return sky_of(groups).satellites().at(0).cn0_dbhz; };
  EXPECT_EQ(cn0({"GPGSV,1,1,01,10,24,284,34,1", "GPGSV,1,1,01,10,24,284,39,6"}), 34.0);
  EXPECT_EQ(cn0({"GPGSV,1,1,01,10,24,284,39,6", "GPGSV,1,1,01,10,24,284,34,1"}), 34.0);
  EXPECT_EQ(cn0({"GPGSV,1,1,01,10,24,284,,1", "GPGSV,1,1,01,10,24,284,39,6", "GPGSV,1,1,01,10,24,284,30,8"}), 39.0);
  EXPECT_EQ(cn0({"GAGSV,1,1,01,10,24,284,39,2", "GAGSV,1,1,01,10,24,284,34,7"}), 34.0);
  EXPECT_EQ(cn0({"GPGSV,1,1,01,10,24,284,34", "GPGSV,1,1,01,10,24,284,39"}), 39.0);  // NMEA before 4.10
}

TEST(NmeaSky, FieldsThatAreMissingAreUnknown) {
  const NmeaSky sky = sky_of({"GPGSV,1,1,04,19,,,36,1,5,,23,,,,53,14,32,226", "GPGSV,1,1,00"});
  EXPECT_THAT(names(sky), ElementsAre("G01", "G14", "G19"));
  EXPECT_FALSE(has_direction(sky.satellites()[0]));
  EXPECT_TRUE(has_direction(sky.satellites()[1]));
  EXPECT_FALSE(sky.satellites()[1].tracked);
  EXPECT_FALSE(has_direction(sky.satellites()[2]));
  EXPECT_EQ(sky.satellites()[2].cn0_dbhz, 36.0);
}

TEST(NmeaSky, AnglesThatNoSatelliteHasAreUnknown) {
  const NmeaSky sky = sky_of({"GPGSV,1,1,03,01,91,100,40,02,10,361,40,03,10,360,40"});
  EXPECT_FALSE(has_direction(sky.satellites()[0]));
  EXPECT_FALSE(has_direction(sky.satellites()[1]));
  EXPECT_EQ(sky.satellites()[2].look.azimuth_rad, 0.0);
}

TEST(NmeaSky, QuectelNamesTheSystemAtTheEnd) {
  EXPECT_THAT(names(sky_of({"PQGSV,1,1,02,28,08,040,,29,,,,0,4"})), ElementsAre("C28", "C29"));
}

TEST(NmeaSky, ResidualsHaveTheOppositeSignAndTheOrderOfGsa) {
  const NmeaSky sky = sky_of({"GNGSA,A,3,13,16,,,,,,,,,,,1.0,0.6,0.8,1", "GNGSA,A,3,82,,66,,,,,,,,,,1.0,0.6,0.8,2",
                              "GPGSV,1,1,02,13,37,124,29,16,11,248,10,1", "GLGSV,1,1,02,66,58,305,32,82,13,214,33,1",
                              "GNGRS,003956.00,1,1.5,-2.5,,,,,,,,,,,1,1", "GNGRS,003956.00,1,0.25,,-7,,,,,,,,,,2,1",
                              "GNGRS,003956.00,1,99,99,,,,,,,,,,,1,6"});
  EXPECT_EQ(residual_of(sky, "G13"), -1.5);  // the first signal that has one
  EXPECT_EQ(residual_of(sky, "G16"), 2.5);
  EXPECT_EQ(residual_of(sky, "R18"), -0.25);
  EXPECT_EQ(residual_of(sky, "R02"), 7.0);
}

TEST(NmeaSky, ResidualsWithoutASystemAreInTheOrderOfTheGsas) {
  const NmeaSky sky =
      sky_of({"GNGSA,A,3,13,,,,,,,,,,,,1.0,0.6,0.8", "GNGSA,A,3,82,,,,,,,,,,,,1.0,0.6,0.8", "GPGSV,1,1,01,13,37,124,29",
              "GLGSV,1,1,01,82,13,214,33", "GNGRS,003956.00,0,1,,,,,,,,,,,", "GNGRS,003956.00,0,2,,,,,,,,,,,"});
  EXPECT_EQ(residual_of(sky, "G13"), -1.0);
  EXPECT_EQ(residual_of(sky, "R18"), -2.0);
}

TEST(NmeaSky, MoreThanTwelveSatellitesOfASystemHaveSeveralGsaAndGrs) {
  const NmeaSky sky = sky_of({"GNGSA,A,3,1,2,3,4,5,6,7,8,9,10,11,12,1,1,1,1", "GNGSA,A,3,13,,,,,,,,,,,,1,1,1,1",
                              "GPGSV,1,1,02,12,37,124,29,13,37,124,29,1", "GNGRS,003956.00,1,,,,,,,,,,,,-1,1,1",
                              "GNGRS,003956.00,1,-2,,,,,,,,,,,,1,1"});
  EXPECT_EQ(residual_of(sky, "G12"), 1.0);
  EXPECT_EQ(residual_of(sky, "G13"), 2.0);
}

TEST(NmeaSky, AResidualWithoutItsGsaIsNobodys) {
  const NmeaSky sky = sky_of({"GPGSV,1,1,01,13,37,124,29,1", "GNGRS,003956.00,1,1,,,,,,,,,,,,1,1"});
  EXPECT_TRUE(std::isnan(residual_of(sky, "G13")));
}

}  // namespace
}  // namespace urban_gnss
