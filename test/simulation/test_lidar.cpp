#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "lidar_rig.hpp"

namespace urban_gnss {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(Lidar, GroundIsWhereItsPlaneIs) {
  const LidarScan scan = scan_of(exact(), {});
  // Five beams from -0.26 to 0.26 rad: the lower two meet the ground, at 2 m / sin.
  ASSERT_EQ(scan.size(), 2u * 360u);
  EXPECT_EQ(count(scan, Surface::kGround), scan.size());
  for (std::size_t i = 0; i < scan.size(); ++i) {
    ASSERT_NEAR(scan.z[i], -2.0, 1e-5);
    ASSERT_LT(scan.ring[i], 2);
    const double elevation = scan.ring[i] == 0 ? 0.26 : 0.13;
    ASSERT_NEAR(point(scan, i).norm(), 2.0 / std::sin(elevation), 1e-5);
  }
}

TEST(Lidar, WallIsWhereItIsFromEveryPose) {
  World world;
  world.buildings = {block(20.0, -1000.0, 30.0, 1000.0, 1000.0)};
  for (const Pose2& pose : {Pose2{0.0, 0.0, 0.0}, Pose2{5.0, 3.0, 1.0}, Pose2{-10.0, 7.0, -2.5}}) {
    LidarParameters parameters = exact();
    parameters.vertical_fov_low = 0.0;
    const LidarScan scan = scan_of(parameters, world, pose);
    ASSERT_GT(scan.size(), 100u);
    for (std::size_t i = 0; i < scan.size(); ++i) ASSERT_NEAR(in_map(scan, i, pose).x(), 20.0, 1e-4);
    // Every ray that reaches the plane within 80 m, by counting.
    std::size_t expected = 0;
    for (int column = 0; column < 360; ++column) {
      for (int beam = 0; beam < 5; ++beam) {
        const double along = std::cos(0.065 * beam) * std::cos(2.0 * kPi * column / 360 + pose.yaw);
        expected += along > 0.0 && (20.0 - pose.x) / along <= 80.0;
      }
    }
    EXPECT_EQ(scan.size(), expected);
  }
}

TEST(Lidar, MountingMovesTheSensor) {
  World world;
  world.buildings = {block(20.0, -50.0, 30.0, 50.0, 50.0)};
  LidarParameters parameters = exact();
  parameters.mount_x = 3.0;
  parameters.mount_y = 1.0;
  parameters.beams = 1;
  parameters.vertical_fov_low = parameters.vertical_fov_high = 0.0;
  const LidarScan scan = scan_of(parameters, world, {2.0, 0.0, 0.0});
  ASSERT_FALSE(scan.empty());
  EXPECT_NEAR(scan.x[0], 15.0, 1e-5);
  const LidarScan turned = scan_of(parameters, world, {2.0, 0.0, 0.5 * kPi});  // now 1 m nearer to -x, facing +y
  for (std::size_t i = 0; i < turned.size(); ++i) ASSERT_NEAR(turned.y[i], -19.0, 1e-4);
}

TEST(Lidar, RangesOutsideItsLimitsGiveNothing) {
  LidarParameters parameters = exact();
  parameters.range_max = 10.0;  // the lower beam's ground is at 7.8 m, the next one's at 15.4 m
  EXPECT_EQ(scan_of(parameters, {}).size(), 360u);
  parameters.range_min = 8.0;
  EXPECT_EQ(scan_of(parameters, {}).size(), 0u);
}

TEST(Lidar, CarIsWhereItDrives) {
  CarParameters car;
  car.loop = {{0.0, -100.0}, {100.0, -100.0}, {100.0, 100.0}, {0.0, 100.0}};
  car.speed_mps = 10.0;
  car.phase_m = 100.0;
  car.height_m = 3.0;
  const Box box = Car(car).at(10.0);
  EXPECT_NEAR(box.pose.x, 100.0, 1e-9);
  EXPECT_NEAR(box.pose.y, 0.0, 1e-9);
  EXPECT_NEAR(box.pose.yaw, 0.5 * kPi, 1e-12);

  LidarParameters parameters = exact();
  parameters.vertical_fov_low = 0.0;
  parameters.vertical_fov_high = 0.02;
  const World world;
  const WallIndex index(world);
  Lidar lidar(parameters, world, index, 1);
  LidarScan scan;
  lidar.scan({80.0, 0.0, 0.0}, 10.0, {Car(car)}, scan);
  ASSERT_FALSE(scan.empty());
  EXPECT_EQ(count(scan, Surface::kCar), scan.size());
  for (std::size_t i = 0; i < scan.size(); ++i) {
    ASSERT_NEAR(scan.x[i], 20.0 - 0.9, 1e-4);     // the near side
    ASSERT_LE(std::abs(scan.y[i]), 2.25 + 1e-4);  // 4.5 m long
  }
  lidar.scan({80.0, 0.0, 0.0}, 0.0, {Car(car)}, scan);  // then it is at the corner, out of reach
  EXPECT_TRUE(scan.empty());
}

TEST(Lidar, NearerThingsHideFartherOnes) {
  World world;
  world.buildings = {block(20.0, -200.0, 30.0, 200.0, 50.0)};
  CarParameters car;
  car.loop = {{10.0, -100.0}, {10.0, 100.0}};
  car.speed_mps = 0.0;
  car.phase_m = 100.0;
  car.height_m = 50.0;
  LidarParameters parameters = exact();
  parameters.vertical_fov_low = parameters.vertical_fov_high = 0.0;
  parameters.beams = 1;
  const LidarScan scan = scan_of(parameters, world, {}, {Car(car)});
  EXPECT_GT(count(scan, Surface::kCar), 10u);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    // The car's near side spans atan(2.25 / 9.1) to either side.
    const bool behind_car = std::abs(scan.y[i] / scan.x[i]) < 2.25 / 9.1;
    ASSERT_EQ(scan.intensity[i], intensity(behind_car ? Surface::kCar : Surface::kBuilding));
  }
  car.loop = {{40.0, -100.0}, {40.0, 100.0}};
  EXPECT_EQ(count(scan_of(parameters, world, {}, {Car(car)}), Surface::kCar), 0u);
}

