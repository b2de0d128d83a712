#include "urban_gnss_localization/simulation/scenario_world.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "scenario_nodes.hpp"
#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"
#include "urban_gnss_localization/simulation/polygon.hpp"

namespace urban_gnss {
namespace {

constexpr double kMostEntries = 100000.0;  ///< buildings of a grid, trees of a row: more is a slip of the pen
constexpr double kHeadroom = 2.0;          ///< m: what begins higher stands in nobody's way

/// Of coordinates and heights, and of lengths.
const Range kPlace = between(-kWorldReach_m, kWorldReach_m);
const Range kLength = open_between(0.0, kWorldReach_m);
const Range kLengthOrNone = between(0.0, kWorldReach_m);

/// What a building has besides its footprint. The names are those of the scenario.
struct BuildingFields {
  bool has_own_roof{true};  ///< not the case where a table or a grid brings the roofs
  std::string name;
  double base{0.0};
  double roof{0.0};
  double reflection_loss{Building().reflection_loss_db};

  void visit(ParameterVisitor& v) {
    if (has_own_roof) {
      v("name", name, "of the building");
      v("roof", roof, kPlace, "m", "height of the roof above the ground");
    }
    v("base", base, kPlace, "m", "height at which it begins");
    v("reflection_loss", reflection_loss, non_negative(), "dB", "that a reflection costs");
  }
  void check(std::vector<std::string>& faults) const {
    if (has_own_roof && !(roof > base)) faults.push_back("roof: must be given, and higher than base");
  }
};

struct TreeFields {
  double trunk_radius{Tree().trunk_radius_m};
  double crown_radius{Tree().crown_radius_m};
  double crown_base{Tree().crown_base_m};
  double crown_top{Tree().crown_top_m};
  double attenuation{Tree().attenuation_db_per_m};

  void visit(ParameterVisitor& v) {
    v("trunk_radius", trunk_radius, kLengthOrNone, "m", "of the trunk");
    v("crown_radius", crown_radius, kLengthOrNone, "m", "of the crown");
    v("crown_base", crown_base, kLengthOrNone, "m", "height at which the crown begins");
    v("crown_top", crown_top, kLength, "m", "height at which it ends");
    v("attenuation", attenuation, non_negative(), "dB/m", "of a signal through the crown");
  }
  void check(std::vector<std::string>& faults) const {
    if (!(crown_top > crown_base)) faults.push_back("crown_top: must be higher than crown_base");
  }
};

enum class Need { kRequired, kOptional };

/// Reads [x, y] with both at least (or more than, where the range is open) the range's low. Whether `point` can be
/// used.
bool read_pair(ParameterReader& reader, const std::string& name, Need need, const Range& range,
               Eigen::Vector2d& point) {
  const YAML::Node node = reader.child(name);
  if (!reader.has(name)) {
    if (need == Need::kRequired) reader.fault(name, "is missing");
    return need == Need::kOptional;
  }
  const auto read = point_of(node);
  if (!read) {
    reader.fault(name, "must be two finite numbers, [x, y]");
    return false;
  }
  if (!range.contains(read->x()) || !range.contains(read->y())) {
    reader.fault(name, "both must be " + range.describe());
    return false;
  }
  point = *read;
  return true;
}

bool read_whole_pair(ParameterReader& reader, const std::string& name, const Range& range, Eigen::Vector2i& pair) {
  Eigen::Vector2d read = pair.cast<double>();
  if (!read_pair(reader, name, Need::kOptional, range, read)) return false;
  if (read != read.array().round().matrix()) {
    reader.fault(name, "both must be whole numbers");
    return false;
  }
  pair = read.cast<int>();
  return true;
}

/// One entry of a list of the scenario with the reader for it.
struct Entry {
  YAML::Node node;
  std::string name;    ///< buildings[3]
  std::string source;  ///< the scenario's file
  ParameterReader reader;
  std::vector<std::string> faults;  ///< of its nested maps and files

  Entry(const YAML::Node& entry_node, const std::string& entry_name, const std::string& list_source)
      : node(entry_node), name(entry_name), source(list_source), reader(node, source, name + ".") {}

