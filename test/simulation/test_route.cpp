#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "urban_gnss_localization/simulation/route.hpp"
#include "urban_gnss_localization/simulation/vehicle.hpp"

namespace urban_gnss {
namespace {

constexpr double kStep_s = 0.01;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

Route route_through(const std::vector<Eigen::Vector2d>& positions, double speed_mps = 10.0, bool loop = false) {
  Route route;
  for (const Eigen::Vector2d& position : positions) route.waypoints.push_back({position, speed_mps, 0.0});
  route.loop = loop;
  return route;
}

Route grid(bool loop) {
  return route_through({{0, 0}, {80, 0}, {80, 80}, {160, 80}, {160, 0}, {240, 0}, {240, 160}, {0, 160}}, 10.0, loop);
}

double distance_to_polyline(const Eigen::Vector2d& point, const std::vector<Eigen::Vector2d>& polyline) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i + 1 < polyline.size(); ++i) {
    const Eigen::Vector2d leg = polyline[i + 1] - polyline[i];
    const double share =
        leg.squaredNorm() > 0.0 ? std::clamp(leg.dot(point - polyline[i]) / leg.squaredNorm(), 0.0, 1.0) : 0.0;
    nearest = std::min(nearest, (polyline[i] + share * leg - point).norm());
  }
  return nearest;
}

struct Driven {
  double time_s{0.0};
  double from_route_m{0.0};   ///< farthest
  double from_path_m{0.0};    ///< farthest, after the first seconds
  double top_speed_mps{0.0};  ///< nominal
  double top_lateral_mps2{0.0};
  double parked_s{0.0};
  Pose2 end;
};

Driven drive(const Route& route, RouteFollower& follower, double limit_s, int laps = 1,
             const VehicleParameters& parameters = {}) {
  std::vector<Eigen::Vector2d> polyline;
  for (const RouteWaypoint& waypoint : route.waypoints) polyline.push_back(waypoint.position);
  if (route.loop) polyline.push_back(polyline.front());
  std::vector<Eigen::Vector2d> path;
  for (const auto& point : follower.path()) path.push_back(point.position);

  Vehicle vehicle(parameters, route.start(), 1);
  Driven result;
  for (int i = 0; result.time_s < limit_s && !follower.finished() && follower.laps() < laps; ++i) {
    result.time_s = kStep_s * i;
    vehicle.step(follower.command(vehicle.pose(), result.time_s), kStep_s);
    result.top_speed_mps = std::max(result.top_speed_mps, vehicle.nominal_twist().speed_mps);
    result.top_lateral_mps2 = std::max(result.top_lateral_mps2, std::abs(vehicle.acceleration().y()));
    if (vehicle.nominal_twist().speed_mps == 0.0) result.parked_s += kStep_s;
    if (i % 10 != 0) continue;
    const Eigen::Vector2d position = vehicle.pose().position();
    result.from_route_m = std::max(result.from_route_m, distance_to_polyline(position, polyline));
    if (result.time_s > 8.0) result.from_path_m = std::max(result.from_path_m, distance_to_polyline(position, path));
  }
  result.end = vehicle.pose();
  return result;
}

TEST(Route, StartLooksAtTheNextPlace) {
  const Pose2 start = route_through({{1, 2}, {1, 2}, {1, 7}}).start();
  EXPECT_EQ(start.position(), Eigen::Vector2d(1.0, 2.0));
  EXPECT_NEAR(start.yaw, 0.5 * kPi, 1e-12);
  EXPECT_NEAR(grid(false).length_m(), 80.0 * 5 + 160.0 + 240.0, 1e-9);
  EXPECT_NEAR(grid(true).length_m(), 80.0 * 5 + 160.0 * 2 + 240.0, 1e-9);
}

TEST(Route, WhatCannotBeDrivenIsRefused) {
  EXPECT_NO_THROW(require_drivable(grid(true)));
  EXPECT_THROW(require_drivable({}), std::invalid_argument);
  std::vector<Eigen::Vector2d> long_way;
  for (int i = 0; i < 13; ++i) long_way.emplace_back(i % 2 == 0 ? 0.0 : 9e4, i);
  EXPECT_NO_THROW(require_drivable(route_through({long_way.begin(), long_way.end() - 1})));
  EXPECT_THROW(require_drivable(route_through({long_way.begin(), long_way.end()})), std::invalid_argument);
  EXPECT_THROW(require_drivable(route_through({{1, 1}})), std::invalid_argument);
  EXPECT_THROW(require_drivable(route_through({{1, 1}, {1, 1}})), std::invalid_argument);
  EXPECT_THROW(RouteFollower(route_through({{1, 1}, {kNaN, 1}})), std::invalid_argument);
  EXPECT_THROW(RouteFollower(route_through({{1, 1}, {1e11, 1}})), std::invalid_argument);
  EXPECT_THROW(RouteFollower(route_through({{1, 1}, {2, 1}}, 0.0)), std::invalid_argument);
  EXPECT_THROW(RouteFollower(route_through({{1, 1}, {2, 1}}, kNaN)), std::invalid_argument);
  Route route = grid(false);
  route.waypoints[2].stop_s = -1.0;
  try {
    require_drivable(route);
    ADD_FAILURE();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("waypoint 2: the stop"), std::string::npos) << error.what();
  }
}

