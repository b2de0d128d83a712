#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/simulation/polygon.hpp"
#include "urban_gnss_localization/simulation/wall_index.hpp"

namespace urban_gnss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

double draw(RandomEngine& engine, double low, double high) { return low + (high - low) * draw_uniform(engine); }

Vector2d unit(double angle_rad) { return {std::cos(angle_rad), std::sin(angle_rad)}; }

Vector3d draw_direction(RandomEngine& engine) {
  return Vector3d(draw_normal(engine), draw_normal(engine), draw_normal(engine)).normalized();
}

Building box(const Vector2d& low, const Vector2d& high, double roof_m, double base_m = 0.0) {
  Building building;
  building.footprint = {low, {high.x(), low.y()}, high, {low.x(), high.y()}};
  building.base_m = base_m;
  building.roof_m = roof_m;
  return building;
}

World single_box() { return {{box({10.0, -5.0}, {20.0, 5.0}, 30.0)}, {}}; }

/// Corners around a centre at drawn distances: convex where the distances are equal, mostly concave else.
Building draw_building(RandomEngine& engine, double half_extent) {
  Building building;
  const Vector2d centre(draw(engine, -half_extent, half_extent), draw(engine, -half_extent, half_extent));
  const int corner_count = 3 + static_cast<int>(draw(engine, 0.0, 8.0));
  const double radius = draw(engine, 2.0, 25.0);
  const double roughness = draw_uniform(engine) < 0.5 ? 0.0 : 0.8;
  const double turn = draw(engine, 0.0, kPi);
  for (int i = 0; i < corner_count; ++i) {
    const double distance = radius * (1.0 - roughness * draw_uniform(engine));
    building.footprint.push_back(centre + distance * unit(turn + 2.0 * kPi * i / corner_count));
  }
  building.base_m = draw_uniform(engine) < 0.25 ? draw(engine, 3.0, 12.0) : 0.0;
  building.roof_m = building.base_m + draw(engine, 1.0, 60.0);
  return building;
}

World draw_world(RandomEngine& engine, int building_count, double half_extent) {
  World world;
  for (int i = 0; i < building_count; ++i) world.buildings.push_back(draw_building(engine, half_extent));
  return world;
}

/// Inside by the winding number, as the sum of the angles between the corners.
bool winds_around(const Polygon& polygon, const Vector2d& point) {
  double sum = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vector2d a = polygon[i] - point;
    const Vector2d b = polygon[(i + 1) % polygon.size()] - point;
    sum += angle_difference(std::atan2(b.y(), b.x()), std::atan2(a.y(), a.x()));
  }
  return std::abs(sum) > kPi;
}

/// The reference: every face of every building as a plane.
double reference_range(const World& world, const Vector3d& origin, const Vector3d& direction) {
  double nearest = kInfinity;
  const auto range_to_plane = [&](const Vector3d& point, const Vector3d& normal) {
    return normal.dot(point - origin) / normal.dot(direction);
  };
  for (const Building& building : world.buildings) {
    const auto& corners = building.footprint;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Vector2d edge = corners[(i + 1) % corners.size()] - corners[i];
      const double range = range_to_plane({corners[i].x(), corners[i].y(), 0.0}, {edge.y(), -edge.x(), 0.0});
      if (!(range > 1e-9) || range >= nearest) continue;
      const Vector3d point = origin + range * direction;
      const double share = (point.head<2>() - corners[i]).dot(edge) / edge.squaredNorm();
      if (share >= 0.0 && share <= 1.0 && point.z() >= building.base_m && point.z() <= building.roof_m) nearest = range;
    }
    const bool is_from_above = direction.z() < 0.0 && origin.z() > building.roof_m;
    const bool is_from_below = direction.z() > 0.0 && building.base_m > 0.0 && origin.z() < building.base_m;
    if (!is_from_above && !is_from_below) continue;
    const double height = is_from_above ? building.roof_m : building.base_m;
    const double range = range_to_plane({0.0, 0.0, height}, Vector3d::UnitZ());
    const Vector3d point = origin + range * direction;
    if (range < nearest && winds_around(corners, point.head<2>())) nearest = range;
  }
  return nearest;
}