  ParameterReader section(const std::string& section_name) {
    return ParameterReader(reader.child(section_name), source, name + "." + section_name + ".");
  }
  std::vector<std::string> finish() const {
    std::vector<std::string> all = reader.finish();
    all.insert(all.end(), faults.begin(), faults.end());
    return all;
  }
  /// Of the entry as a whole.
  void fault(const std::string& text) {
    ParameterReader place(YAML::Node(), source);
    place.fault(node, name, text);
    add(place.finish());
  }
  void add(const std::vector<std::string>& more) { faults.insert(faults.end(), more.begin(), more.end()); }
};

Polygon read_footprint(Entry& entry) {
  Polygon footprint;
  const YAML::Node corners = entry.reader.child("footprint");
  if (!corners.IsSequence()) {
    entry.reader.fault("footprint", "must be a list of corners, [[x, y], ...]");
    return footprint;
  }
  bool is_good = true;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const auto corner = point_of(corners[i]);
    if (corner) {
      footprint.push_back(*corner);
    } else {
      entry.reader.fault(corners[i], "footprint[" + std::to_string(i) + "]", "must be two finite numbers, [x, y]");
      is_good = false;
    }
  }
  if (!is_good) return footprint;
  const std::string fault = polygon_fault(footprint);
  if (!fault.empty()) entry.reader.fault("footprint", fault);
  return footprint;
}

Polygon read_box(Entry& entry) {
  ParameterReader box = entry.section("box");
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  Eigen::Vector2d size = Eigen::Vector2d::Ones();
  double yaw = 0.0;
  read_pair(box, "center", Need::kRequired, kPlace, center);
  read_pair(box, "size", Need::kRequired, kLength, size);
  box("yaw", yaw, any_number(), "rad", "counter-clockwise from east");
  entry.add(box.finish());
  const Eigen::Vector2d along = 0.5 * size.x() * Eigen::Vector2d(std::cos(yaw), std::sin(yaw));
  const Eigen::Vector2d across = 0.5 * size.y() * Eigen::Vector2d(-std::sin(yaw), std::cos(yaw));
  const Polygon footprint{center - along - across, center + along - across, center + along + across,
                          center - along + across};
  const std::string fault = polygon_fault(footprint);
  if (!fault.empty() && entry.faults.empty()) entry.reader.fault("box", fault);
  return footprint;
}

void read_plazas(ParameterReader& reader, BlockGrid& grid) {
  const YAML::Node plazas = reader.child("plazas");
  if (plazas.IsNull()) return;
  if (!plazas.IsSequence()) {
    reader.fault("plazas", "must be a list of blocks, [[i, j], ...]");
    return;
  }
  for (std::size_t i = 0; i < plazas.size(); ++i) {
    const auto plaza = point_of(plazas[i]);
    const bool is_block = plaza && *plaza == plaza->array().round().matrix() && (plaza->array() >= 0.0).all() &&
                          (plaza->array() < grid.blocks.cast<double>().array()).all();
    if (is_block) {
      grid.plazas.emplace_back(static_cast<int>(plaza->x()), static_cast<int>(plaza->y()));
    } else {
      reader.fault(plazas[i], "plazas[" + std::to_string(i) + "]", "must be [i, j], a block of the grid, from 0");
    }
  }
}

/// Nothing where it has faults.
std::vector<Building> read_grid(Entry& entry, const BuildingFields& fields) {
  ParameterReader reader = entry.section("grid");
  BlockGrid grid;
  const auto optional = Need::kOptional;
  read_pair(reader, "origin", optional, kPlace, grid.origin);
  const bool has_blocks = read_whole_pair(reader, "blocks", between(1.0, kMostEntries), grid.blocks);
  read_pair(reader, "block_size", optional, kLength, grid.block_size);
  read_pair(reader, "street_width", optional, kLengthOrNone, grid.street_width);
  reader("buildings_per_side", grid.buildings_per_side, between(1.0, 100.0), "", "of a block");
  int seed = static_cast<int>(grid.seed);
  reader("seed", seed, non_negative(), "", "of the heights");
  grid.seed = static_cast<std::uint64_t>(seed);
  const bool has_heights = read_pair(reader, "heights", optional, kLength, grid.heights);
  if (has_heights && grid.heights.x() > grid.heights.y()) reader.fault("heights", "must be [lowest, highest]");
  if (has_heights && !(grid.heights.x() > fields.base)) reader.fault("heights", "must be higher than base");
  if (has_blocks) read_plazas(reader, grid);
  const double count = grid.blocks.cast<double>().prod() * std::pow(grid.buildings_per_side, 2);
  if (count > kMostEntries) reader.fault("blocks", "makes more than 100000 buildings");
  const std::vector<std::string> faults = reader.finish();
  entry.add(faults);
  if (!faults.empty()) return {};
  std::vector<Building> buildings = make_blocks(grid);
  if (buildings.empty()) return buildings;
  // All are of one size, and the last is the farthest.
  for (const Building& building : {buildings.front(), buildings.back()}) {
    const std::string fault = polygon_fault(building.footprint);
    if (!fault.empty()) entry.reader.fault("grid", "building " + building.name + ": " + fault);
  }
  return buildings;
}

std::vector<Building> read_table(Entry& entry, const BuildingFields& fields) {
  std::string file;
  entry.reader("file", file, "table of buildings");
  const auto path = std::filesystem::path(entry.source).parent_path() / file;
  if (!std::filesystem::is_regular_file(path)) {
    entry.reader.fault("file", "'" + path.string() + "' is not there");
    return {};
  }
  return read_building_table(path, fields.base, fields.reflection_loss, entry.faults);
}

void read_building(Entry& entry, std::vector<Building>& buildings) {
  std::string kind;
  std::string kinds;
  int kind_count = 0;
  for (const char* candidate : {"footprint", "box", "file", "grid"}) {
    entry.reader.ignore(candidate);
    if (!entry.reader.has(candidate)) continue;
    kind = candidate;
    kinds += (kinds.empty() ? "" : " and ") + kind;
    ++kind_count;
  }
  BuildingFields fields;
  fields.has_own_roof = kind == "footprint" || kind == "box";
  if (kind_count != 1) {
    for (const char* known : {"name", "roof", "base", "reflection_loss"}) entry.reader.ignore(known);
    if (!entry.node.IsMap() && !entry.node.IsNull()) return;  // the reader says so
    entry.fault("needs one of footprint, box, file, grid" + (kinds.empty() ? "" : ", has " + kinds));
    return;
  }
  entry.reader.read(fields);
  std::vector<Building> read;
  if (fields.has_own_roof) {
    Building building;
    building.footprint = kind == "box" ? read_box(entry) : read_footprint(entry);
    building.roof_m = fields.roof;
    read.push_back(building);
  } else {
    read = kind == "file" ? read_table(entry, fields) : read_grid(entry, fields);
  }
  // A table's good buildings are of use although others of it are not; the faults stop the scenario all the same.
  if (fields.has_own_roof && !entry.finish().empty()) return;
  for (Building& building : read) {
    building.name = fields.name.empty() ? entry.name + (building.name.empty() ? "" : "." + building.name) : fields.name;
    building.footprint = counter_clockwise(std::move(building.footprint));
    building.base_m = fields.base;
    building.reflection_loss_db = fields.reflection_loss;
    buildings.push_back(std::move(building));
  }
}

std::vector<Eigen::Vector2d> read_row(Entry& entry) {
  ParameterReader row = entry.section("row");
  Eigen::Vector2d from = Eigen::Vector2d::Zero();
  Eigen::Vector2d to = Eigen::Vector2d::Zero();
  double spacing = 8.0;
  read_pair(row, "from", Need::kRequired, kPlace, from);
  read_pair(row, "to", Need::kRequired, kPlace, to);
  row("spacing", spacing, positive(), "m", "from trunk to trunk");
  const double length = (to - from).norm();
  // The last tree stands at `to` where the spacing divides the length, whatever the rounding.
  const double intervals = std::floor(length / spacing + 1e-9);
  if (spacing > 0.0 && intervals > kMostEntries) row.fault("spacing", "makes more than 100000 trees");
  const std::vector<std::string> faults = row.finish();
  entry.add(faults);
  std::vector<Eigen::Vector2d> positions;
  if (!faults.empty()) return positions;
  const Eigen::Vector2d step = length > 0.0 ? Eigen::Vector2d((to - from) * (spacing / length)) : Eigen::Vector2d(0, 0);
  for (int i = 0; i <= static_cast<int>(intervals); ++i) positions.push_back(from + i * step);
  return positions;
}

void read_tree(Entry& entry, std::vector<Tree>& trees) {
  TreeFields fields;
  entry.reader.read(fields);
  std::vector<Eigen::Vector2d> positions(1, Eigen::Vector2d::Zero());
  entry.reader.ignore("row");
  entry.reader.ignore("position");
  if (entry.reader.has("row") == entry.reader.has("position")) {
    if (entry.node.IsMap() || entry.node.IsNull()) entry.fault("needs one of position and row");
  } else if (entry.reader.has("row")) {
    positions = read_row(entry);
  } else {
    read_pair(entry.reader, "position", Need::kRequired, kPlace, positions[0]);
  }
  if (!entry.finish().empty()) return;
  for (const Eigen::Vector2d& position : positions) {
    trees.push_back(
        {position, fields.trunk_radius, fields.crown_radius, fields.crown_base, fields.crown_top, fields.attenuation});
  }
}

template <class Read>
void read_list(ParameterReader& scenario, const std::string& name, std::vector<std::string>& faults, const Read& read) {
  const YAML::Node list = scenario.child(name);
  if (list.IsNull()) return;
  if (!list.IsSequence()) {
    Entry whole(list, name, scenario.source());
    whole.fault("must be a list");
    faults.insert(faults.end(), whole.faults.begin(), whole.faults.end());
    return;
  }
  for (std::size_t i = 0; i < list.size(); ++i) {
    Entry entry(list[i], name + "[" + std::to_string(i) + "]", scenario.source());
    read(entry);
    const auto entry_faults = entry.finish();
    faults.insert(faults.end(), entry_faults.begin(), entry_faults.end());
  }
}

}  // namespace

