#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "urban_gnss_localization/simulation/vehicle.hpp"

namespace urban_gnss {
namespace {

constexpr double kStep_s = 0.01;

VehicleParameters quiet(Drive drive) {
  VehicleParameters parameters;
  parameters.drive = drive;
  parameters.actuation_alpha1 = parameters.actuation_alpha2 = parameters.actuation_alpha3 = 0.0;
  parameters.actuation_alpha4 = parameters.actuation_alpha5 = parameters.actuation_alpha6 = 0.0;
  return parameters;
}

void drive(Vehicle& vehicle, const Twist2& command, double duration_s) {
  for (int i = 0; i < std::lround(duration_s / kStep_s); ++i) vehicle.step(command, kStep_s);
}

TEST(TwistBetween, InvertsMove) {
  RandomEngine engine = make_engine(1);
  for (int trial = 0; trial < 200; ++trial) {
    const Pose2 from{100.0 * draw_normal(engine), 100.0 * draw_normal(engine), 10.0 * draw_normal(engine)};
    const double duration = 0.01 + draw_uniform(engine);
    // Less than half a turn; also straight on, backwards and on the spot.
    const Twist2 twist{trial % 7 == 0 ? 0.0 : 5.0 * draw_normal(engine),
                       trial % 5 == 0 ? 0.0 : (2.0 * draw_uniform(engine) - 1.0) * 3.1 / duration};
    const Twist2 found = twist_between(from, move(from, twist, duration), duration);
    EXPECT_NEAR(found.speed_mps, twist.speed_mps, 1e-9 / duration);
    EXPECT_NEAR(found.yaw_rate_radps, twist.yaw_rate_radps, 1e-9 / duration);
  }
}

TEST(Vehicle, AcceleratesAndBrakesWithinItsLimits) {
  Vehicle vehicle(quiet(Drive::kBicycle), {}, 1);
  drive(vehicle, {10.0, 0.0}, 4.0);
  EXPECT_NEAR(vehicle.twist().speed_mps, 8.0, 1e-9);  // 2 m/s^2
  EXPECT_NEAR(vehicle.acceleration().x(), 2.0, 1e-9);
  EXPECT_NEAR(vehicle.pose().x, 0.5 * 2.0 * 16.0, 0.05);  // half a step of the final speed
  drive(vehicle, {0.0, 0.0}, 1.5);
  EXPECT_NEAR(vehicle.twist().speed_mps, 2.0, 1e-9);  // 4 m/s^2
  EXPECT_NEAR(vehicle.acceleration().x(), -4.0, 1e-9);
  drive(vehicle, {0.0, 0.0}, 1.0);
  EXPECT_EQ(vehicle.twist().speed_mps, 0.0);
  EXPECT_EQ(vehicle.acceleration().x(), 0.0);
}

TEST(Vehicle, SpeedIsLimitedBothWays) {
  for (const double sign : {1.0, -1.0}) {
    Vehicle vehicle(quiet(Drive::kDifferential), {}, 1);
    drive(vehicle, {sign * 100.0, 0.0}, 11.0);
    EXPECT_NEAR(vehicle.twist().speed_mps, sign * 20.0, 1e-9);
  }
}

TEST(Vehicle, BicycleDrivesTheCommandedCircle) {
  Vehicle vehicle(quiet(Drive::kBicycle), {}, 1);
  const Twist2 command{5.0, 0.5};  // radius 10 m
  drive(vehicle, command, 5.0);
  EXPECT_NEAR(vehicle.twist().yaw_rate_radps, 0.5, 1e-9);
  EXPECT_NEAR(vehicle.steering_rad(), std::atan(2.5 / 10.0), 1e-9);
  EXPECT_NEAR(vehicle.acceleration().y(), 2.5, 1e-9);  // v w
  const Eigen::Vector2d centre = transform_point(vehicle.pose(), {0.0, 10.0});
  drive(vehicle, command, 4.0);
  EXPECT_NEAR((transform_point(vehicle.pose(), {0.0, 10.0}) - centre).norm(), 0.0, 1e-6);
}

TEST(Vehicle, BicycleSteersNoFasterAndNoFartherThanItCan) {
  Vehicle vehicle(quiet(Drive::kBicycle), {}, 1);
  drive(vehicle, {5.0, 50.0}, 0.5);
  EXPECT_NEAR(vehicle.steering_rad(), 0.8 * 0.5, 1e-9);
  drive(vehicle, {5.0, 50.0}, 5.0);
  EXPECT_NEAR(vehicle.steering_rad(), 0.6, 1e-12);
  EXPECT_NEAR(vehicle.twist().yaw_rate_radps, 5.0 / 2.5 * std::tan(0.6), 1e-9);
  drive(vehicle, {0.0, 0.0}, 5.0);
  EXPECT_NEAR(vehicle.steering_rad(), 0.6, 1e-12);
}

TEST(Vehicle, BicycleDoesNotTurnOnTheSpotButDifferentialDoes) {
  Vehicle bicycle(quiet(Drive::kBicycle), {1.0, 2.0, 0.3}, 1);
  Vehicle differential(quiet(Drive::kDifferential), {1.0, 2.0, 0.3}, 1);
  drive(bicycle, {0.0, 1.0}, 1.0);
  drive(differential, {0.0, 1.0}, 1.0);
  EXPECT_EQ(bicycle.pose().yaw, 0.3);
  EXPECT_NEAR(differential.twist().yaw_rate_radps, 1.0, 1e-9);
  EXPECT_GT(differential.pose().yaw, 0.3 + 0.8);  // 1 rad/s reached within 1/3 s
  EXPECT_NEAR(differential.pose().x, 1.0, 1e-12);
  drive(differential, {0.0, 9.0}, 3.0);
  EXPECT_NEAR(differential.twist().yaw_rate_radps, 1.5, 1e-9);
}

TEST(Vehicle, NonFiniteCommandBrakes) {
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    for (const Drive kind : {Drive::kBicycle, Drive::kDifferential}) {
      Vehicle vehicle(quiet(kind), {}, 1);
      drive(vehicle, {4.0, 0.1}, 3.0);
      drive(vehicle, {bad, 0.1}, 0.5);
      drive(vehicle, {4.0, bad}, 3.0);
      EXPECT_EQ(vehicle.twist().speed_mps, 0.0);
      EXPECT_TRUE(is_finite(vehicle.pose()));
    }
  }
}

TEST(Vehicle, TwistMovesItExactlyEvenWithNoise) {
  VehicleParameters parameters;
  parameters.actuation_alpha5 = 1e-4;
  Vehicle vehicle(parameters, {3.0, -2.0, 1.0}, 5);
  Pose2 pose = vehicle.pose();
  for (int i = 0; i < 1000; ++i) {
    vehicle.step({10.0, 0.3 * std::sin(0.01 * i)}, kStep_s);
    pose = move(pose, vehicle.twist(), kStep_s);
  }
  EXPECT_NEAR(pose.x, vehicle.pose().x, 1e-9);
  EXPECT_NEAR(pose.y, vehicle.pose().y, 1e-9);
  EXPECT_NE(vehicle.twist().speed_mps, vehicle.nominal_twist().speed_mps);
}

TEST(Vehicle, ActuationNoiseHasTheVarianceOfTheMotionModel) {
  VehicleParameters parameters = quiet(Drive::kDifferential);
  parameters.actuation_alpha1 = 1e-4;
  parameters.actuation_alpha3 = 4e-6;
  Vehicle vehicle(parameters, {}, 7);
  drive(vehicle, {10.0, 0.0}, 6.0);
  const int n = 20000;
  double speed_squares = 0.0;
  double yaw_rate_squares = 0.0;
  for (int i = 0; i < n; ++i) {
    vehicle.step({10.0, 0.0}, kStep_s);
    speed_squares += std::pow(vehicle.twist().speed_mps - 10.0, 2);
    yaw_rate_squares += std::pow(vehicle.twist().yaw_rate_radps, 2);
  }
  // alpha v^2 for an interval of 1 s, a hundred times as much for 0.01 s. Relative sigma of a variance: sqrt(2/n).
  EXPECT_NEAR(speed_squares / n, 1e-4 * 100.0 * 100.0, 1.0 * 5.0 * std::sqrt(2.0 / n));
  EXPECT_NEAR(yaw_rate_squares / n, 4e-6 * 100.0 * 100.0, 0.04 * 5.0 * std::sqrt(2.0 / n));
}

TEST(Vehicle, SeedDecidesAndAStandingVehicleDoesNotMove) {
  const auto end = [](std::uint64_t seed) {
    Vehicle vehicle({}, {}, seed);
    drive(vehicle, {8.0, 0.1}, 5.0);
    return vehicle.pose();
  };
  EXPECT_EQ(end(1).x, end(1).x);
  EXPECT_NE(end(1).x, end(2).x);
  Vehicle parked({}, {5.0, 6.0, 1.0}, 3);
  drive(parked, {}, 10.0);
  EXPECT_EQ(parked.pose().position(), Eigen::Vector2d(5.0, 6.0));
}

TEST(Vehicle, AntennaVelocityIsTheDerivativeOfItsPosition) {
  Vehicle vehicle(quiet(Drive::kBicycle), {1.0, 2.0, 2.0}, 1);
  drive(vehicle, {6.0, 0.6}, 6.0);
  const double dt = 1e-5;
  const Eigen::Vector3d before = vehicle.antenna_position();
  const Eigen::Vector3d velocity = vehicle.antenna_velocity();
  vehicle.step({6.0, 0.6}, dt);
  EXPECT_NEAR(((vehicle.antenna_position() - before) / dt - velocity).norm(), 0.0, 1e-4);
  EXPECT_NEAR(velocity.norm(), std::hypot(6.0, 0.6 * 1.0), 1e-6);
  EXPECT_EQ(before.z(), 1.8);
}

}  // namespace
}  // namespace urban_gnss
