#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "urban_gnss_localization/simulation/wall_index.hpp"

namespace urban_gnss {
namespace {

using Eigen::Vector3d;

/// Rows of numbers below a header; a cell that is no number is 0.
std::vector<std::vector<double>> read_numbers(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  std::vector<std::vector<double>> rows;
  while (std::getline(file, line)) {
    rows.emplace_back();
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(std::strtod(cell.c_str(), nullptr));
  }
  return rows;
}

/// The polygon casts of the data take every wall from far below the ground (the antenna is down to 103 m below it) to
/// its roof, and the antenna to be at the z that they give: with any height added the mask elevations differ. No
/// position is inside a footprint. What differs in Kowloon Bay is one wall, from the last to the first corner of
/// building 7: the polygon cast does not have it.
constexpr double kOracleBase = -1000.0;

class Oracle : public ::testing::TestWithParam<const char*> {};

TEST_P(Oracle, BlockedAgreesWithThePolygonCast) {
  const char* data = std::getenv("URBAN_GNSS_DATA");
  const std::filesystem::path folder = std::filesystem::path(data == nullptr ? "" : data) / "ray";
  if (data == nullptr || !std::filesystem::exists(folder)) GTEST_SKIP() << "URBAN_GNSS_DATA has no folder ray";
  const std::string name = GetParam();
  std::map<int, Building> buildings;
  for (const auto& row : read_numbers(folder / (name.substr(0, name.find('_')) + "_buildings.csv"))) {
    Building& building = buildings[static_cast<int>(row.at(0))];
    building.footprint.emplace_back(row.at(2), row.at(3));
    building.base_m = kOracleBase;
    building.roof_m = row.at(4);
  }
  World world;
  for (const auto& [id, building] : buildings) world.buildings.push_back(building);
  const WallIndex index(world);

  const auto rows = read_numbers(folder / (name + "_oracle.csv"));
  ASSERT_GT(rows.size(), 1000u);
  int agreed = 0;
  int masks = 0;
  for (const auto& row : rows) {
    const Vector3d antenna(row.at(1), row.at(2), row.at(3));
    const double azimuth_rad = row.at(5);
    const auto meets = [&](double elevation_rad) {
      const Vector3d direction(std::sin(azimuth_rad) * std::cos(elevation_rad),
                               std::cos(azimuth_rad) * std::cos(elevation_rad), std::sin(elevation_rad));
      return index.cast(antenna, direction).has_value();
    };
    agreed += meets(row.at(6)) == (row.at(8) != 0.0) ? 1 : 0;
    const double mask_rad = row.at(7);
    constexpr double kMaskStep = 0.002;  // the positions are rounded to a millimetre, azimuths to 1e-5 rad
    masks += !meets(mask_rad + kMaskStep) && (mask_rad < kMaskStep || meets(mask_rad - kMaskStep)) ? 1 : 0;
  }
  const double count = static_cast<double>(rows.size());
  RecordProperty("blocked_agreement", std::to_string(agreed / count));
  RecordProperty("mask_agreement", std::to_string(masks / count));
  EXPECT_GE(agreed / count, 0.995);
  EXPECT_GE(masks / count, 0.995);
}

INSTANTIATE_TEST_SUITE_P(Recordings, Oracle,
                         ::testing::Values("tst_novatel", "tst_ublox", "tst_xiaomi", "kowloonbay_novatel"));

}  // namespace
}  // namespace urban_gnss