TEST(RouteFollower, PathIsEvenAndTouchesCornersByTheRadius) {
  const RouteFollower follower(grid(false));
  const auto& path = follower.path();
  EXPECT_EQ(path.front().position, Eigen::Vector2d(0.0, 0.0));
  EXPECT_NEAR((path.back().position - Eigen::Vector2d(0.0, 160.0)).norm(), 0.0, 1e-9);
  double nearest_to_corner = 1e9;
  for (std::size_t i = 0; i < path.size(); ++i) {
    nearest_to_corner = std::min(nearest_to_corner, (path[i].position - Eigen::Vector2d(80.0, 0.0)).norm());
    if (i == 0) continue;
    EXPECT_NEAR((path[i].position - path[i - 1].position).norm(), 0.5, 0.01);
  }
  // An arc of radius 6 m in a right angle passes at (sqrt 2 - 1) 6 m.
  EXPECT_NEAR(nearest_to_corner, 6.0 * (std::sqrt(2.0) - 1.0), 0.02);
  // Each of six corners is 2 * 6 - 6 pi / 2 m shorter.
  EXPECT_NEAR(follower.length_m(), 800.0 - 6.0 * (12.0 - 3.0 * kPi), 0.1);
}

TEST(RouteFollower, SpeedProfileKeepsItsLimits) {
  RouteFollowerParameters parameters;
  const RouteFollower follower(grid(true), parameters);
  const auto& path = follower.path();
  const double spacing = follower.length_m() / static_cast<double>(path.size() - 1);
  double slowest = 1e9;
  for (std::size_t i = 0; i + 1 < path.size(); ++i) {
    const double gain = path[i + 1].speed_mps * path[i + 1].speed_mps - path[i].speed_mps * path[i].speed_mps;
    EXPECT_LE(gain, 2.0 * parameters.acceleration * spacing + 1e-9);
    EXPECT_GE(gain, -2.0 * parameters.deceleration * spacing - 1e-9);
    EXPECT_LE(path[i].speed_mps, 10.0);
    slowest = std::min(slowest, path[i].speed_mps);
  }
  EXPECT_NEAR(slowest, std::sqrt(2.0 * 6.0), 0.1);  // lateral 2 m/s^2 at 6 m
}

TEST(RouteFollower, StaysOnAGridOfRightAnglesAt10MetresPerSecond) {
  for (const Drive kind : {Drive::kBicycle, Drive::kDifferential}) {
    VehicleParameters parameters;
    parameters.drive = kind;
    RouteFollower follower(grid(false));
    const Driven result = drive(grid(false), follower, 300.0, 1, parameters);
    EXPECT_TRUE(follower.finished());
    EXPECT_EQ(follower.progress(), 1.0);
    EXPECT_LT(result.from_path_m, 0.5);
    EXPECT_LT(result.from_route_m, 2.5);
    EXPECT_GT(result.top_speed_mps, 9.9);
    EXPECT_LT(result.top_lateral_mps2, 2.5);
    EXPECT_NEAR((result.end.position() - Eigen::Vector2d(0.0, 160.0)).norm(), 0.0, 0.5);
    const Twist2 after = follower.command(result.end, 1000.0);
    EXPECT_EQ(after.speed_mps, 0.0);
    EXPECT_EQ(after.yaw_rate_radps, 0.0);
  }
}

TEST(RouteFollower, LoopGoesRoundAndRoundAndRoundsItsFirstCornerToo) {
  RouteFollower follower(grid(true));
  const Driven result = drive(grid(true), follower, 600.0, 2);
  EXPECT_EQ(follower.laps(), 2);
  EXPECT_FALSE(follower.finished());
  EXPECT_LT(follower.progress(), 0.05);
  EXPECT_LT(result.from_path_m, 0.5);
  EXPECT_LT(result.from_route_m, 2.5);
}

