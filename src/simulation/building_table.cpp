#include <cmath>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <set>
#include <sstream>

#include "urban_gnss_localization/simulation/polygon.hpp"
#include "urban_gnss_localization/simulation/scenario_world.hpp"

namespace urban_gnss {
namespace {

constexpr const char* kHeader = "building,vertex,x,y,roof_z";

struct Corner {
  std::string building;
  int vertex{0};
  Eigen::Vector2d position{Eigen::Vector2d::Zero()};
  double roof_m{0.0};
  std::string fault;  ///< empty where the line is one of the table
};

std::optional<double> number_of(const std::string& cell) {
  char* end = nullptr;
  const double value = std::strtod(cell.c_str(), &end);
  const bool is_whole_cell = end != cell.c_str() && *end == '\0';
  return is_whole_cell && std::isfinite(value) ? std::optional<double>(value) : std::nullopt;
}

Corner corner_of(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream text(line);
  for (std::string cell; std::getline(text, cell, ',');) cells.push_back(cell);
  Corner corner;
  corner.building = cells[0];
  if (cells.size() != 5) {
    corner.fault = std::to_string(cells.size()) + " columns where there must be 5";
    return corner;
  }
  if (corner.building.empty()) corner.fault = "the building has no name";
  double values[4] = {};
  for (std::size_t i = 0; i < 4; ++i) {
    const auto value = number_of(cells[i + 1]);
    if (!value) corner.fault = "'" + cells[i + 1] + "' is not a finite number";
    values[i] = value.value_or(0.0);
  }
  // What is no index at all is not the next one either.
  corner.vertex = values[0] == std::floor(values[0]) && std::abs(values[0]) < 1e6 ? static_cast<int>(values[0]) : -1;
  corner.position = {values[1], values[2]};
  corner.roof_m = values[3];
  return corner;
}

}  // namespace

std::vector<Building> read_building_table(const std::filesystem::path& file, double base_m, double reflection_loss_db,
                                          std::vector<std::string>& faults) {
  std::vector<Building> buildings;
  std::ifstream stream(file);
  std::string line;
  if (!std::filesystem::is_regular_file(file) || !std::getline(stream, line)) {
    faults.push_back(file.string() + ": cannot be read, or is empty");
    return buildings;
  }
  const auto add_fault = [&](std::size_t number, const std::string& text) {
    faults.push_back(file.string() + ":" + std::to_string(number) + ": " + text);
  };
  const auto trim = [](std::string& text) {
    while (!text.empty() && (text.back() == '\r' || text.back() == ' ')) text.pop_back();
  };
  trim(line);
  if (line != kHeader) {
    add_fault(1, std::string("the columns must be ") + kHeader);
    return buildings;
  }

  Building building;
  building.base_m = base_m;
  building.reflection_loss_db = reflection_loss_db;
  std::size_t first_number = 0;  // line of the building's first corner
  bool is_good = true;
  std::set<std::string> names;
  const auto finish = [&] {
    if (names.empty()) return;
    std::string fault = polygon_fault(building.footprint);
    if (fault.empty() && !(building.roof_m > base_m)) fault = "roof_z must be higher than the base";
    if (is_good && !fault.empty()) add_fault(first_number, "building " + building.name + ": " + fault);
    if (!is_good || !fault.empty()) return;
    buildings.push_back(building);
    buildings.back().footprint = counter_clockwise(building.footprint);
  };
  for (std::size_t number = 2; std::getline(stream, line); ++number) {
    trim(line);
    if (line.empty()) continue;
    const Corner corner = corner_of(line);
    if (names.empty() || corner.building != building.name) {
      finish();
      building.name = corner.building;
      building.footprint.clear();
      building.roof_m = corner.roof_m;
      first_number = number;
      is_good = names.insert(corner.building).second;
      if (!is_good) add_fault(number, "building " + corner.building + " has corners above already");
    }
    std::string fault = corner.fault;
    if (is_good && fault.empty() && corner.vertex != static_cast<int>(building.footprint.size())) {
      fault = "vertex must be " + std::to_string(building.footprint.size());
    }
    if (is_good && fault.empty() && corner.roof_m != building.roof_m) {
      fault = "roof_z is not that of the building's other corners";
    }
    if (!fault.empty()) {
      add_fault(number, fault);
      is_good = false;
    }
    building.footprint.push_back(corner.position);
  }
  finish();
  if (names.empty() && faults.empty()) add_fault(1, "no buildings");
  return buildings;
}

}  // namespace urban_gnss