TEST(Lidar, OwnBodyIsSeenAtItsSurfaceAndHidesTheGround) {
  LidarParameters parameters = exact();
  parameters.mount_x = 1.0;
  parameters.vertical_fov_low = -1.5;
  parameters.vertical_fov_high = -0.1;
  parameters.beams = 40;
  parameters.body_width = 1.7;
  parameters.range_min = 0.1;
  const LidarScan scan = scan_of(parameters, {}, {7.0, 8.0, 2.0});
  EXPECT_GT(count(scan, Surface::kBody), 1000u);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    if (scan.intensity[i] == intensity(Surface::kBody)) {
      ASSERT_NEAR(scan.z[i], parameters.body_top - 2.0, 1e-5);
      ASSERT_LE(std::abs(scan.y[i]), 0.85 + 1e-5);
      ASSERT_LE(std::abs(scan.x[i] - 0.2), 2.0 + 1e-5);  // from -0.8 - 1 to 3.2 - 1
    } else {
      // The shadow of the top face on the ground is larger by 2 / (2 - 1.5).
      ASSERT_TRUE(std::abs(scan.y[i]) > 4.0 * 0.85 - 1e-4 || std::abs(scan.x[i] - 0.8) > 4.0 * 2.0 - 1e-4);
    }
  }
}

TEST(Lidar, TrunkIsACylinder) {
  World world;
  world.trees = {{{10.0, 0.0}, 0.5, 3.0, 4.0, 9.0, 1.5}};
  LidarParameters parameters = exact();
  parameters.vertical_fov_low = parameters.vertical_fov_high = 0.0;
  parameters.points_per_revolution = 3600;
  const LidarScan scan = scan_of(parameters, world, {0.0, 0.0, 3.0});
  ASSERT_EQ(count(scan, Surface::kTrunk), scan.size());
  EXPECT_NEAR(scan.size() / 5.0, 3600.0 * 2.0 * std::asin(0.05) / (2.0 * kPi), 1.0);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    ASSERT_NEAR((in_map(scan, i, {0.0, 0.0, 3.0}).head<2>() - Eigen::Vector2d(10.0, 0.0)).norm(), 0.5, 1e-4);
  }
}