TEST(RouteFollower, PathThatCrossesItselfIsDrivenInOrder) {
  const Route eight = route_through({{0, 0}, {60, 60}, {60, 0}, {0, 60}}, 8.0, true);
  RouteFollower follower(eight);
  double last = 0.0;
  Vehicle vehicle({}, eight.start(), 1);
  for (int i = 0; i < 15000 && follower.laps() == 0; ++i) {
    vehicle.step(follower.command(vehicle.pose(), kStep_s * i), kStep_s);
    if (follower.laps() > 0) break;
    ASSERT_GE(follower.progress(), last);
    ASSERT_LT(follower.progress() - last, 0.01);
    last = follower.progress();
  }
  EXPECT_EQ(follower.laps(), 1);
}

TEST(RouteFollower, ParksWhereToldForAsLongAsTold) {
  Route route = route_through({{0, 0}, {30, 0}, {60, 0}});
  route.waypoints[0].stop_s = 3.0;
  route.waypoints[1].stop_s = 7.0;
  RouteFollower follower(route);
  Vehicle vehicle({}, route.start(), 1);
  double parked_at_start_s = 0.0;
  double parked_in_the_middle_s = 0.0;
  for (int i = 0; i < 5000 && !follower.finished(); ++i) {
    vehicle.step(follower.command(vehicle.pose(), kStep_s * i), kStep_s);
    if (!follower.is_parked()) continue;
    if (vehicle.pose().x < 1.0) {
      parked_at_start_s += kStep_s;
    } else {
      parked_in_the_middle_s += kStep_s;
      EXPECT_NEAR(vehicle.pose().x, 30.0, 0.4);
    }
  }
  EXPECT_TRUE(follower.finished());
  EXPECT_NEAR(parked_at_start_s, 3.0, 0.03);
  EXPECT_NEAR(parked_in_the_middle_s, 7.0, 0.03);
}

TEST(RouteFollower, LoopParksOnEveryLap) {
  Route route = route_through({{0, 0}, {40, 0}, {40, 40}, {0, 40}}, 8.0, true);
  route.waypoints[2].stop_s = 5.0;
  RouteFollower follower(route);
  // Less the braking from about 0.8 m/s at 4 m/s^2, each time.
  EXPECT_NEAR(drive(route, follower, 200.0, 3).parked_s, 3 * (5.0 - 0.2), 0.15);
  EXPECT_EQ(follower.laps(), 3);
}

TEST(RouteFollower, EveryParameterHasAnEffect) {
  const auto lap_time = [](const RouteFollowerParameters& parameters) {
    RouteFollower follower(grid(false), parameters);
    return drive(grid(false), follower, 400.0).time_s;
  };
  const double base = lap_time({});
  RouteFollowerParameters parameters;
  parameters.max_lateral_acceleration = 0.5;
  EXPECT_GT(lap_time(parameters), base + 5.0);
  parameters = {};
  parameters.corner_radius = 15.0;
  EXPECT_LT(lap_time(parameters), base - 5.0);
  parameters = {};
  parameters.acceleration = 0.5;
  EXPECT_GT(lap_time(parameters), base + 5.0);
  parameters = {};
  parameters.deceleration = 0.5;
  EXPECT_GT(lap_time(parameters), base + 5.0);
  parameters = {};
  parameters.crawl_speed = 5.0;
  EXPECT_LT(lap_time(parameters), base - 1.0);
  const auto turn_towards_path = [](const RouteFollowerParameters& p) {
    RouteFollower follower(grid(false), p);
    return follower.command({0.0, 1.0, 0.0}, 0.0).yaw_rate_radps;
  };
  parameters = {};
  parameters.min_lookahead = 6.0;
  EXPECT_GT(turn_towards_path(parameters), turn_towards_path({}));  // both to the right
  parameters = {};
  parameters.lookahead_time = 20.0;
  EXPECT_GT(turn_towards_path(parameters), turn_towards_path({}));
}

TEST(ResampleTrack, ConstantDriveGivesItsSpeedAndLine) {
  std::vector<double> stamps;
  std::vector<Eigen::Vector2d> positions;
  for (int i = 0; i <= 500; ++i) {
    stamps.push_back(1000.0 + 0.2 * i);
    positions.emplace_back(5.0 + 1.2 * i, 2.0);  // 6 m/s
  }
  const Route route = resample_track(stamps, positions);
  EXPECT_NEAR(route.length_m(), 600.0, 2.5);
  for (const RouteWaypoint& waypoint : route.waypoints) {
    EXPECT_NEAR(waypoint.speed_mps, 6.0, 1e-6);
    EXPECT_EQ(waypoint.stop_s, 0.0);
    EXPECT_NEAR(waypoint.position.y(), 2.0, 1e-9);
  }
}

