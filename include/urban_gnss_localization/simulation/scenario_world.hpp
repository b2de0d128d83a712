#pragma once

#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "urban_gnss_localization/simulation/world.hpp"

namespace urban_gnss {

/// City blocks between streets. Each is divided into buildings_per_side^2 buildings, wall to wall.
struct BlockGrid {
  Eigen::Vector2d origin{Eigen::Vector2d::Zero()};  ///< m, the low corner of block (0, 0)
  Eigen::Vector2i blocks{1, 1};                     ///< along x and y
  Eigen::Vector2d block_size{60.0, 60.0};           ///< m
  Eigen::Vector2d street_width{20.0, 20.0};         ///< m, between neighbours along x and along y
  int buildings_per_side{2};                        ///< of a block
  Eigen::Vector2d heights{20.0, 60.0};              ///< m, lowest and highest; drawn uniformly
  std::uint64_t seed{1};                            ///< of the heights
  std::vector<std::pair<int, int>> plazas;          ///< blocks (i, j) without buildings
};

/// The buildings of the blocks, row by row, named `(i, j).k`. A height depends on the seed and the building's place in
/// the grid alone: plazas do not change the others.
std::vector<Building> make_blocks(const BlockGrid& grid);

/// Reads buildings from a table with the columns building,vertex,x,y,roof_z: one corner a line in map-frame metres, the
/// corners of a building one after the other, numbered from 0. Named by their number in the table; they reach down to
/// `base_m`. What is wrong is added to `faults` with file and line; a building with a fault is left out.
std::vector<Building> read_building_table(const std::filesystem::path& file, double base_m, double reflection_loss_db,
                                          std::vector<std::string>& faults);

/// Reads the sections `buildings` and `trees` of a scenario, both of which may be absent; other names are not looked
/// at. `source` is the scenario's file: it stands in the faults, and paths in it are relative to its folder. Each bad
/// entry adds its faults, with file and line, and is left out. Footprints come out counter-clockwise.
///
/// `buildings` is a list, each entry one of
///   {footprint: [[x, y], ...], roof: 45, base: 0, name: bank, reflection_loss: 6}
///   {box: {center: [x, y], size: [lx, ly], yaw: 0.3}, roof: 45, base: 0, name: bank, reflection_loss: 6}
///   {file: blocks.csv, base: 0, reflection_loss: 6}     # read_building_table()
///   {grid: {origin: [x, y], blocks: [nx, ny], block_size: [lx, ly], street_width: [wx, wy], buildings_per_side: 2,
///           heights: [30, 60], seed: 7, plazas: [[i, j], ...]}, base: 0, reflection_loss: 6}    # BlockGrid
/// with m, rad and dB; roof and base are heights above the ground. Without a name it is `buildings[3]`, its place.
///
/// `trees` is a list, each entry {position: [x, y]} or {row: {from: [x, y], to: [x, y], spacing: 8}} and, where they
/// differ from Tree's defaults, trunk_radius, crown_radius, crown_base, crown_top (m) and attenuation (dB/m).
World read_world(const YAML::Node& scenario, const std::string& source, std::vector<std::string>& faults);

/// Why nothing can start at `start` (m, map frame): it is inside a building that reaches lower than 2 m above the
/// ground, or inside a tree's trunk. Names each. Empty where something can.
std::vector<std::string> world_faults(const World& world, const Eigen::Vector2d& start);

}  // namespace urban_gnss