TEST(Lidar, CrownReturnsTheShareOfAMetre) {
  World world;
  world.trees = {{{0.0, 0.0}, 0.1, 3.0, 1.0, 9.0, 1.5}};  // the sensor is inside the crown, beside the axis
  LidarParameters parameters = exact();
  parameters.vertical_fov_low = parameters.vertical_fov_high = 0.0;
  parameters.range_min = 0.0;
  parameters.points_per_revolution = 40000;
  parameters.beams = 1;
  for (const double share : {0.0, 0.1, 0.3, 0.9, 1.0}) {
    parameters.crown_return_share = share;
    const LidarScan scan = scan_of(parameters, world);
    const double n = 40000.0;
    double within_1m = 0.0;
    for (std::size_t i = 0; i < scan.size(); ++i) within_1m += point(scan, i).norm() < 1.0;
    const double after_3m = 1.0 - std::pow(1.0 - share, 3.0);
    EXPECT_NEAR(within_1m / n, share, 5.0 * std::sqrt(share * (1.0 - share) / n) + 1e-12);
    EXPECT_NEAR(static_cast<double>(scan.size()) / n, after_3m,
                5.0 * std::sqrt(after_3m * (1.0 - after_3m) / n) + 1e-12);
    EXPECT_EQ(count(scan, Surface::kCrown), scan.size());
  }
}

TEST(Lidar, DropoutAndNoiseAreAsSaid) {
  World world;
  world.buildings = {block(20.0, -1000.0, 30.0, 1000.0, 1000.0)};
  LidarParameters parameters = exact();
  parameters.vertical_fov_low = 0.0;
  parameters.points_per_revolution = 20000;
  parameters.beams = 2;
  const auto all = static_cast<double>(scan_of(parameters, world).size());
  parameters.dropout = 0.2;
  parameters.range_sigma = 0.05;
  const LidarScan scan = scan_of(parameters, world);
  const auto kept = static_cast<double>(scan.size());
  EXPECT_NEAR(kept / all, 0.8, 5.0 * std::sqrt(0.16 / all));
  double sum = 0.0;
  double squares = 0.0;
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const double range = point(scan, i).norm();
    const double error = range - 20.0 * range / scan.x[i];  // along the ray
    sum += error;
    squares += error * error;
  }
  EXPECT_NEAR(sum / kept, 0.0, 5.0 * 0.05 / std::sqrt(kept));
  EXPECT_NEAR(squares / kept, 0.0025, 0.0025 * 5.0 * std::sqrt(2.0 / kept));
  parameters.dropout = 1.0;
  EXPECT_TRUE(scan_of(parameters, world).empty());
}

TEST(Lidar, SeedDecides) {
  LidarParameters parameters;
  World world;
  world.trees = {{{8.0, 2.0}, 0.2, 3.0, 2.0, 9.0, 1.5}};
  EXPECT_EQ(scan_of(parameters, world, {}, {}, 5).x, scan_of(parameters, world, {}, {}, 5).x);
  EXPECT_NE(scan_of(parameters, world, {}, {}, 5).x, scan_of(parameters, world, {}, {}, 6).x);
}

