#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>

#include "matchers.hpp"
#include "package_directory.hpp"
#include "urban_gnss_localization/control/waypoint_controller.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"

namespace urban_gnss {
namespace {

WaypointControllerParameters square() {
  WaypointControllerParameters parameters;
  parameters.targets = {10.0, 0.0, 10.0, 10.0, 0.0, 10.0, 0.0, 0.0};
  return parameters;
}

TEST(WaypointController, SteersByTheBearingRelativeToTheHeadingEq36) {
  WaypointControllerParameters parameters = square();
  parameters.steering_gain = 0.7;
  parameters.max_steering = 1.5;
  parameters.speed = 3.0;
  WaypointController controller(parameters);
  for (const double yaw : {-1.0, -0.2, 0.0, 0.5, 1.0}) {
    const BicycleInput input = controller.steer({2.0, 3.0, yaw});
    EXPECT_EQ(input.speed_mps, 3.0);
    EXPECT_NEAR(input.steering_rad, 0.7 * (std::atan2(-3.0, 8.0) - yaw), 1e-14);
  }
}

TEST(WaypointController, TurnsTheShorterWayAcrossPi) {
  WaypointControllerParameters parameters;
  parameters.targets = {-10.0, 1.0};
  parameters.steering_gain = 1.0;
  WaypointController controller(parameters);
  const double bearing = std::atan2(1.0, -10.0);  // just below pi
  EXPECT_NEAR(controller.steer({0.0, 0.0, -kPi + 0.1}).steering_rad, bearing - kPi - 0.1, 1e-14);
  EXPECT_LT(controller.steer({0.0, 0.0, -kPi + 0.1}).steering_rad, 0.0);
  EXPECT_GT(controller.steer({0.0, 0.0, kPi - 0.2}).steering_rad, 0.0);
}

TEST(WaypointController, ClampsTheSteering) {
  WaypointControllerParameters parameters = square();
  parameters.max_steering = 0.4;
  WaypointController controller(parameters);
  EXPECT_EQ(controller.steer({0.0, 0.0, 2.0}).steering_rad, -0.4);
  EXPECT_EQ(controller.steer({0.0, 0.0, -2.0}).steering_rad, 0.4);
}

TEST(WaypointController, SwitchesAtItsDistanceAndCountsLaps) {
  WaypointControllerParameters parameters = square();
  parameters.laps = 2;
  parameters.switch_distance = 0.5;
  WaypointController controller(parameters, 1);
  EXPECT_EQ(controller.current_target(), 1u);
  controller.steer({10.0, 10.501, 0.0});
  EXPECT_EQ(controller.current_target(), 1u);
  const Pose2 corners[] = {{10.0, 10.499, 0.0}, {0.0, 10.0, 0.0}, {0.0, 0.0, 0.0}, {10.0, 0.0, 0.0}};
  for (std::size_t k = 0; k < 8; ++k) {
    EXPECT_FALSE(controller.finished());
    EXPECT_EQ(controller.targets_reached(), k);
    const BicycleInput input = controller.steer(corners[k % 4]);
    EXPECT_EQ(input.speed_mps, k < 7 ? parameters.speed : 0.0);
    EXPECT_EQ(controller.current_target(), (k + 2) % 4);
  }
  EXPECT_TRUE(controller.finished());
  EXPECT_EQ(controller.steer({5.0, 5.0, 0.0}).speed_mps, 0.0);

  parameters.laps = 0;
  WaypointController endless(parameters);
  for (int k = 0; k < 400; ++k) endless.steer(corners[(k + 3) % 4]);
  EXPECT_EQ(endless.targets_reached(), 400u);
  EXPECT_FALSE(endless.finished());
}

TEST(WaypointController, WithoutTargetsItStandsStill) {
  WaypointController controller({});
  EXPECT_TRUE(controller.finished());
  const BicycleInput input = controller.steer({1.0, 2.0, 3.0});
  EXPECT_EQ(input.speed_mps, 0.0);
  EXPECT_EQ(input.steering_rad, 0.0);
}

TEST(WaypointController, HalfATargetIsAFault) {
  std::vector<std::string> faults;
  faults = faults_of(square());
  EXPECT_TRUE(faults.empty());
  WaypointControllerParameters parameters;
  parameters.targets = {1.0, 2.0, 3.0};
  faults = faults_of(parameters);
  EXPECT_EQ(faults.size(), 1u);
}

TEST(WaypointController, GeographicTargetsAreThoseOfTheMap) {
  const LocalFrame map({48.1374, 11.5755, 520.0});
  WaypointControllerParameters parameters;
  std::vector<Eigen::Vector2d> expected{{30.0, -20.0}, {0.0, 0.0}, {-150.0, 4000.0}};
  for (const Eigen::Vector2d& point : expected) {
    const GeodeticPosition place = map.to_geodetic({point.x(), point.y(), 0.0});
    parameters.geographic.insert(parameters.geographic.end(), {place.latitude_deg, place.longitude_deg});
  }
  EXPECT_TRUE(faults_of(parameters).empty());
  EXPECT_TRUE(WaypointController(parameters).targets().empty()) << "without a map there are none";
  const WaypointControllerParameters placed = parameters.in_map(map);
  EXPECT_TRUE(placed.geographic.empty());
  const std::vector<Eigen::Vector2d> points = placed.target_points();
  ASSERT_EQ(points.size(), expected.size());
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_LT((points[i] - expected[i]).norm(), 0.01) << i;
  EXPECT_EQ(placed.speed, parameters.speed);
}

TEST(WaypointController, GeographicTargetsAreRefusedWithTheirIndex) {
  const auto fault = [](const std::vector<double>& targets, const std::vector<double>& geographic) {
    WaypointControllerParameters parameters;
    parameters.targets = targets;
    parameters.geographic = geographic;
    const std::vector<std::string> faults = faults_of(parameters);
    return faults.size() == 1 ? faults.front() : std::to_string(faults.size()) + " faults";
  };
  EXPECT_NE(fault({1.0, 2.0}, {48.1, 11.5}).find("all as targets or all as geographic"), std::string::npos);
  EXPECT_NE(fault({}, {48.1}).find("latitude and longitude of each"), std::string::npos);
  EXPECT_NE(fault({}, {48.1, 11.5, 91.0, 11.5}).find("target 1: latitude = 91"), std::string::npos);
  EXPECT_NE(fault({}, {48.1, 190.0}).find("target 0: longitude = 190"), std::string::npos);
}

TEST(WaypointController, EveryParameterHasAnEffect) {
  // What the robot does, closed loop without noise, from beside the first target.
  const auto trace = [](const std::string& change) {
    const std::string drive = change.find("geographic") != std::string::npos
                                  ? "{laps: 2}"
                                  : "{targets: [10.0, 0.0, 10.0, 10.0, 0.0, 10.0, 0.0, 0.0], laps: 2}";
    const LocalFrame map({48.1374, 11.5755, 520.0});
    WaypointControllerParameters p = with(with(WaypointControllerParameters{}, drive), change);
    if (!p.geographic.empty()) p = p.in_map(map);
    WaypointController controller(p);
    Pose2 pose;
    std::ostringstream out;
    for (int k = 0; k < 12000; ++k) {
      const BicycleInput input = controller.steer(pose);
      out << input.speed_mps << ' ' << input.steering_rad << ' ' << controller.current_target() << '\n';
      pose = move(pose, {input.speed_mps, yaw_rate(input, p.wheelbase)}, 0.01);
    }
    return out.str();
  };
  const std::map<std::string, std::string> changes = {
      {"speed", "2.0"},           {"steering_gain", "0.3"},
      {"max_steering", "0.2"},    {"wheelbase", "3.0"},
      {"switch_distance", "4.0"}, {"laps", "1"},
      {"targets", "[9.0, 0.0]"},  {"geographic", "[[48.1375, 11.5755]]"},
  };
  for (const std::string& name : parameter_names(WaypointControllerParameters{})) {
    ASSERT_EQ(changes.count(name), 1u) << name << " is not examined";
    EXPECT_TRUE(trace(name + ": " + changes.at(name)) != trace("{}")) << name;
  }
}

TEST(WaypointController, ATargetThatNoRobotReachesIsRefused) {
  WaypointControllerParameters parameters;
  parameters.geographic = {48.14, 11.58, 11.58, 48.14};  // the second is swapped
  try {
    parameters.in_map(LocalFrame({48.1374, 11.5755, 520.0}));
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("target 1 is "), std::string::npos) << error.what();
  }
}

// The paper's loop without any noise: 10 m/s, 100 Hz, eight targets on a ring of 15 m.
TEST(WaypointController, ClosedLoopPassesTheEightTargets) {
  const YAML::Node yaml = YAML::LoadFile(package_directory() + "/config/paper_field/waypoint_controller.yaml");
  WaypointControllerParameters parameters;
  EXPECT_TRUE(ParameterReader(yaml).read(parameters).finish().empty());
  parameters.laps = 3;
  WaypointController controller(parameters, 1);
  const auto& targets = controller.targets();
  ASSERT_EQ(targets.size(), 8u);
  const Eigen::Vector2d way = targets[1] - targets[0];
  Pose2 robot{targets[0].x(), targets[0].y(), std::atan2(way.y(), way.x())};
  std::vector<double> nearest(8, 1e9);
  double seconds = 0.0;
  for (; !controller.finished() && seconds < 60.0; seconds += 0.01) {
    const BicycleInput input = controller.steer(robot);
    robot = move(robot, {input.speed_mps, yaw_rate(input, parameters.wheelbase)}, 0.01);
    for (std::size_t i = 0; i < 8; ++i) nearest[i] = std::min(nearest[i], (robot.position() - targets[i]).norm());
  }
  EXPECT_TRUE(controller.finished());
  EXPECT_EQ(controller.targets_reached(), 24u);
  for (const double distance : nearest) EXPECT_LE(distance, 0.5);
  EXPECT_NEAR(seconds, 3.0 * 16.0 * 15.0 * std::sin(kPi / 8.0) / 10.0, 1.0);  // the sides of the octagon
}

}  // namespace
}  // namespace urban_gnss
