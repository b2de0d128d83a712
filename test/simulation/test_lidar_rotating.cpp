#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "lidar_rig.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"

namespace urban_gnss {
namespace {

LidarParameters small_sweep(LidarAxis axis) {
  LidarParameters parameters = exact(LidarType::kRotating2d);
  parameters.rotation_axis = axis;
  parameters.sweep_time = 1.0;
  parameters.line_rate = 50.0;
  parameters.rays_per_line = 61;
  return parameters;
}

TEST(Lidar, RotatingScannerCoversTheHemisphereAroundItsAxis) {
  const LidarScan sky = scan_of(small_sweep(LidarAxis::kVertical), hall());
  const LidarScan ahead = scan_of(small_sweep(LidarAxis::kForward), hall());
  ASSERT_GT(sky.size(), 1000u);
  ASSERT_GT(ahead.size(), 1000u);
  int quadrants[2][2] = {};
  for (std::size_t i = 0; i < sky.size(); ++i) {
    ASSERT_GE(sky.z[i], -1e-4);
    ++quadrants[sky.x[i] > 0.0F][sky.y[i] > 0.0F];
  }
  for (const auto& half : quadrants) {
    for (const int quadrant : half) EXPECT_NEAR(quadrant, static_cast<double>(sky.size()) / 4.0, sky.size() * 0.03);
  }
  for (std::size_t i = 0; i < ahead.size(); ++i) ASSERT_GE(ahead.x[i], -1e-4);
  EXPECT_GT(count(ahead, Surface::kGround), 1000u);
}

/// Drives past the walls of the hall while it sweeps; how far the points are from the walls, in the frame of the end.
double sweep_error(double odometry_scale) {
  const World world = hall();
  const WallIndex index(world);
  LidarParameters parameters = small_sweep(LidarAxis::kVertical);
  parameters.mount_x = 0.7;
  Lidar lidar(parameters, world, index, 1);
  const Twist2 twist{4.0, 0.5};
  Pose2 truth{-3.0, -4.0, 0.3};
  Pose2 odometry{100.0, 50.0, -1.0};
  LidarScan scan;
  double worst = 0.0;
  int sweeps = 0;
  for (int i = 0; i <= 200; ++i) {
    if (i > 0) truth = move(truth, twist, 0.01);
    if (i > 0) odometry = move(odometry, {twist.speed_mps * odometry_scale, twist.yaw_rate_radps}, 0.01);
    if (!lidar.advance(0.01 * i, truth, odometry, {}, scan)) continue;
    ++sweeps;
    EXPECT_NEAR(scan.stamp_s, 1.0 * sweeps, 1e-9);
    const Pose2 sensor = compose(truth, {0.7, 0.0, 0.0});
    for (std::size_t j = 0; j < scan.size(); ++j) {
      const Eigen::Vector3d p = in_map(scan, j, sensor);
      const double from_wall = std::abs(std::max(std::abs(p.x()), std::abs(p.y())) - 30.0);
      worst = std::max(worst, from_wall);
    }
  }
  EXPECT_EQ(sweeps, 2);
  return worst;
}

TEST(Lidar, SweepIsAssembledByOdometryWhoseDriftSmearsIt) {
  EXPECT_LT(sweep_error(1.0), 1e-3);
  const double drift = sweep_error(1.1);  // 10 % of up to 4 m
  EXPECT_GT(drift, 0.2);
  EXPECT_LT(drift, 0.6);
}

}  // namespace
}  // namespace urban_gnss