std::vector<Building> make_blocks(const BlockGrid& grid) {
  std::vector<Building> buildings;
  auto engine = make_engine(grid.seed);
  const int per_side = grid.buildings_per_side;
  const Eigen::Vector2d pitch = grid.block_size + grid.street_width;
  const Eigen::Vector2d size = grid.block_size / per_side;
  for (int j = 0; j < grid.blocks.y(); ++j) {
    for (int i = 0; i < grid.blocks.x(); ++i) {
      const Eigen::Vector2d block = grid.origin + pitch.cwiseProduct(Eigen::Vector2d(i, j));
      const bool is_plaza = std::count(grid.plazas.begin(), grid.plazas.end(), std::make_pair(i, j)) > 0;
      for (int k = 0; k < per_side * per_side; ++k) {
        const double height = grid.heights.x() + (grid.heights.y() - grid.heights.x()) * draw_uniform(engine);
        if (is_plaza) continue;
        const auto corner = [&](int column, int row) -> Eigen::Vector2d {
          return block + size.cwiseProduct(Eigen::Vector2d(k % per_side + column, k / per_side + row));
        };
        Building building;
        building.name = "(" + std::to_string(i) + ", " + std::to_string(j) + ")." + std::to_string(k);
        building.footprint = {corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)};
        building.roof_m = height;
        buildings.push_back(std::move(building));
      }
    }
  }
  return buildings;
}

