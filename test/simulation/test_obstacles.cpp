#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "urban_gnss_localization/simulation/obstacles.hpp"

namespace urban_gnss {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(Obstacles, RayIntervalOfABoxAndACylinder) {
  Box box;
  box.pose = {10.0, 0.0, 0.5 * kPi};
  box.length_m = 4.0;
  box.width_m = 2.0;
  box.top_m = 3.0;
  const Eigen::Vector3d along_x(1.0, 0.0, 0.0);
  const auto through = intersect({0.0, 1.9, 1.0}, along_x, box);
  ASSERT_TRUE(through);
  EXPECT_NEAR(through->enter_m, 9.0, 1e-9);
  EXPECT_NEAR(through->exit_m, 11.0, 1e-9);
  EXPECT_FALSE(intersect({0.0, 2.1, 1.0}, along_x, box));
  EXPECT_FALSE(intersect({0.0, 0.0, 3.1}, along_x, box));
  EXPECT_LT(intersect({10.0, 0.0, 1.0}, along_x, box)->enter_m, 0.0);
  const auto down = intersect_cylinder({5.0, 0.0, 20.0}, {0.0, 0.0, -1.0}, {5.5, 0.0}, 1.0, 2.0, 8.0);
  ASSERT_TRUE(down);
  EXPECT_NEAR(down->enter_m, 12.0, 1e-9);
  EXPECT_NEAR(down->exit_m, 18.0, 1e-9);
  EXPECT_FALSE(intersect_cylinder({5.0, 0.0, 20.0}, {0.0, 0.0, -1.0}, {6.5, 0.0}, 1.0, 2.0, 8.0));
}

TEST(Obstacles, CarGoesRoundForEverEitherWay) {
  CarParameters parameters;
  parameters.loop = {{0, 0}, {0, 0}, {30, 0}, {30, 10}, {0, 10}};  // a point twice
  for (const double speed : {7.0, -7.0, 0.0}) {
    parameters.speed_mps = speed;
    const Car car(parameters);
    for (int i = -50; i < 50; ++i) {
      const double t = 0.73 * i;
      const Box box = car.at(t);
      ASSERT_TRUE(is_finite(box.pose));
      ASSERT_TRUE(box.pose.x > -1e-9 && box.pose.x < 30 + 1e-9 && box.pose.y > -1e-9 && box.pose.y < 10 + 1e-9);
      const Eigen::Vector2d moved = car.at(t + 1e-6).pose.position() - box.pose.position();
      ASSERT_NEAR(moved.norm() / 1e-6, std::abs(speed), 1e-4);
    }
    EXPECT_NEAR((car.at(1.0).pose.position() - car.at(1.0 + 80.0 / 7.0).pose.position()).norm(), 0.0, 1e-9);
  }
  EXPECT_EQ(Car(parameters).at(0.0).pose.position(), Eigen::Vector2d(0.0, 0.0));
}

TEST(Obstacles, UnusableCarsAreRefused) {
  CarParameters good;
  good.loop = {{0, 0}, {10, 0}};
  EXPECT_NO_THROW(Car{good});
  CarParameters bad = good;
  bad.loop = {{1, 1}, {1, 1}};
  EXPECT_THROW(Car{bad}, std::invalid_argument);
  bad.loop.clear();
  EXPECT_THROW(Car{bad}, std::invalid_argument);
  bad = good;
  for (const double far_m : {kInfinity, 2e5}) {
    bad.loop[0].x() = far_m;
    EXPECT_THROW(Car{bad}, std::invalid_argument);
  }
  bad = good;
  bad.speed_mps = kInfinity;
  EXPECT_THROW(Car{bad}, std::invalid_argument);
  bad = good;
  bad.width_m = 0.0;
  EXPECT_THROW(Car{bad}, std::invalid_argument);
}

}  // namespace
}  // namespace urban_gnss