/// The nearest of all trees and cars, each tested for every ray: what the sectors of azimuth must not change.
TEST(Lidar, SectorsLoseNothing) {
  RandomEngine engine = make_engine(8);
  World world;
  for (int i = 0; i < 60; ++i) {
    world.trees.push_back(
        {{60.0 * draw_normal(engine), 60.0 * draw_normal(engine)}, 0.1 + draw_uniform(engine), 0.0, 20.0, 21.0, 1.0});
  }
  const Pose2 pose{3.0, -4.0, 2.2};
  LidarParameters parameters = exact();
  parameters.vertical_fov_low = 0.0;
  parameters.range_min = 0.0;
  parameters.points_per_revolution = 2000;
  const LidarScan scan = scan_of(parameters, world, pose);
  std::size_t expected = 0;
  double expected_sum = 0.0;
  for (int column = 0; column < 2000; ++column) {
    for (int beam = 0; beam < 5; ++beam) {
      const double azimuth = 2.0 * kPi * column / 2000 + pose.yaw;
      const double elevation = 0.065 * beam;
      const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                                      std::sin(elevation));
      double nearest = kInfinity;
      for (const Tree& tree : world.trees) {
        const auto hit = intersect_cylinder({pose.x, pose.y, 2.0}, direction, tree.position, tree.trunk_radius_m, 0.0,
                                            tree.crown_base_m);
        if (hit && hit->enter_m >= 0.0) nearest = std::min(nearest, hit->enter_m);
      }
      if (nearest > 80.0) continue;
      ++expected;
      expected_sum += nearest;
    }
  }
  double sum = 0.0;
  for (std::size_t i = 0; i < scan.size(); ++i) sum += point(scan, i).norm();
  EXPECT_GT(expected, 100u);
  EXPECT_EQ(scan.size(), expected);
  EXPECT_NEAR(sum, expected_sum, 1e-3);
}

TEST(Lidar, SpinningScansAreOnTimeAndFromThePoseOfThatTime) {
  World world;
  world.buildings = {block(60.0, -100.0, 70.0, 100.0, 100.0)};
  LidarParameters parameters = exact();
  parameters.beams = 1;
  const WallIndex index(world);
  Lidar lidar(parameters, world, index, 1);
  LidarScan scan;
  int scans = 0;
  for (int i = 0; i <= 300; ++i) {  // 0.03 s does not divide 0.1 s
    const double time_s = 100.0 + 0.03 * i;
    const Pose2 truth{5.0 * (time_s - 100.0), 0.0, 0.0};
    if (!lidar.advance(time_s, truth, {}, {}, scan)) continue;
    ++scans;
    ASSERT_NEAR(scan.stamp_s, 100.0 + 0.1 * scans, 1e-6);
    ASSERT_NEAR(scan.x[0], 60.0 - 5.0 * 0.1 * scans, 1e-4);
  }
  EXPECT_EQ(scans, 90);
}

TEST(Lidar, NoneGivesNothing) {
  EXPECT_TRUE(scan_of(exact(LidarType::kNone), hall()).empty());
  const World world = hall();
  const WallIndex index(world);
  Lidar lidar(exact(LidarType::kNone), world, index, 1);
  LidarScan scan;
  EXPECT_FALSE(lidar.advance(0.0, {}, {}, {}, scan));
  EXPECT_FALSE(lidar.advance(10.0, {}, {}, {}, scan));
  EXPECT_EQ(lidar.ray_count(), 0u);
}

TEST(Lidar, DefaultsAre30000RaysAndWithoutFaults) {
  const World world;
  const WallIndex index(world);
  EXPECT_EQ(Lidar({}, world, index, 1).ray_count(), 30000u);
  std::vector<std::string> faults;
  faults = faults_of(LidarParameters{});
  EXPECT_TRUE(faults.empty());
}

TEST(Lidar, FaultsNameTheField) {
  const auto fault = [](void (*change)(LidarParameters&)) {
    LidarParameters parameters;
    change(parameters);
    std::vector<std::string> faults;
    faults = faults_of(parameters);
    return faults.size() == 1 ? faults[0].substr(0, faults[0].find(' ')) : "";
  };
  EXPECT_EQ(fault([](LidarParameters& p) { p.range_min = 80.0; }), "range_min");
  EXPECT_EQ(fault([](LidarParameters& p) { p.vertical_fov_low = 0.5; }), "vertical_fov_low");
  EXPECT_EQ(fault([](LidarParameters& p) { p.sweep_time = 0.01, p.line_rate = 10.0; }), "line_rate");
  EXPECT_EQ(fault([](LidarParameters& p) { p.body_rear = 4.0; }), "body_rear");
  EXPECT_EQ(fault([](LidarParameters& p) { p.body_bottom = 1.6; }), "body_bottom");
  EXPECT_EQ(fault([](LidarParameters& p) { p.mount_z = 1.0; }), "mount_z");
}

}  // namespace
}  // namespace urban_gnss
