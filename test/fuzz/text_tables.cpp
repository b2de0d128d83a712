// Tables and lists in text: the columns of csv_to_bag and check_visibility, buildings, tracks, TUM, almanacs.

#include <cmath>
#include <sstream>

#include "csv_table.hpp"
#include "memory_file.hpp"
#include "urban_gnss_localization/evaluation/tum.hpp"
#include "urban_gnss_localization/simulation/polygon.hpp"
#include "urban_gnss_localization/simulation/route.hpp"
#include "urban_gnss_localization/simulation/scenario_world.hpp"
#include "urban_gnss_localization/simulation/yuma.hpp"

namespace urban_gnss::fuzz {
namespace {

constexpr Stamp kMay2026{1777887000000000000};

}  // namespace

void read_csv(const std::string& bytes) {
  read_as_file(bytes, [](const std::string& path) {
    const CsvTable table(path);
    for (const char* name : {"stamp", "x", "lat_deg", "sat", "none"}) {
      const CsvTable::Column column = table.optional_column(name);
      for (std::size_t row = 0; row < table.size(); ++row) {
        require(row == 0 || table.stamp(row - 1) <= table.stamp(row), "rows that are not in order");
        if (!table.text(row, column).empty()) require(std::isfinite(table.number(row, column)), "not a number");
      }
    }
  });
}

void read_buildings(const std::string& bytes) {
  const MemoryFile file(bytes);
  std::vector<std::string> faults;
  for (const Building& building : read_building_table(file.path(), 0.0, 6.0, faults)) {
    require(polygon_fault(building.footprint).empty(), "a building with a footprint that is none");
    require(building.roof_m > building.base_m && std::isfinite(building.roof_m), "a building without a height");
  }
  for (const std::string& fault : faults) {
    require(fault.find(file.path()) != std::string::npos, "a fault that does not name the file: " + fault);
  }
}

void read_track(const std::string& bytes) {
  read_as_file(bytes, [](const std::string& path) {
    const Route route = urban_gnss::read_track(path);
    require_drivable(route);
    const RouteFollower follower(route);
    require(std::isfinite(follower.length_m()), "a path without a length");
  });
}

void read_tum(const std::string& bytes) {
  std::istringstream text(bytes);
  Trajectory trajectory;
  try {
    trajectory = urban_gnss::read_tum(text);
  } catch (const std::runtime_error& error) {
    const std::string said = error.what();
    require(said.rfind("line ", 0) == 0, "a refusal without the line: " + said);
  }
  std::ostringstream written;
  write_tum(written, trajectory);  // throws where a pose is not finite
}

void read_yuma(const std::string& bytes) {
  std::istringstream text(bytes);
  std::vector<OrbitingSatellite> satellites;
  try {
    satellites = urban_gnss::read_yuma(text, "almanac", kMay2026);
  } catch (const std::runtime_error& error) {
    const std::string said = error.what();
    require(said.rfind("almanac:", 0) == 0, "a refusal without the line: " + said);
  }
  for (const OrbitingSatellite& satellite : satellites) {
    require(satellite.id.svid > 0 && satellite.id.svid < 64, "a satellite without a number");
    require(ecef_position(satellite.orbit, kMay2026).allFinite(), "an orbit that is none");
  }
}

}  // namespace urban_gnss::fuzz