double range_or_infinity(const std::optional<WallIndex::Hit>& hit) { return hit ? hit->range_m : kInfinity; }

TEST(WallIndex, BoxIsMetWhereItStands) {
  const WallIndex index(single_box());
  const auto hit = index.cast({0.0, 1.0, 2.0}, Vector3d::UnitX());
  ASSERT_TRUE(hit);
  EXPECT_DOUBLE_EQ(hit->range_m, 10.0);
  EXPECT_EQ(hit->building, 0);
  EXPECT_EQ(index.walls()[hit->wall].normal, Vector2d(-1.0, 0.0));
  EXPECT_FALSE(index.cast({0.0, 1.0, 2.0}, -Vector3d::UnitX()));
  EXPECT_FALSE(index.cast({0.0, 6.0, 2.0}, Vector3d::UnitX()));
  EXPECT_FALSE(index.cast({0.0, 1.0, 31.0}, Vector3d::UnitX()));
  EXPECT_NEAR(index.cast({0.0, 0.0, 0.0}, Vector3d(3.0, 0.0, 4.0) / 5.0)->range_m, 50.0 / 3.0, 1e-12);
  EXPECT_FALSE(index.cast({0.0, 0.0, 0.0}, Vector3d(1.0, 0.0, 3.1).normalized()));
}

TEST(WallIndex, RangeIsAMaximum) {
  const WallIndex index(single_box());
  EXPECT_TRUE(index.cast({0.0, 0.0, 1.0}, Vector3d::UnitX(), 10.0));
  EXPECT_FALSE(index.cast({0.0, 0.0, 1.0}, Vector3d::UnitX(), 9.999999));
  EXPECT_TRUE(index.cast({15.0, 0.0, 40.0}, -Vector3d::UnitZ(), 10.0));
  EXPECT_FALSE(index.cast({15.0, 0.0, 40.0}, -Vector3d::UnitZ(), 9.999999));
  EXPECT_FALSE(index.cast({0.0, 0.0, 1.0}, Vector3d::UnitX(), 0.0));
}

TEST(WallIndex, VerticalRaysMeetRoofsFromAboveAndUndersidesFromBelow) {
  World world = single_box();
  world.buildings.push_back(box({30.0, -5.0}, {40.0, 5.0}, 8.0, 5.0));
  world.buildings.push_back(box({30.0, -5.0}, {40.0, 5.0}, 20.0, 12.0));
  const WallIndex index(world);
  const auto roof = index.cast({15.0, 0.0, 50.0}, -Vector3d::UnitZ());
  ASSERT_TRUE(roof);
  EXPECT_DOUBLE_EQ(roof->range_m, 20.0);
  EXPECT_EQ(roof->wall, WallIndex::kHorizontalFace);
  EXPECT_EQ(roof->building, 0);
  EXPECT_FALSE(index.cast({15.0, 0.0, 29.0}, Vector3d::UnitZ())) << "a roof is not met from inside";
  EXPECT_FALSE(index.cast({25.0, 0.0, 50.0}, -Vector3d::UnitZ()));

  const auto underside = index.cast({35.0, 0.0, 1.0}, Vector3d::UnitZ());
  ASSERT_TRUE(underside);
  EXPECT_DOUBLE_EQ(underside->range_m, 4.0);
  EXPECT_EQ(underside->building, 1);
  EXPECT_EQ(index.cast({35.0, 0.0, 10.0}, Vector3d::UnitZ())->building, 2) << "between two bridges";
  EXPECT_EQ(index.cast({35.0, 0.0, 10.0}, -Vector3d::UnitZ())->building, 1);
  EXPECT_EQ(index.cast({35.0, 0.0, 60.0}, -Vector3d::UnitZ())->building, 2) << "the upper roof hides the lower";
}

