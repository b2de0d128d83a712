#include <gtest/gtest.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "urban_gnss_localization/simulation/polygon.hpp"
#include "urban_gnss_localization/simulation/scenario_world.hpp"
#include "urban_gnss_localization/simulation/wall_index.hpp"

namespace urban_gnss {
namespace {

using Eigen::Vector2d;

struct Outcome {
  World world;
  std::vector<std::string> faults;
};

Outcome read(const std::string& yaml, const std::string& source = "city.yaml") {
  Outcome outcome;
  outcome.world = read_world(YAML::Load(yaml), source, outcome.faults);
  return outcome;
}

/// The only fault; a failure where there is none or there are several.
std::string fault(const std::string& yaml) {
  const Outcome outcome = read(yaml);
  EXPECT_EQ(outcome.faults.size(), 1u) << yaml << ::testing::PrintToString(outcome.faults);
  return outcome.faults.empty() ? "" : outcome.faults.front();
}

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

bool is_good(const Polygon& polygon) { return polygon_fault(polygon).empty(); }

/// A folder that goes with the test.
class TableTest : public ::testing::Test {
 protected:
  TableTest() : folder_(std::filesystem::temp_directory_path() / ("scenario_world_" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(folder_);
  }
  ~TableTest() override { std::filesystem::remove_all(folder_); }

  std::vector<Building> table(const std::string& text) {
    std::ofstream(folder_ / "t.csv") << text;
    faults_.clear();
    return read_building_table(folder_ / "t.csv", 0.0, 6.0, faults_);
  }
  /// The only fault, behind the file's name.
  std::string table_fault(const std::string& text) {
    table(text);
    EXPECT_EQ(faults_.size(), 1u) << text << ::testing::PrintToString(faults_);
    return faults_.empty() ? "" : faults_[0].substr((folder_ / "t.csv").string().size() + 1);
  }

  std::filesystem::path folder_;
  std::vector<std::string> faults_;
};

TEST(Polygon, AreaAndOrientation) {
  const Polygon square{{0, 0}, {2, 0}, {2, 2}, {0, 2}};
  EXPECT_DOUBLE_EQ(signed_area(square), 4.0);
  const Polygon clockwise(square.rbegin(), square.rend());
  EXPECT_DOUBLE_EQ(signed_area(clockwise), -4.0);
  EXPECT_EQ(counter_clockwise(clockwise), square);
  EXPECT_EQ(counter_clockwise(square), square);
  EXPECT_DOUBLE_EQ(signed_area({}), 0.0);
}

TEST(Polygon, ContainsWhatIsInsideAConcaveOne) {
  const Polygon horseshoe{{0, 0}, {6, 0}, {6, 5}, {4, 5}, {4, 2}, {2, 2}, {2, 5}, {0, 5}};
  EXPECT_TRUE(contains(horseshoe, {1, 4}));
  EXPECT_FALSE(contains(horseshoe, {3, 4}));
  EXPECT_TRUE(contains(horseshoe, {5, 4}));
  EXPECT_TRUE(contains(horseshoe, {3, 1}));
  EXPECT_FALSE(contains(horseshoe, {-1, 2}));
  EXPECT_FALSE(contains(horseshoe, {-1, 5})) << "level with corners";
  EXPECT_FALSE(contains(horseshoe, {7, 2}));
  EXPECT_FALSE(contains({}, {0, 0}));
}

TEST(Polygon, PointOnASharedSideIsInOneOfTheTwo) {
  const Polygon left{{0, 0}, {1.1, 0.3}, {0.7, 3.1}, {-0.4, 2.0}};
  const Polygon right{{1.1, 0.3}, {3, 1}, {2, 3}, {0.7, 3.1}};
  for (double share = 0.05; share < 1.0; share += 0.05) {
    const Vector2d point = left[1] + share * (left[2] - left[1]);
    EXPECT_NE(contains(left, point), contains(right, point)) << share;
  }
}

TEST(Polygon, ConvexHullIsTheSmallestAround) {
  // Corners, points inside, one on a side and one twice, in no order.
  const Polygon hull = convex_hull({{4, 3}, {1, 1}, {0, 0}, {2, 0}, {4, 0}, {2, 2}, {0, 3}, {4, 0}, {3, 1}});
  EXPECT_EQ(hull.size(), 4u);
  EXPECT_DOUBLE_EQ(signed_area(hull), 12.0) << "counter-clockwise";
  for (const Vector2d& corner : {Vector2d(0, 0), Vector2d(4, 0), Vector2d(4, 3), Vector2d(0, 3)}) {
    EXPECT_NE(std::find(hull.begin(), hull.end(), corner), hull.end()) << corner.transpose();
  }
  EXPECT_TRUE(convex_hull({}).empty());
  EXPECT_FALSE(contains(convex_hull({{1, 1}}), {0, 0}));
  EXPECT_DOUBLE_EQ(signed_area(convex_hull({{0, 0}, {1, 1}, {2, 2}})), 0.0);
}

TEST(Polygon, FaultsHaveTheirReason) {
  EXPECT_EQ(polygon_fault({{0, 0}, {1, 0}, {1, 1}}), "");
  EXPECT_EQ(polygon_fault({{1, 1}, {1, 0}, {0, 0}}), "") << "clockwise";
  EXPECT_EQ(polygon_fault({{0, 0}, {4, 0}, {4, 4}, {2, 1}, {0, 4}}), "") << "concave";
  EXPECT_EQ(polygon_fault({{0, 0}, {2, 0}, {4, 0}, {4, 4}}), "") << "a corner on a straight side";
  EXPECT_EQ(polygon_fault({{0, 0}, {1, 0}}), "needs at least 3 corners, has 2");
  EXPECT_EQ(polygon_fault({}), "needs at least 3 corners, has 0");
  EXPECT_EQ(polygon_fault({{0, 0}, {1, 0}, {2, 0}}), "has no area");
  EXPECT_EQ(polygon_fault({{0, 0}, {1, 0}, {1, 1}, {1, 0}}), "corner (1, 0) is repeated");
  EXPECT_EQ(polygon_fault({{0, 0}, {1, 0}, {1, 1}, {0, 0}}), "corner (0, 0) is repeated (do not close the polygon)");
  EXPECT_EQ(polygon_fault({{0, 0}, {1, 0}, {1, NAN}}), "corner (1, nan) is not finite");
  EXPECT_EQ(polygon_fault({{0, 0}, {1e5, 0}, {1e5, 1e5}}), "");
  EXPECT_EQ(polygon_fault({{0, 0}, {-1e308, 0}, {1, 1}}), "corner (-1e+308, 0) is more than 100 km from the origin");
  EXPECT_EQ(polygon_fault({{0, 0}, {4, 4}, {4, 0}, {0, 4}}), "not a simple polygon (sides cross or overlap)");
  const std::string crossed = polygon_fault({{0, 0}, {4, 4}, {4, 0}, {-1, 5}});
  EXPECT_TRUE(has(crossed, "self-intersection point was found at (2, 2)")) << crossed;
  EXPECT_FALSE(is_good({{0, 0}, {6, 0}, {6, 3}, {3, 0}, {0, 3}})) << "touches itself";
  EXPECT_FALSE(is_good({{0, 0}, {4, 0}, {4, 4}, {4, -2}})) << "a spike";
}

TEST(ScenarioWorld, NothingIsAnEmptyWorld) {
  for (const char* yaml : {"", "{}", "{buildings: , trees: ~}", "{buildings: [], trees: []}", "{route: 3}"}) {
    const auto [world, faults] = read(yaml);
    EXPECT_TRUE(faults.empty()) << yaml;
    EXPECT_TRUE(world.buildings.empty() && world.trees.empty()) << yaml;
  }
}

TEST(ScenarioWorld, FootprintIsReadCounterClockwise) {
  const auto [world, faults] = read(
      "buildings:\n"
      "  - {footprint: [[0, 0], [0, 5], [5, 5], [5, 0]], roof: 45, base: 4, reflection_loss: 8, name: bank}\n"
      "  - {footprint: [[0, 0], [5, 0], [5, 5]], roof: 10}\n");
  ASSERT_TRUE(faults.empty()) << faults[0];
  ASSERT_EQ(world.buildings.size(), 2u);
  const Building& bank = world.buildings[0];
  EXPECT_EQ(bank.name, "bank");
  EXPECT_EQ(bank.roof_m, 45.0);
  EXPECT_EQ(bank.base_m, 4.0);
  EXPECT_EQ(bank.reflection_loss_db, 8.0);
  EXPECT_DOUBLE_EQ(signed_area(bank.footprint), 25.0);
  EXPECT_EQ(world.buildings[1].name, "buildings[1]");
  EXPECT_EQ(world.buildings[1].base_m, 0.0);
  EXPECT_EQ(world.buildings[1].reflection_loss_db, Building().reflection_loss_db);
}

TEST(ScenarioWorld, BoxIsTurnedAboutItsCenter) {
  const auto [world, faults] = read("buildings: [{box: {center: [10, 20], size: [4, 2], yaw: 0.3}, roof: 5}]");
  ASSERT_TRUE(faults.empty()) << faults[0];
  const Polygon& footprint = world.buildings.at(0).footprint;
  EXPECT_NEAR(signed_area(footprint), 8.0, 1e-12);
  const Vector2d along(std::cos(0.3), std::sin(0.3));
  EXPECT_TRUE(contains(footprint, Vector2d(10, 20) + 1.99 * along));
  EXPECT_FALSE(contains(footprint, Vector2d(10, 20) + 2.01 * along));
  EXPECT_FALSE(contains(footprint, Vector2d(10, 20) + 1.01 * Vector2d(-along.y(), along.x())));
}

TEST(ScenarioWorld, GridIsDeterministicAndPlazasAreEmpty) {
  const std::string grid =
      "buildings: [{grid: {origin: [100, 200], blocks: [3, 2], block_size: [60, 40], street_width: [20, 10], "
      "buildings_per_side: 2, heights: [30, 50], seed: ";
  const auto with = [&](const std::string& rest) { return read(grid + rest + "}, reflection_loss: 7}]"); };
  const auto [world, faults] = with("7, plazas: [[1, 0]]");
  ASSERT_TRUE(faults.empty()) << faults[0];
  ASSERT_EQ(world.buildings.size(), 20u);
  const auto full = with("7").world.buildings;
  const auto other = with("8").world.buildings;
  ASSERT_EQ(full.size(), 24u);
  EXPECT_EQ(world.buildings[0].name, "buildings[0].(0, 0).0");
  for (const Building& building : world.buildings) {
    const auto same = std::find_if(full.begin(), full.end(), [&](const auto& b) { return b.name == building.name; });
    ASSERT_NE(same, full.end());
    EXPECT_EQ(same->roof_m, building.roof_m) << "a plaza changes no other building";
    EXPECT_EQ(same->footprint, building.footprint);
    EXPECT_GE(building.roof_m, 30.0);
    EXPECT_LE(building.roof_m, 50.0);
    EXPECT_EQ(building.reflection_loss_db, 7.0);
    EXPECT_NEAR(signed_area(building.footprint), 30.0 * 20.0, 1e-9);
  }
  EXPECT_NE(full[0].roof_m, other[0].roof_m);
  const auto is_built = [&](double x, double y) { return WallIndex(world).is_inside({x, y, 1.0}); };
  EXPECT_TRUE(is_built(101, 201));
  EXPECT_TRUE(is_built(159, 239));
  EXPECT_FALSE(is_built(161, 201)) << "street";
  EXPECT_FALSE(is_built(181, 201)) << "plaza";
  EXPECT_TRUE(is_built(181, 251));
  EXPECT_FALSE(is_built(181, 241)) << "street";
  EXPECT_TRUE(is_built(100 + 2 * 80 + 59, 289));
}

TEST(ScenarioWorld, TreesStandAloneOrInARow) {
  const auto [world, faults] = read(
      "trees:\n"
      "  - {position: [1, 2], trunk_radius: 0.3, crown_radius: 4, crown_base: 2.5, crown_top: 11, attenuation: 2}\n"
      "  - {row: {from: [0, 0], to: [0.3, 0.4], spacing: 0.1}}\n"
      "  - {row: {from: [0, 0], to: [17, 0], spacing: 8}}\n"
      "  - {row: {from: [5, 5], to: [5, 5]}}\n");
  ASSERT_TRUE(faults.empty()) << faults[0];
  ASSERT_EQ(world.trees.size(), 1u + 6u + 3u + 1u);
  const Tree& tree = world.trees[0];
  EXPECT_EQ(tree.position, Vector2d(1, 2));
  EXPECT_EQ(tree.trunk_radius_m, 0.3);
  EXPECT_EQ(tree.crown_radius_m, 4.0);
  EXPECT_EQ(tree.crown_base_m, 2.5);
  EXPECT_EQ(tree.crown_top_m, 11.0);
  EXPECT_EQ(tree.attenuation_db_per_m, 2.0);
  EXPECT_NEAR((world.trees[6].position - Vector2d(0.3, 0.4)).norm(), 0.0, 1e-12) << "the last stands at the end";
  EXPECT_EQ(world.trees[9].position, Vector2d(16, 0));
  EXPECT_EQ(world.trees[9].crown_top_m, Tree().crown_top_m);
}

TEST(ScenarioWorld, FaultsOfBuildingsHaveFileAndLine) {
  EXPECT_TRUE(has(fault("\nbuildings:\n  - footprint: [[0, 0], [4, 4], [4, 0], [0, 4]]\n    roof: 9\n"),
                  "city.yaml:3: buildings[0].footprint: not a simple polygon"));
  EXPECT_EQ(fault("buildings:\n  - roof: 9\n    footprint:\n      - [0, 0]\n      - [1]\n      - [1, 1]\n"),
            "city.yaml:5: buildings[0].footprint[1]: must be two finite numbers, [x, y]");
  EXPECT_EQ(fault("buildings:\n  - {box: {center: [0, 0], size: [1, 1]}, roof: 9}\n  - {roof: 9, name: a}\n"),
            "city.yaml:3: buildings[1]: needs one of footprint, box, file, grid");
  EXPECT_EQ(fault("buildings: [{box: {center: [0, 0], size: [1, 1]}, file: a.csv, roof: 9}]"),
            "city.yaml:1: buildings[0]: needs one of footprint, box, file, grid, has box and file");
  EXPECT_EQ(fault("buildings: [{footprint: 3, roof: 9}]"),
            "city.yaml:1: buildings[0].footprint: must be a list of corners, [[x, y], ...]");
  EXPECT_EQ(fault("buildings:\n  - 5\n"), "city.yaml:2: buildings[0] must be a map of names to values");
  EXPECT_EQ(fault("\nbuildings: 5"), "city.yaml:2: buildings: must be a list");
  EXPECT_EQ(fault("buildings: [~]"), "city.yaml:1: buildings[0]: needs one of footprint, box, file, grid");
  EXPECT_EQ(fault("buildings:\n  - {footprint: [[0, 0], [1, 0], [1, 1]]}"),
            "city.yaml:2: buildings[0].roof: must be given, and higher than base");
  EXPECT_EQ(fault("buildings: [{footprint: [[0, 0], [1, 0], [1, 1]], roof: 3,\n base: 3}]"),
            "city.yaml:1: buildings[0].roof: must be given, and higher than base");
  EXPECT_EQ(fault("buildings: [{footprint: [[0, 0], [1, 0], [1, 1]], roof: 3,\n rof: 3}]"),
            "city.yaml:2: buildings[0].rof: no such parameter; did you mean roof?");
  EXPECT_EQ(fault("buildings: [{footprint: [[0, 0], [1, 0], [1, 1]], roof: 3, reflection_loss: -1}]"),
            "city.yaml:1: buildings[0].reflection_loss = -1: must be a finite number of at least 0");
  EXPECT_EQ(fault("buildings: [{file: absent.csv}]"), "city.yaml:1: buildings[0].file: 'absent.csv' is not there");
  EXPECT_EQ(fault("buildings: [{file: ''}]"), "city.yaml:1: buildings[0].file: '' is not there");
}

TEST(ScenarioWorld, FaultsOfBoxesAndGrids) {
  EXPECT_EQ(fault("buildings: [{box: {center: [0, 0]}, roof: 3}]"), "city.yaml:1: buildings[0].box.size: is missing");
  EXPECT_EQ(fault("buildings: [{box: {center: [0, 0], size: [1, 0]}, roof: 3}]"),
            "city.yaml:1: buildings[0].box.size: both must be greater than 0 and at most 100000");
  EXPECT_TRUE(has(fault("buildings: [{box: {center: [0, 0], size: [1, 1], jaw: 2}, roof: 3}]"), "did you mean yaw?"));
  EXPECT_EQ(fault("buildings: [{box: {center: [1e308, 0], size: [1, 1]}, roof: 3}]"),
            "city.yaml:1: buildings[0].box.center: both must be at least -100000 and at most 100000");
  EXPECT_TRUE(has(fault("buildings: [{box: {center: [0, 0], size: [1, 1e-9]}, roof: 3}]"), "box: corner (-0.5, "));
  EXPECT_EQ(fault("buildings: [{box: {center: [0, .nan], size: [1, 1]}, roof: 3}]"),
            "city.yaml:1: buildings[0].box.center: must be two finite numbers, [x, y]");
  const auto grid_fault = [](const std::string& fields) {
    const std::string text = fault("buildings:\n  - grid: {" + fields + "}\n");
    EXPECT_EQ(text.rfind("city.yaml:2: buildings[0].grid.", 0), 0u) << text;
    return text.substr(std::min(text.size(), std::string("city.yaml:2: buildings[0].grid.").size()));
  };
  EXPECT_EQ(grid_fault("blocks: [2.5, 1]"), "blocks: both must be whole numbers");
  EXPECT_EQ(grid_fault("blocks: [400, 400]"), "blocks: makes more than 100000 buildings");
  EXPECT_EQ(grid_fault("blocks: [0, 1]"), "blocks: both must be at least 1 and at most 100000");
  EXPECT_EQ(grid_fault("heights: [60, 30]"), "heights: must be [lowest, highest]");
  EXPECT_EQ(grid_fault("plazas: [[0, 0], [1, 0]]"), "plazas[1]: must be [i, j], a block of the grid, from 0");
  EXPECT_EQ(grid_fault("plazas: 3"), "plazas: must be a list of blocks, [[i, j], ...]");
  EXPECT_EQ(grid_fault("block_size: [-1, 3]"), "block_size: both must be greater than 0 and at most 100000");
  EXPECT_TRUE(has(fault("buildings: [{grid: {blocks: [2, 1], block_size: [9e4, 9]}}]"), "more than 100 km"));
  EXPECT_EQ(grid_fault("buildings_per_side: 0"), "buildings_per_side = 0: must be at least 1 and at most 100");
  EXPECT_EQ(fault("buildings: [{grid: {}, roof: 4}]"), "city.yaml:1: buildings[0].roof: no such parameter");
}

TEST(ScenarioWorld, FaultsOfTrees) {
  EXPECT_EQ(fault("trees:\n  - {crown_radius: 3}\n"), "city.yaml:2: trees[0]: needs one of position and row");
  EXPECT_EQ(fault("trees: [{position: [0, 0], row: {from: [0, 0], to: [1, 1]}}]"),
            "city.yaml:1: trees[0]: needs one of position and row");
  EXPECT_EQ(fault("trees: [{position: [0, 0], crown_base: 5, crown_top: 5}]"),
            "city.yaml:1: trees[0].crown_top: must be higher than crown_base");
  EXPECT_EQ(fault("trees: [{position: here}]"), "city.yaml:1: trees[0].position: must be two finite numbers, [x, y]");
  EXPECT_EQ(fault("trees: [{row: {from: [0, 0]}}]"), "city.yaml:1: trees[0].row.to: is missing");
  EXPECT_EQ(fault("trees: [{row: {from: [0, 0], to: [1, 1], spacing: 0}}]"),
            "city.yaml:1: trees[0].row.spacing = 0: must be a finite number greater than 0");
  EXPECT_EQ(fault("trees: [{row: {from: [0, 0], to: [1, 1], spacing: 1e-300}}]"),
            "city.yaml:1: trees[0].row.spacing: makes more than 100000 trees");
  EXPECT_EQ(fault("trees: [{position: [0, 2e5]}]"),
            "city.yaml:1: trees[0].position: both must be at least -100000 and at most 100000");
}

TEST(ScenarioWorld, EveryBadEntryIsReportedAndTheGoodOnesStay) {
  const auto [world, faults] = read(
      "buildings:\n"
      "  - {footprint: [[0, 0], [1, 0]], roof: -1}\n"
      "  - {footprint: [[0, 0], [5, 0], [5, 5]], roof: 10}\n"
      "  - {box: {center: [0, 0]}, roof: high}\n"
      "trees:\n"
      "  - {position: [0, 0], crown_radius: -1}\n"
      "  - {position: [9, 9]}\n");
  ASSERT_EQ(world.buildings.size(), 1u);
  EXPECT_EQ(world.buildings[0].name, "buildings[1]");
  EXPECT_EQ(world.trees.size(), 1u);
  const auto count = [&faults = faults](const std::string& part) {
    return std::count_if(faults.begin(), faults.end(), [&](const auto& text) { return text.rfind(part, 0) == 0; });
  };
  EXPECT_EQ(count("city.yaml:2: buildings[0]."), 2);
  EXPECT_EQ(count("city.yaml:4: buildings[2].roof = high: must be a number"), 1);
  EXPECT_EQ(count("city.yaml:4: buildings[2].box.size: is missing"), 1);
  EXPECT_EQ(count("city.yaml:6: trees[0].crown_radius = -1"), 1);
}

TEST(ScenarioWorld, StartIsRefusedInsideABuildingOrATrunk) {
  const World world = read(
                          "buildings:\n"
                          "  - {box: {center: [0, 0], size: [10, 10]}, roof: 20}\n"
                          "  - {box: {center: [2, 0], size: [10, 10]}, roof: 20, name: bank}\n"
                          "  - {box: {center: [50, 0], size: [10, 10]}, roof: 9, base: 5, name: bridge}\n"
                          "trees: [{position: [20, 0], trunk_radius: 0.5}]\n")
                          .world;
  const auto faults = world_faults(world, {1.0, 0.5});
  ASSERT_EQ(faults.size(), 2u);
  EXPECT_EQ(faults[0], "start (1, 0.5) is inside buildings[0]");
  EXPECT_EQ(faults[1], "start (1, 0.5) is inside bank");
  EXPECT_EQ(world_faults(world, {20.4, 0.0}).at(0), "start (20.4, 0) is inside the trunk of the tree at (20, 0)");
  EXPECT_TRUE(world_faults(world, {20.6, 0.0}).empty()) << "under the crown";
  EXPECT_TRUE(world_faults(world, {50.0, 0.0}).empty()) << "under the bridge";
  EXPECT_TRUE(world_faults(world, {30.0, 0.0}).empty());
  EXPECT_EQ(world_faults(world, {NAN, 0.0}).size(), 1u);
  EXPECT_TRUE(world_faults({}, {0.0, 0.0}).empty());
}

constexpr const char* kTriangle = "0,0,0,0,9\n0,1,4,0,9\n0,2,4,4,9\n";
const std::string kHeader = "building,vertex,x,y,roof_z\n";

TEST_F(TableTest, ReadsBuildings) {
  const auto buildings = table(
      "building,vertex,x,y,roof_z\r\n0,0,0,0,9\r\n0,1,4,4,9\r\n0,2,4,0,9\r\n\r\ntower,0,9,9,30.5\r\n"
      "tower,1,12,9,30.5\r\ntower,2,12,12,30.5");
  ASSERT_TRUE(faults_.empty()) << faults_[0];
  ASSERT_EQ(buildings.size(), 2u);
  EXPECT_EQ(buildings[0].name, "0");
  EXPECT_DOUBLE_EQ(signed_area(buildings[0].footprint), 8.0);
  EXPECT_EQ(buildings[1].name, "tower");
  EXPECT_EQ(buildings[1].roof_m, 30.5);
}

TEST_F(TableTest, FaultsHaveTheLineOfTheTable) {
  EXPECT_EQ(table_fault("a,b\n"), "1: the columns must be building,vertex,x,y,roof_z");
  EXPECT_EQ(table_fault(kHeader), "1: no buildings");
  EXPECT_EQ(table_fault(kHeader + kTriangle + "1,0,2,3\n"), "5: 4 columns where there must be 5");
  EXPECT_EQ(table_fault(kHeader + kTriangle + ",,,,\n"), "5: 4 columns where there must be 5");
  EXPECT_EQ(table_fault(kHeader + kTriangle + "1,0,0,zero,9\n1,1,4,0,9\n"), "5: 'zero' is not a finite number");
  EXPECT_EQ(table_fault(kHeader + kTriangle + "1,0,0,nan,9\n"), "5: 'nan' is not a finite number");
  EXPECT_EQ(table_fault(kHeader + kTriangle + "0,4,0,4,9\n"), "5: vertex must be 3");
  EXPECT_EQ(table_fault(kHeader + kTriangle + "0,3,0,4,8\n"), "5: roof_z is not that of the building's other corners");
  EXPECT_EQ(table_fault(kHeader + kTriangle + "1,0,0,0,9\n1,1,1,0,9\n"),
            "5: building 1: needs at least 3 corners, has 2");
  EXPECT_EQ(table_fault(kHeader + "0,0,0,0,-2\n0,1,4,0,-2\n0,2,4,4,-2\n"),
            "2: building 0: roof_z must be higher than the base");
  EXPECT_TRUE(
      has(table_fault(kHeader + "0,0,0,0,9\n0,1,4,4,9\n0,2,4,0,9\n0,3,0,4,9\n"), "2: building 0: not a simple"));
  table(kHeader + kTriangle + "1,0,0,0,9\n1,1,4,0,9\n1,2,4,4,9\n" + kTriangle);
  ASSERT_EQ(faults_.size(), 1u);
  EXPECT_TRUE(has(faults_[0], ":8: building 0 has corners above already"));
}

TEST_F(TableTest, GoodBuildingsBesideBadOnesAreKept) {
  const auto buildings =
      table(kHeader + kTriangle + "1,0,x,0,9\n1,1,4,0,9\n1,2,4,4,9\n2,0,0,0,9\n2,1,4,0,9\n2,2,4,4,9\n");
  EXPECT_EQ(faults_.size(), 1u);
  ASSERT_EQ(buildings.size(), 2u);
  EXPECT_EQ(buildings[1].name, "2");
}

TEST_F(TableTest, FileIsFoundBesideTheScenario) {
  table(kHeader + kTriangle);
  const auto [world, faults] =
      read("buildings: [{file: t.csv, reflection_loss: 9, base: -2}]", (folder_ / "city.yaml").string());
  ASSERT_TRUE(faults.empty()) << faults[0];
  ASSERT_EQ(world.buildings.size(), 1u);
  EXPECT_EQ(world.buildings[0].name, "buildings[0].0");
  EXPECT_EQ(world.buildings[0].reflection_loss_db, 9.0);
  EXPECT_EQ(world.buildings[0].base_m, -2.0);
}

TEST_F(TableTest, AbsentFileOrFolderIsAFault) {
  EXPECT_TRUE(read_building_table(folder_ / "absent.csv", 0.0, 6.0, faults_).empty());
  EXPECT_TRUE(read_building_table(folder_, 0.0, 6.0, faults_).empty());
  EXPECT_EQ(faults_.size(), 2u);
}

TEST(RealBlocks, AreImported) {
  const char* data = std::getenv("URBAN_GNSS_DATA");
  const std::filesystem::path folder = std::filesystem::path(data == nullptr ? "" : data) / "ray";
  if (data == nullptr || !std::filesystem::exists(folder)) GTEST_SKIP() << "URBAN_GNSS_DATA has no folder ray";
  const auto [world, faults] =
      read("buildings: [{file: tst_buildings.csv}, {file: kowloonbay_buildings.csv}]", (folder / "city.yaml").string());
  EXPECT_TRUE(faults.empty()) << faults[0];
  ASSERT_EQ(world.buildings.size(), 39u + 12u);
  EXPECT_EQ(WallIndex(world).walls().size(), 274u + 88u);
  for (const Building& building : world.buildings) EXPECT_GT(signed_area(building.footprint), 1.0);
}

}  // namespace
}  // namespace urban_gnss
