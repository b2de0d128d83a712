#include <gtest/gtest.h>

#include <cmath>

#include "city_rig.hpp"
#include "matchers.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/simulation/compass.hpp"

namespace urban_gnss {
namespace {

const std::string kExact = "noise: 0.0, offset_sigma: 0.0";

CompassParameters compass(const std::string& yaml) { return with(CompassParameters{}, "{" + kExact + yaml + "}"); }

Wall wall(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  Wall wall;
  wall.from = from;
  wall.to = to;
  const Eigen::Vector2d along = (to - from).normalized();
  wall.normal = {along.y(), -along.x()};
  return wall;
}

TEST(Compass, WithoutErrorsItTellsTheYaw) {
  Compass exact(compass(""), 1);
  for (const double yaw : {0.0, 1.0, -3.0, 3.1}) EXPECT_NEAR(exact.measure(yaw, {0.0, 0.0}, 0.1), yaw, 1e-12);
}

TEST(Compass, FieldTurnsTheNeedle) {
  // A field of the same strength to the west: north seems to be north-west, so a robot that looks north seems to look
  // north-east.
  Compass exact(compass(""), 1);
  EXPECT_NEAR(exact.measure(kPi / 2.0, {-1.0, 0.0}, 0.1), kPi / 4.0, 1e-12);
}

TEST(Compass, SteelFadesWithTheDistanceAndStaysInItsPlace) {
  const std::vector<Wall> walls{wall({-50.0, 0.0}, {50.0, 0.0})};
  const CompassParameters p = compass(", steel_field: 0.4, steel_reach: 2.0");
  EXPECT_NEAR(steel_field(p, {0.0, -2.0}, walls, {}).norm(), 0.4 * std::exp(-1.0), 1e-12);
  EXPECT_NEAR(steel_field(p, {30.0, -4.0}, walls, {}).norm(), 0.4 * std::exp(-2.0), 1e-12);
  EXPECT_EQ(steel_field(p, {0.0, -20.0}, walls, {}), Eigen::Vector2d(0.0, 0.0));
  EXPECT_EQ(steel_field(p, {0.0, -2.0}, walls, {}), steel_field(p, {0.0, -2.0}, walls, {}));
  EXPECT_EQ(steel_field(compass(", steel_field: 0.0"), {0.0, -2.0}, walls, {}), Eigen::Vector2d(0.0, 0.0));
  Box car;
  car.pose = {0.0, -10.0, 0.0};
  car.width_m = 2.0;
  EXPECT_GT(steel_field(p, {0.0, -12.0}, walls, {car}).norm(), steel_field(p, {0.0, -12.0}, walls, {}).norm());
}

TEST(Compass, OffsetAndWanderAreWhatTheParametersSay) {
  Compass turned(compass(", offset: 1.5"), 1);
  EXPECT_NEAR(turned.measure(0.2, {0.0, 0.0}, 0.1), 1.7, 1e-12);
  Compass wandering(compass(", wander_sigma: 0.3, wander_time: 5.0"), 2);
  double squares = 0.0;
  constexpr int kCount = 20000;
  for (int k = 0; k < kCount; ++k) squares += std::pow(wandering.measure(0.0, {0.0, 0.0}, 1.0), 2);
  EXPECT_NEAR(std::sqrt(squares / kCount), 0.3, 0.03);  // some 2000 independent values
}

TEST(Compass, ImuHasAnOrientationUnlessItIsSwitchedOff) {
  for (const bool enabled : {true, false}) {
    const auto city =
        scenario("building_pass", {"duration=5", std::string("compass.enabled=") + (enabled ? "true" : "false")});
    int oriented = 0;
    int messages = 0;
    for (const SimulationEvent& event : run(city)) {
      if (const auto* imu = std::get_if<ImuMessage>(&event.content)) {
        ++messages;
        oriented += imu->yaw_rad.has_value();
      }
    }
    EXPECT_GT(messages, 100);
    EXPECT_EQ(oriented, enabled ? messages : 0);
  }
}

TEST(Compass, NoOtherSensorNoticesIt) {
  const auto fixes_of = [](const char* enabled) {
    std::vector<Eigen::Vector3d> places;
    for (const auto& [stamp, fix] : own_fixes(run(scenario("building_pass", {"duration=5", enabled})))) {
      places.push_back(fix.fix.position);
    }
    return places;
  };
  const auto with_compass = fixes_of("compass.enabled=true");
  EXPECT_FALSE(with_compass.empty());
  EXPECT_EQ(with_compass, fixes_of("compass.enabled=false"));
}

}  // namespace
}  // namespace urban_gnss