TEST(WallIndex, PassesUnderABridge) {
  const WallIndex index({{box({10.0, -50.0}, {20.0, 50.0}, 8.0, 5.0)}, {}});
  EXPECT_FALSE(index.cast({0.0, 0.0, 4.9}, Vector3d::UnitX()));
  EXPECT_TRUE(index.cast({0.0, 0.0, 5.1}, Vector3d::UnitX()));
  EXPECT_FALSE(index.cast({0.0, 0.0, 8.1}, Vector3d::UnitX()));
}

TEST(WallIndex, WorldWithoutBuildingsIsOpen) {
  const WallIndex index(World{});
  EXPECT_FALSE(index.cast(Vector3d::Zero(), Vector3d::UnitX()));
  EXPECT_FALSE(index.is_inside(Vector3d::Zero()));
  std::vector<WallIndex::Crossing> crossings(3);
  index.crossings(Vector2d::Zero(), Vector2d::UnitX(), kInfinity, crossings);
  EXPECT_TRUE(crossings.empty());
}

TEST(WallIndex, WhatIsNotFiniteMeetsNothing) {
  const WallIndex index(single_box());
  for (const double value : {kNaN, kInfinity, -kInfinity}) {
    EXPECT_FALSE(index.cast({value, 0.0, 1.0}, Vector3d::UnitX()));
    EXPECT_FALSE(index.cast({0.0, 0.0, value}, Vector3d::UnitX()));
    EXPECT_FALSE(index.cast({0.0, 0.0, 1.0}, {value, 0.0, 0.0}));
    EXPECT_FALSE(index.is_inside({value, 0.0, 1.0}));
  }
  EXPECT_FALSE(index.cast({0.0, 0.0, 1.0}, Vector3d::UnitX(), kNaN));
  EXPECT_FALSE(index.cast({0.0, 0.0, 1.0}, Vector3d::Zero()));
}

TEST(WallIndex, OrientationOfTheFootprintDoesNotMatter) {
  World world = single_box();
  std::reverse(world.buildings[0].footprint.begin(), world.buildings[0].footprint.end());
  const WallIndex index(world);
  for (const Wall& wall : index.walls()) {
    const Vector2d middle = 0.5 * (wall.from + wall.to);
    EXPECT_FALSE(contains(world.buildings[0].footprint, middle + 0.1 * wall.normal));
    EXPECT_TRUE(contains(world.buildings[0].footprint, middle - 0.1 * wall.normal));
    EXPECT_NEAR(wall.normal.norm(), 1.0, 1e-15);
  }
}

TEST(WallIndex, AgreesWithEveryFaceTriedInTurn) {
  auto engine = make_engine(11);
  int hit_count = 0;
  for (int trial = 0; trial < 40; ++trial) {
    const int building_count = 1 + trial;
    const World world = draw_world(engine, building_count, 20.0 + 4.0 * trial);
    const WallIndex index(world);
    for (int i = 0; i < 2000; ++i) {
      const double reach = 60.0 + 5.0 * trial;
      const Vector3d origin(draw(engine, -reach, reach), draw(engine, -reach, reach), draw(engine, 0.0, 80.0));
      Vector3d direction = draw_direction(engine);
      if (i % 5 == 0) direction.z() = 0.0;
      if (i % 7 == 0) direction[i % 2] = 0.0;
      if (i % 31 == 0) direction = Vector3d::UnitZ() * (i % 2 == 0 ? 1.0 : -1.0);
      direction.normalize();
      const double expected = reference_range(world, origin, direction);
      const auto hit = index.cast(origin, direction);
      ASSERT_EQ(hit.has_value(), std::isfinite(expected)) << "trial " << trial << ", ray " << i;
      if (!hit) continue;
      ++hit_count;
      ASSERT_NEAR(hit->range_m, expected, 1e-9 * (1.0 + expected)) << "trial " << trial << ", ray " << i;
      ASSERT_FALSE(index.cast(origin, direction, 0.999 * expected));
      if (hit->wall != WallIndex::kHorizontalFace) {
        ASSERT_EQ(index.walls()[hit->wall].building, hit->building);
      }
    }
  }
  EXPECT_GT(hit_count, 5000);
}