World read_world(const YAML::Node& scenario, const std::string& source, std::vector<std::string>& faults) {
  World world;
  ParameterReader reader(scenario, source);
  read_list(reader, "buildings", faults, [&](Entry& entry) { read_building(entry, world.buildings); });
  read_list(reader, "trees", faults, [&](Entry& entry) { read_tree(entry, world.trees); });
  return world;
}

std::vector<std::string> world_faults(const World& world, const Eigen::Vector2d& start) {
  std::ostringstream place;
  place << "start (" << start.x() << ", " << start.y() << ")";
  if (!start.allFinite()) return {place.str() + " is not finite"};
  std::vector<std::string> faults;
  for (const Building& building : world.buildings) {
    const bool is_in_the_way = building.base_m < kHeadroom && building.roof_m > 0.0;
    if (is_in_the_way && contains(building.footprint, start))
      faults.push_back(place.str() + " is inside " + building.name);
  }
  for (std::size_t i = 0; i < world.trees.size(); ++i) {
    const Tree& tree = world.trees[i];
    if ((tree.position - start).norm() >= tree.trunk_radius_m) continue;
    std::ostringstream trunk;
    trunk << " is inside the trunk of the tree at (" << tree.position.x() << ", " << tree.position.y() << ")";
    faults.push_back(place.str() + trunk.str());
  }
  return faults;
}

}  // namespace urban_gnss