TEST(ResampleTrack, StandBecomesOneStopWithoutJitter) {
  RandomEngine engine = make_engine(3);
  std::vector<double> stamps;
  std::vector<Eigen::Vector2d> positions;
  double x = 0.0;
  for (int i = 0; i <= 700; ++i) {
    const bool stands = i >= 200 && i < 350;  // 30 s
    if (!stands) x += 1.0;                    // 5 m/s
    stamps.push_back(0.2 * i);
    positions.emplace_back(x + 0.01 * draw_normal(engine), 0.01 * draw_normal(engine));
  }
  const Route route = resample_track(stamps, positions);
  int stops = 0;
  for (const RouteWaypoint& waypoint : route.waypoints) {
    if (waypoint.stop_s == 0.0) continue;
    ++stops;
    EXPECT_NEAR(waypoint.stop_s, 30.0, 1.0);
    EXPECT_NEAR(waypoint.position.x(), 200.0, 2.5);
  }
  EXPECT_EQ(stops, 1);
  for (std::size_t i = 1; i < route.waypoints.size(); ++i) {
    EXPECT_GT(route.waypoints[i].position.x(), route.waypoints[i - 1].position.x() + 1.9);
  }
}

TEST(ResampleTrack, UnusableTracksAreRefused) {
  const std::vector<Eigen::Vector2d> line{{0, 0}, {5, 0}, {10, 0}};
  EXPECT_NO_THROW(resample_track({0.0, 1.0, 2.0}, line));
  EXPECT_THROW(resample_track({}, {}), std::invalid_argument);
  EXPECT_THROW(resample_track({0.0, 1.0}, line), std::invalid_argument);
  EXPECT_THROW(resample_track({0.0, 1.0, 1.0}, line), std::invalid_argument);
  EXPECT_THROW(resample_track({0.0, 1.0, kNaN}, line), std::invalid_argument);
  EXPECT_THROW(resample_track({0.0, 1.0, 2.0}, {{0, 0}, {kNaN, 0}, {10, 0}}), std::invalid_argument);
  EXPECT_THROW(resample_track({0.0, 1.0, 2.0}, {{0, 0}, {0, 0}, {0, 0}}), std::invalid_argument);
}

class TrackFile : public ::testing::Test {
 protected:
  std::string write(const std::string& text) {
    path_ = std::filesystem::temp_directory_path() /
            (std::string("urban_gnss_") + ::testing::UnitTest::GetInstance()->current_test_info()->name() + ".csv");
    std::ofstream(path_) << text;
    return path_.string();
  }
  void TearDown() override { std::filesystem::remove(path_); }
  std::filesystem::path path_;
};

TEST_F(TrackFile, IsReadWithCommentsAndWindowsLineEnds) {
  const Route route = read_track(write("# origin\r\nstamp,x,y,z\r\n0,0,0,1\r\n1,5,0,1\r\n2,10,0,1\r\n"));
  ASSERT_EQ(route.waypoints.size(), 3u);
  EXPECT_EQ(route.waypoints[2].position, Eigen::Vector2d(10.0, 0.0));
  EXPECT_NEAR(route.waypoints[0].speed_mps, 5.0, 1e-12);
}

TEST_F(TrackFile, FaultNamesFileAndLine) {
  const std::string path = write("stamp,x,y,z\n0,0,0,0\n1,five,0,0\n");
  try {
    read_track(path);
    ADD_FAILURE();
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(std::string(error.what()).rfind(path + ":3: ", 0), 0u) << error.what();
  }
  EXPECT_THROW(read_track(write("time,x,y\n0,0,0\n1,5,0\n")), std::runtime_error);
  EXPECT_THROW(read_track(write("")), std::runtime_error);
  EXPECT_THROW(read_track(path + ".missing"), std::runtime_error);
}

TEST(ReadTrack, RecordedDriveCanBeDriven) {
  const char* data = std::getenv("URBAN_GNSS_DATA");
  if (data == nullptr) GTEST_SKIP() << "URBAN_GNSS_DATA is not set";
  const std::string path = std::string(data) + "/truth_only/frankfurt_westend_tower.csv";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is missing";
  const Route route = read_track(path);
  RouteFollower follower(route);
  const Driven result = drive(route, follower, 1500.0);
  EXPECT_TRUE(follower.finished());
  EXPECT_LT(result.from_route_m, 0.5);
  EXPECT_GT(result.top_speed_mps, 6.0);
}

}  // namespace
}  // namespace urban_gnss