TEST(WallIndex, CrossingsAreEveryWallOnceNearestFirst) {
  auto engine = make_engine(12);
  std::vector<WallIndex::Crossing> crossings;
  for (int trial = 0; trial < 400; ++trial) {
    const World world = draw_world(engine, 15, 60.0);
    const WallIndex index(world);
    const Vector2d origin(draw(engine, -90.0, 90.0), draw(engine, -90.0, 90.0));
    const Vector2d direction = trial % 9 == 0 ? Vector2d(0.0, -1.0) : unit(draw(engine, -kPi, kPi));
    const double reach = trial % 2 == 0 ? 70.0 : kInfinity;
    std::vector<std::pair<double, int>> expected;
    for (std::size_t i = 0; i < index.walls().size(); ++i) {
      const Wall& wall = index.walls()[i];
      Eigen::Matrix2d system;
      system << direction, wall.from - wall.to;
      const Vector2d solution = system.inverse() * (wall.from - origin);
      const bool is_between = solution.y() >= 0.0 && solution.y() <= 1.0;
      if (is_between && solution.x() > 0.0 && solution.x() <= reach) expected.emplace_back(solution.x(), i);
    }
    std::sort(expected.begin(), expected.end());
    index.crossings(origin, direction, reach, crossings);
    ASSERT_EQ(crossings.size(), expected.size()) << "trial " << trial;
    for (std::size_t i = 0; i < expected.size(); ++i) {
      EXPECT_EQ(crossings[i].wall, expected[i].second);
      EXPECT_NEAR(crossings[i].distance_m, expected[i].first, 1e-9);
    }
  }
}

TEST(WallIndex, NoRaySlipsThroughACorner) {
  auto engine = make_engine(13);
  for (int trial = 0; trial < 300; ++trial) {
    const World world = draw_world(engine, 1, 500.0);
    const WallIndex index(world);
    const Building& building = world.buildings[0];
    for (const Vector2d& corner : building.footprint) {
      const double height = draw(engine, building.base_m, building.roof_m);
      const Vector3d target(corner.x(), corner.y(), height);
      const Vector3d origin = target + draw(engine, 1.0, 300.0) * draw_direction(engine);
      const double distance = (target - origin).norm();
      ASSERT_LE(range_or_infinity(index.cast(origin, (target - origin) / distance)), distance + 1e-6);
    }
  }
}

TEST(WallIndex, RayThatStartsOnAWallDoesNotMeetIt) {
  auto engine = make_engine(14);
  int reflection_count = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const World world = draw_world(engine, 1, 300.0);
    const WallIndex index(world);
    const Wall& wall = index.walls()[trial % index.walls().size()];
    const Vector2d foot = wall.from + draw(engine, 0.05, 0.95) * (wall.to - wall.from);
    const Vector3d point(foot.x(), foot.y(), draw(engine, wall.base_m, wall.roof_m));
    Vector3d direction = draw_direction(engine);
    const Vector3d normal(wall.normal.x(), wall.normal.y(), 0.0);
    if (direction.dot(normal) < 0.0) direction -= 2.0 * direction.dot(normal) * normal;
    for (const double offset : {0.0, 1e-6}) {
      const auto hit = index.cast(point + offset * normal, direction);
      ASSERT_FALSE(hit && hit->range_m < 1e-3) << "trial " << trial << ", offset " << offset;
      ++reflection_count;
    }
    // From the other side of the wall it is met.
    const auto back = index.cast(point - 1e-6 * normal, direction, 1.0);
    ASSERT_TRUE(back || direction.dot(normal) < 1e-3) << "trial " << trial;
  }
  EXPECT_EQ(reflection_count, 6000);
}

