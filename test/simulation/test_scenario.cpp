#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "matchers.hpp"
#include "urban_gnss_localization/simulation/scenario.hpp"

namespace urban_gnss {
namespace {

using Eigen::Vector2d;

const char* const kRoute = "route: {waypoints: [[0, 0], [100, 0]]}\n";

/// A folder that goes with the test.
class ScenarioTest : public ::testing::Test {
 protected:
  ScenarioTest() : folder_(std::filesystem::temp_directory_path() / ("scenario_" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(folder_);
  }
  ~ScenarioTest() override { std::filesystem::remove_all(folder_); }

  std::string file() const { return (folder_ / "city.yaml").string(); }
  void write(const std::string& text, const std::string& name = "city.yaml") const {
    std::ofstream(folder_ / name) << text;
  }
  Scenario load(const std::string& text, const std::vector<std::string>& overrides = {}) const {
    write(text);
    return load_scenario(file(), overrides);
  }
  /// What is said of it; empty where it is taken.
  std::string refusal(const std::string& text, const std::vector<std::string>& overrides = {}) const {
    try {
      load(text, overrides);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }

  std::filesystem::path folder_;
};

::testing::AssertionResult says(const std::string& text, const std::string& part) {
  if (text.find(part) != std::string::npos) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << "'" << part << "' is not in: " << (text.empty() ? "(no error)" : text);
}

std::size_t fault_count(const std::string& refusal) {
  std::size_t count = 0;
  for (auto at = refusal.find("\n  - "); at != std::string::npos; at = refusal.find("\n  - ", at + 1)) ++count;
  return count;
}

TEST_F(ScenarioTest, RouteAloneIsAScenario) {
  const Scenario scenario = load(kRoute);
  EXPECT_EQ(scenario.file, file());
  EXPECT_EQ(scenario.seed, 1);
  EXPECT_EQ(scenario.duration_s, 0.0);
  EXPECT_TRUE(near(scenario.start, {0.0, 0.0, 0.0}, 0.0));
  EXPECT_TRUE(scenario.world.buildings.empty());
  EXPECT_TRUE(scenario.cars.empty());
  EXPECT_TRUE(scenario.faults.empty());
  EXPECT_EQ(scenario.lidar.type, LidarType::kSpinning);
  EXPECT_EQ(scenario.receiver.rate, ReceiverParameters().rate);
}

TEST_F(ScenarioTest, EveryValueArrives) {
  const Scenario scenario = load(R"(
datum: [22.3, 114.2, 5]
start_time: 2026-05-04T09:30:00Z
seed: 7
duration: 12.5
start: [1, 2, 4]
vehicle: {drive: differential, antenna_z: 1.2}
autopilot: {corner_radius: 1.5}
odometry: {track_width: 0.6}
imu: {rate: 200}
sky: {glonass: true}
signals: {max_reflections: 2}
receiver: {rate: 10, cn0_zenith: 48}
lidar: {type: rotating_2d}
buildings: [{box: {center: [50, 20], size: [10, 10]}, roof: 9}]
trees: [{position: [30, 5]}]
route: {loop: true, waypoints: [[0, 0], [100, 0], [100, 100]]}
faults:
  - {type: ramp, start: 5, rate: [1, 2, 3]}
  - {type: nan, start: 9}
)");
  EXPECT_EQ(scenario.datum, (GeodeticPosition{22.3, 114.2, 5.0}));
  EXPECT_EQ(scenario.start_time, Stamp(1777887000LL * 1000000000LL));  // date -u -d 2026-05-04T09:30:00Z +%s
  EXPECT_EQ(scenario.seed, 7);
  EXPECT_EQ(scenario.duration_s, 12.5);
  EXPECT_TRUE(near(scenario.start, {1.0, 2.0, 4.0 - 2.0 * kPi}, 1e-12));
  EXPECT_EQ(scenario.vehicle.drive, Drive::kDifferential);
  EXPECT_EQ(scenario.vehicle.antenna_z, 1.2);
  EXPECT_EQ(scenario.autopilot.corner_radius, 1.5);
  EXPECT_EQ(scenario.odometry.track_width, 0.6);
  EXPECT_EQ(scenario.imu.rate, 200.0);
  EXPECT_TRUE(scenario.sky.glonass);
  EXPECT_EQ(scenario.signals.max_reflections, 2);
  EXPECT_EQ(scenario.receiver.rate, 10.0);
  EXPECT_EQ(scenario.receiver.channel.cn0_zenith, 48.0);
  EXPECT_EQ(scenario.lidar.type, LidarType::kRotating2d);
  ASSERT_EQ(scenario.world.buildings.size(), 1u);
  EXPECT_EQ(scenario.world.buildings[0].roof_m, 9.0);
  ASSERT_EQ(scenario.world.trees.size(), 1u);
  EXPECT_TRUE(scenario.route.loop);
  ASSERT_EQ(scenario.faults.size(), 2u);
  EXPECT_EQ(scenario.faults[0].type, FixFaultType::kRamp);
  EXPECT_EQ(scenario.faults[0].rate, (std::vector<double>{1.0, 2.0, 3.0}));
  EXPECT_EQ(scenario.faults[1].start, 9.0);
}

TEST_F(ScenarioTest, SpeedHoldsUntilTheNextAndAStopDoesNot) {
  const Scenario scenario = load(
      "route:\n"
      "  speed: 4\n"
      "  waypoints: [[0, 0], {at: [0, 10], speed: 6, stop: 3}, [0, 20], {at: [0, 30], speed: 5}]\n");
  const std::vector<double> speeds{4.0, 6.0, 6.0, 5.0};
  const std::vector<double> stops{0.0, 3.0, 0.0, 0.0};
  ASSERT_EQ(scenario.route.waypoints.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(scenario.route.waypoints[i].speed_mps, speeds[i]) << i;
    EXPECT_EQ(scenario.route.waypoints[i].stop_s, stops[i]) << i;
    EXPECT_EQ(scenario.route.waypoints[i].position, Vector2d(0.0, 10.0 * static_cast<double>(i)));
  }
  EXPECT_TRUE(near(scenario.start, {0.0, 0.0, kPi / 2.0}, 1e-12)) << "towards the second waypoint";
}

TEST_F(ScenarioTest, CarsStandEvenlyAlongTheirLoop) {
  const Scenario scenario = load(
      std::string(kRoute) + "cars: [{loop: [[0, 50], [30, 50], [30, 60], [0, 60]], phase: 5, count: 4, speed: -3}]\n");
  ASSERT_EQ(scenario.cars.size(), 4u);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_DOUBLE_EQ(scenario.cars[k].phase_m, 5.0 + 20.0 * static_cast<double>(k));  // 80 m round
    EXPECT_EQ(scenario.cars[k].speed_mps, -3.0);
  }
}

TEST_F(ScenarioTest, AllFaultsAtOnceEachWithItsLine) {
  const std::string text = refusal(
      "datum: [91, 0, 0]\n"                                             // 1
      "seeed: 3\n"                                                      // 2
      "start_time: yesterday\n"                                         // 3
      "receiver:\n"                                                     // 4
      "  rate: 99\n"                                                    // 5
      "  latensy_max: 1\n"                                              // 6
      "imu: [1]\n"                                                      // 7
      "buildings:\n"                                                    // 8
      "  - {footprint: [[0, 0], [9, 9], [9, 0], [0, 9]], roof: 5}\n"    // 9
      "  - {box: {center: [-50, 0], size: [20, 20]}, roof: 20}\n"       // 10
      "trees: {position: [0, 0]}\n"                                     // 11
      "faults:\n"                                                       // 12
      "  - {type: spike}\n"                                             // 13
      "  - {type: spyke, share: 2}\n"                                   // 14
      "  - {type: ramp, rate: [1, 2]}\n"                                // 15
      "cars:\n"                                                         // 16
      "  - {loop: [[0, 0], [0, x]]}\n"                                  // 17
      "route:\n"                                                        // 18
      "  waypoints: [[-50, 0], {at: [0, 0], stop: -1}, 7, [100, 0]]\n"  // 19
      "  sped: 3\n");                                                   // 20
  EXPECT_TRUE(says(text, file() + ":1: datum: "));
  EXPECT_TRUE(says(text, file() + ":2: seeed: no such parameter; did you mean seed?"));
  EXPECT_TRUE(says(text, file() + ":3: start_time: yesterday: must be a time in UTC"));
  EXPECT_TRUE(says(text, file() + ":5: receiver.rate = 99: must be at least 0.1 and at most 50"));
  EXPECT_TRUE(says(text, file() + ":6: receiver.latensy_max: no such parameter; did you mean latency_max?"));
  EXPECT_TRUE(says(text, file() + ":7: imu must be a map of names to values"));
  EXPECT_TRUE(says(text, file() + ":9: buildings[0].footprint: "));
  EXPECT_TRUE(says(text, file() + ":11: trees: must be a list"));
  EXPECT_TRUE(says(text, file() + ":14: faults[1].type = spyke: must be one of spike, blackout"));
  EXPECT_TRUE(says(text, file() + ":14: faults[1].share = 2: must be at least 0 and at most 1"));
  EXPECT_TRUE(says(text, file() + ":15: faults[2].rate: must be three numbers"));
  EXPECT_TRUE(says(text, file() + ":17: cars[0].loop[1]: must be two finite numbers"));
  EXPECT_TRUE(says(text, file() + ":17: cars[0].loop: "));
  EXPECT_TRUE(says(text, file() + ":19: route.waypoints[1].stop = -1: "));
  EXPECT_TRUE(says(text, file() + ":19: route.waypoints: "));
  EXPECT_TRUE(says(text, file() + ":19: route.waypoints[2]: must be [x, y]"));
  EXPECT_TRUE(says(text, file() + ":20: route.sped: no such parameter; did you mean speed?"));
  EXPECT_TRUE(says(text, "start (-50, 0) is inside buildings[1]"));
  EXPECT_EQ(fault_count(text), 18u) << text;
}

TEST_F(ScenarioTest, FootprintThatCrossesItselfIsRefused) {
  const std::string text = refusal(std::string(kRoute) +
                                   "buildings:\n"
                                   "  - {footprint: [[0, 10], [9, 19], [9, 10], [0, 19]], roof: 5}\n");
  EXPECT_TRUE(says(text, file() + ":3: buildings[0].footprint: "));
  EXPECT_TRUE(says(text, "cross"));
  EXPECT_EQ(fault_count(text), 1u) << text;
}

TEST_F(ScenarioTest, StartInsideABuildingIsRefused) {
  const std::string building = "buildings: [{name: bank, box: {center: [0, 0], size: [10, 10]}, roof: 20}]\n";
  EXPECT_TRUE(says(refusal(kRoute + building), ":1: route: start (0, 0) is inside bank"));
  EXPECT_TRUE(says(refusal(kRoute + building + "start: [3, 3, 0]\n"), ":3: start: start (3, 3) is inside bank"));
  EXPECT_EQ(refusal(kRoute + building + "start: [-6, 0, 0]\n"), "") << "beside it";
  EXPECT_EQ(refusal(std::string(kRoute) + "buildings: [{box: {center: [0, 0], size: [10, 10]}, base: 6, roof: 9}]\n"),
            "")
      << "below a bridge";
  EXPECT_TRUE(says(refusal(kRoute + std::string("start: [0, 0]\n")), "start: must be x (m), y (m) and yaw (rad)"));
}

TEST_F(ScenarioTest, RouteHasWaypointsOrATrack) {
  EXPECT_TRUE(says(refusal("seed: 1\n"), "route.waypoints: a route needs either waypoints or a track"));
  EXPECT_TRUE(says(refusal("route: {track: t.csv, waypoints: [[0, 0], [1, 0]]}\n"), "either waypoints or a track"));
  EXPECT_TRUE(says(refusal("route: {waypoints: [[0, 0]]}\n"), file() + ":1: route.waypoints: "));
  EXPECT_TRUE(says(refusal("route: {waypoints: [[5, 5], [5, 5]]}\n"), file() + ":1: route.waypoints: "));
  EXPECT_TRUE(says(refusal("route: {track: absent.csv}\n"), "absent.csv"));
  EXPECT_TRUE(says(refusal("route: {loop: true, waypoints: [[0, 0], [9, 0]]}\n"),
                   "duration: a route that is a loop has no end"));
}

TEST_F(ScenarioTest, TrackIsFoundBesideTheScenario) {
  std::string track = "stamp,x,y,z\n";
  for (int i = 0; i <= 100; ++i) track += std::to_string(i) + "," + std::to_string(5 * i) + ",20,0\n";
  write(track, "track.csv");
  const Scenario scenario = load("route: {track: track.csv}\n");
  ASSERT_GT(scenario.route.waypoints.size(), 100u);
  EXPECT_NEAR(scenario.route.waypoints.front().speed_mps, 5.0, 0.5);
  EXPECT_TRUE(near(scenario.start, {0.0, 20.0, 0.0}, 3.0));
  EXPECT_NEAR(scenario.route.length_m(), 500.0, 10.0);
}

TEST_F(ScenarioTest, WhatIsNoYamlIsRefusedWithItsLine) {
  EXPECT_TRUE(says(refusal("seed: 1\nroute: {waypoints: [[0, 0]\nimu: {rate: 5}\n"), file() + ":3: "));
  EXPECT_TRUE(says(refusal("- 1\n- 2\n"), "must be a map of names to values"));
  EXPECT_TRUE(says(refusal(""), "must be a map of names to values"));
  EXPECT_THROW(load_scenario((folder_ / "absent.yaml").string()), std::runtime_error);
  try {
    load_scenario((folder_ / "absent.yaml").string());
  } catch (const std::runtime_error& error) {
    EXPECT_TRUE(says(error.what(), (folder_ / "absent.yaml").string() + ": no such file; there are "));
  }
}

TEST_F(ScenarioTest, OverridesArePutOverTheFile) {
  const std::string text = std::string(kRoute) + "receiver: {rate: 10, uere: 2}\n";
  const Scenario scenario =
      load(text, {"receiver.rate=2", "imu.rate=50", "seed=9", "datum=[1, 2, 3]", "lidar.type=none", "duration=4"});
  EXPECT_EQ(scenario.receiver.rate, 2.0);
  EXPECT_EQ(scenario.receiver.uere, 2.0) << "the section's other values stay";
  EXPECT_EQ(scenario.imu.rate, 50.0) << "of a section that the file has not";
  EXPECT_EQ(scenario.seed, 9);
  EXPECT_EQ(scenario.datum, (GeodeticPosition{1.0, 2.0, 3.0}));
  EXPECT_EQ(scenario.lidar.type, LidarType::kNone);
  EXPECT_EQ(load(text, {"seed=2", "seed=3"}).seed, 3) << "the last counts";
  EXPECT_EQ(load(text).receiver.rate, 10.0) << "the file is as it was";
}

TEST_F(ScenarioTest, BadOverridesAreRefused) {
  for (const char* text : {"seed", "=3", "", "imu.=3", ".rate=3"}) {
    EXPECT_TRUE(says(refusal(kRoute, {text}), "must be NAME=VALUE or SECTION.NAME=VALUE")) << text;
  }
  EXPECT_TRUE(says(refusal(kRoute, {"seed=[1"}), "seed=[1"));
  EXPECT_TRUE(says(refusal(kRoute, {"imu.rate=fast"}), "imu.rate = fast: must be a number"));
  EXPECT_TRUE(says(refusal(kRoute, {"imu.rat=5"}), "imu.rat: no such parameter; did you mean rate?"));
  EXPECT_TRUE(says(refusal(kRoute, {"lidarr.rate=5"}), "lidarr: no such parameter; did you mean lidar?"));
  EXPECT_TRUE(says(refusal(kRoute, {"route.speed.now=5"}), "route.speed = {now: 5}: must be a number"));
  const std::string two = refusal(kRoute, {"imu.rate=-1", "seed=x"});
  EXPECT_EQ(fault_count(two), 2u) << two;
  // A name below what is no section.
  EXPECT_TRUE(says(refusal(std::string("seed: 4\n") + kRoute, {"seed.x=1"}), "seed.x=1: seed is no section"));
  EXPECT_TRUE(says(refusal(std::string("trees: [{position: [9, 9]}]\n") + kRoute, {"trees.x=1"}),
                   "trees.x=1: trees is no section"));
}

TEST_F(ScenarioTest, RealBlocksAndARealTrackAreImported) {
  const char* data = std::getenv("URBAN_GNSS_DATA");
  if (data == nullptr) GTEST_SKIP() << "URBAN_GNSS_DATA is not set";
  const std::string blocks = std::string(data) + "/ray/tst_buildings.csv";
  const std::string track = std::string(data) + "/truth_only/berlin_gendarmenmarkt.csv";
  for (const std::string& needed : {blocks, track}) {
    if (!std::filesystem::is_regular_file(needed)) GTEST_SKIP() << "no file " << needed;
  }
  const Scenario scenario =
      load("start: [400, 400, 0]\nbuildings: [{file: " + blocks + "}]\nroute: {track: " + track + "}\n");
  // Counted by other means: awk -F, 'NR > 1 {n[$1]} END {print length(n)}'
  std::ifstream in(blocks);
  std::string line;
  std::string last;
  std::size_t count = 0;
  std::getline(in, line);
  while (std::getline(in, line)) {
    const std::string number = line.substr(0, line.find(','));
    if (number != last) ++count;
    last = number;
  }
  EXPECT_EQ(scenario.world.buildings.size(), count);
  EXPECT_GT(scenario.route.length_m(), 100.0);
  for (const RouteWaypoint& waypoint : scenario.route.waypoints) EXPECT_GE(waypoint.speed_mps, 1.0);
}

TEST(ParseUtc, KnowsTheCalendar) {
  const auto seconds = [](const char* text) { return parse_utc(text).count() / 1000000000LL; };
  // date -u -d TEXT +%s
  EXPECT_EQ(seconds("2026-05-04T09:30:00Z"), 1777887000);
  EXPECT_EQ(seconds("2024-02-29T23:59:59Z"), 1709251199);
  EXPECT_EQ(seconds("1980-01-06T00:00:00Z"), 315964800);
  EXPECT_EQ(parse_utc("2026-05-04T09:30:01Z") - parse_utc("2026-05-04T09:30:00Z"), Stamp(1000000000));
}

TEST(ParseUtc, RefusesEverythingElse) {
  for (const char* text :
       {"", "2026-05-04", "2026-05-04T09:30:00", "2026-05-04 09:30:00Z", "2026-05-04T09:30:00+02:00",
        "2026-05-04T09:30:00.5Z", "2023-02-29T00:00:00Z", "2026-13-01T00:00:00Z", "2026-00-01T00:00:00Z",
        "2026-04-31T00:00:00Z", "2026-05-04T24:00:00Z", "2026-05-04T09:60:00Z", "2026-05-04T09:30:60Z",
        "1979-12-31T23:59:59Z", "2101-01-01T00:00:00Z", "4586-05-04T09:30:00Z", "0000-01-01T00:00:00Z",
        "26-05-04T09:30:00Z", " 2026-05-04T09:30:00Z"}) {
    try {
      parse_utc(text);
      ADD_FAILURE() << text;
    } catch (const std::invalid_argument& error) {
      EXPECT_TRUE(says(error.what(), std::string(text) + ": must be a time in UTC")) << text;
    }
  }
}

}  // namespace
}  // namespace urban_gnss