TEST(WallIndex, AnotherBuildingCanOnlyShortenARay) {
  auto engine = make_engine(15);
  World world = draw_world(engine, 20, 80.0);
  const WallIndex before(world);
  world.buildings.push_back(draw_building(engine, 10.0));
  const WallIndex after(world);
  for (int i = 0; i < 3000; ++i) {
    const Vector3d origin(draw(engine, -100.0, 100.0), draw(engine, -100.0, 100.0), draw(engine, 0.0, 70.0));
    const Vector3d direction = draw_direction(engine);
    ASSERT_LE(range_or_infinity(after.cast(origin, direction)), range_or_infinity(before.cast(origin, direction)));
  }
}

TEST(WallIndex, WallsSharedByNeighboursHideNothingAndLeakNothing) {
  const WallIndex index(
      {{box({10, 0}, {20, 10}, 20.0), box({10, 10}, {20, 20}, 20.0), box({20, 0}, {30, 20}, 40.0)}, {}});
  for (double y = 0.0; y <= 20.0; y += 0.5) {
    EXPECT_NEAR(range_or_infinity(index.cast({0.0, y, 5.0}, Vector3d::UnitX())), 10.0, 1e-12) << y;
    EXPECT_NEAR(range_or_infinity(index.cast({0.0, y, 30.0}, Vector3d::UnitX())), 20.0, 1e-12) << y;
  }
  for (double y = 0.25; y < 20.0; y += 0.25) {
    EXPECT_NEAR(range_or_infinity(index.cast({15.0, y, 100.0}, -Vector3d::UnitZ())), 80.0, 1e-12) << y;
  }
}

TEST(WallIndex, InsideIsWithinFootprintAndHeights) {
  auto engine = make_engine(16);
  const World world = draw_world(engine, 12, 40.0);
  const WallIndex index(world);
  int inside_count = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vector3d point(draw(engine, -60.0, 60.0), draw(engine, -60.0, 60.0), draw(engine, 0.0, 70.0));
    const bool expected = std::any_of(world.buildings.begin(), world.buildings.end(), [&](const Building& b) {
      return point.z() >= b.base_m && point.z() <= b.roof_m && winds_around(b.footprint, point.head<2>());
    });
    ASSERT_EQ(index.is_inside(point), expected) << point.transpose();
    inside_count += expected ? 1 : 0;
  }
  EXPECT_GT(inside_count, 200);
}

TEST(WallIndex, WorldOfGreatExtentHasABoundedGrid) {
  World world = single_box();
  world.buildings.push_back(box({1e6, 1e6}, {1e6 + 10.0, 1e6 + 10.0}, 30.0));
  const WallIndex index(world);
  EXPECT_DOUBLE_EQ(index.cast({0.0, 0.0, 1.0}, Vector3d::UnitX())->range_m, 10.0);
  const auto far = index.cast({1e6, 0.0, 1.0}, Vector3d::UnitY());
  ASSERT_TRUE(far);
  EXPECT_EQ(far->building, 1);
}

TEST(WallIndex, GridMayBeALine) {
  // Walls on the border of cells and of the grid.
  const WallIndex index({{box({0.0, 0.0}, {80.0, 1.0}, 10.0), box({0.0, 8.0}, {80.0, 8.5}, 10.0)}, {}});
  for (double x = 0.0; x <= 80.0; x += 1.0) {
    EXPECT_NEAR(range_or_infinity(index.cast({x, 4.0, 1.0}, Vector3d::UnitY())), 4.0, 1e-12) << x;
    EXPECT_NEAR(range_or_infinity(index.cast({x, 4.0, 1.0}, -Vector3d::UnitY())), 3.0, 1e-12) << x;
  }
}

}  // namespace
}  // namespace urban_gnss
