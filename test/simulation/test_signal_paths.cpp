#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"
#include "urban_gnss_localization/simulation/signal_paths.hpp"

namespace urban_gnss {
namespace {

double uniform(RandomEngine& engine, double low, double high) { return low + (high - low) * draw_uniform(engine); }

Eigen::Vector3d direction(double azimuth_deg, double elevation_deg) {
  return line_of_sight({degrees_to_radians(azimuth_deg), degrees_to_radians(elevation_deg)});
}

Eigen::Vector3d random_direction(RandomEngine& engine, double lowest_deg = 5.0) {
  return direction(uniform(engine, 0.0, 360.0), uniform(engine, lowest_deg, 88.0));
}

Building box(const Eigen::Vector2d& centre, double length, double width, double yaw, double roof, double base = 0.0) {
  const Eigen::Rotation2Dd turn(yaw);
  Building building;
  for (const auto& [x, y] : {std::pair{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}}) {
    building.footprint.push_back(centre + turn * Eigen::Vector2d(x * length, y * width));
  }
  building.base_m = base;
  building.roof_m = roof;
  return building;
}

World grid_city(RandomEngine& engine, double yaw) {
  World world;
  for (int i = -2; i <= 2; ++i) {
    for (int j = -2; j <= 2; ++j) {
      const Eigen::Vector2d centre = Eigen::Rotation2Dd(yaw) * Eigen::Vector2d(60.0 * i, 55.0 * j);
      world.buildings.push_back(box(centre, 42.0, 38.0, yaw, uniform(engine, 15.0, 60.0)));
    }
  }
  return world;
}

World irregular_city(RandomEngine& engine) {
  World world;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d centre(uniform(engine, -100.0, 100.0), uniform(engine, -100.0, 100.0));
    const double base = i % 5 == 0 ? 6.0 : 0.0;
    world.buildings.push_back(box(centre, uniform(engine, 8.0, 40.0), uniform(engine, 8.0, 40.0),
                                  uniform(engine, 0.0, 3.0), uniform(engine, 10.0, 50.0), base));
  }
  return world;
}

/// A world with all that is needed to trace in it.
struct Scene {
  explicit Scene(World content, const SignalParameters& parameters = {})
      : world(std::move(content)), index(world), tracer(world, index, parameters) {}
  SignalPaths trace(const Eigen::Vector3d& antenna, const Eigen::Vector3d& line_of_sight) {
    SignalPaths paths;
    tracer.trace(antenna, line_of_sight, paths);
    return paths;
  }
  World world;
  WallIndex index;
  SignalTracer tracer;
};

SignalParameters without_limits() {
  SignalParameters parameters;
  parameters.reflection_range = 1e4;
  parameters.max_loss = 1e3;
  parameters.max_reflections = 1;
  return parameters;
}

/// By the definition, every face of every building tried: whether the way from `from` along `direction` is free up to
/// `range_m`.
bool is_free(const World& world, const Eigen::Vector3d& from, const Eigen::Vector3d& direction, double range_m) {
  for (const Building& building : world.buildings) {
    const std::size_t corners = building.footprint.size();
    for (std::size_t i = 0; i < corners; ++i) {
      const Eigen::Vector2d a = building.footprint[i];
      const Eigen::Vector2d along = building.footprint[(i + 1) % corners] - a;
      Eigen::Matrix2d system;
      system << direction.head<2>(), -along;
      if (std::abs(system.determinant()) < 1e-12) continue;
      const Eigen::Vector2d solution = system.inverse() * (a - from.head<2>());
      const double z = from.z() + solution.x() * direction.z();
      if (solution.x() > 1e-7 && solution.x() < range_m - 1e-7 && solution.y() >= 0.0 && solution.y() <= 1.0 &&
          z >= building.base_m && z <= building.roof_m) {
        return false;
      }
    }
    const double to_base = (building.base_m - from.z()) / direction.z();
    if (building.base_m > 0.0 && to_base > 1e-7 && to_base < range_m) {
      const Eigen::Vector2d place = (from + to_base * direction).head<2>();
      bool is_inside = true;  // of a convex, counter-clockwise footprint
      for (std::size_t i = 0; i < corners; ++i) {
        const Eigen::Vector2d a = building.footprint[i];
        const Eigen::Vector2d along = building.footprint[(i + 1) % corners] - a;
        is_inside = is_inside && along.x() * (place - a).y() - along.y() * (place - a).x() > 0.0;
      }
      if (is_inside) return false;
    }
  }
  return true;
}

/// The image method, wall by wall: the excess of every single reflection.
std::vector<double> single_reflections(const World& world, const Eigen::Vector3d& antenna, const Eigen::Vector3d& u) {
  std::vector<double> excesses;
  for (const Building& building : world.buildings) {
    const std::size_t corners = building.footprint.size();
    for (std::size_t i = 0; i < corners; ++i) {
      const Eigen::Vector2d a = building.footprint[i];
      const Eigen::Vector2d along = building.footprint[(i + 1) % corners] - a;
      const Eigen::Vector3d normal = Eigen::Vector3d(along.y(), -along.x(), 0.0).normalized();
      const double distance = normal.head<2>().dot(antenna.head<2>() - a);
      if (distance <= 0.0 || normal.dot(u) <= 0.0) continue;
      const Eigen::Vector3d image = antenna - 2.0 * distance * normal;
      const Eigen::Vector3d point = image + distance / normal.dot(u) * u;
      const double share = (point.head<2>() - a).dot(along) / along.squaredNorm();
      if (share < 0.0 || share > 1.0 || point.z() < building.base_m || point.z() > building.roof_m) continue;
      const Eigen::Vector3d way = point - antenna;
      if (is_free(world, antenna, way.normalized(), way.norm()) && is_free(world, point, u, 1e9)) {
        excesses.push_back(u.dot(antenna - image));
      }
    }
  }
  std::sort(excesses.begin(), excesses.end());
  return excesses;
}

std::vector<double> sorted_excesses(const SignalPaths& paths) {
  std::vector<double> excesses;
  for (const Reflection& reflection : paths.reflections) excesses.push_back(reflection.excess_m);
  std::sort(excesses.begin(), excesses.end());
  return excesses;
}

TEST(SignalPaths, OpenSkyIsFree) {
  Scene scene{World{}};
  const SignalPaths paths = scene.trace({0.0, 0.0, 1.5}, direction(40.0, 5.0));
  EXPECT_FALSE(paths.is_blocked);
  EXPECT_TRUE(paths.has_direct);
  EXPECT_EQ(paths.loss_db, 0.0);
  EXPECT_EQ(paths.excess_m, 0.0);
  EXPECT_TRUE(paths.reflections.empty());
}

TEST(SignalPaths, NothingComesFromTheHorizonOrBelowOrIntoABuilding) {
  Scene scene{World{{box({0.0, 0.0}, 20.0, 20.0, 0.0, 30.0)}, {}}};
  for (const SignalPaths& paths :
       {scene.trace({50.0, 0.0, 2.0}, direction(90.0, 0.0)), scene.trace({50.0, 0.0, 2.0}, direction(90.0, -10.0)),
        scene.trace({0.0, 0.0, 2.0}, direction(90.0, 80.0)), scene.trace({50.0, 0.0, 2.0}, {0.0, 0.0, std::nan("")})}) {
    EXPECT_TRUE(paths.is_blocked);
    EXPECT_FALSE(paths.has_direct);
    EXPECT_TRUE(paths.reflections.empty());
  }
}

TEST(SignalPaths, DelayOfAPlaneWallIsTwiceTheDistanceTimesTheCosine) {
  RandomEngine engine = make_engine(1);
  int found = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const double yaw = uniform(engine, 0.0, 2.0 * kPi);
    const Eigen::Vector2d centre(uniform(engine, -50.0, 50.0), uniform(engine, -50.0, 50.0));
    Scene scene(World{{box(centre, 1000.0, 1.0, yaw, 1000.0)}, {}}, without_limits());
    const Eigen::Vector2d normal = Eigen::Rotation2Dd(yaw) * Eigen::Vector2d(0.0, 1.0);
    const double distance = uniform(engine, 0.01, 20.0);
    const Eigen::Vector2d place = centre + (0.5 + distance) * normal;
    const Eigen::Vector3d antenna(place.x(), place.y(), uniform(engine, 0.0, 5.0));
    const Eigen::Vector3d u = random_direction(engine, 1.0);
    const double cosine = normal.dot(u.head<2>());
    if (std::abs(cosine) < 0.05) continue;
    const SignalPaths paths = scene.trace(antenna, u);
    EXPECT_EQ(paths.is_blocked, cosine < 0.0);
    ASSERT_EQ(paths.reflections.size(), cosine > 0.0 ? 1u : 0u);
    if (cosine < 0.0) continue;
    ++found;
    EXPECT_NEAR(paths.reflections[0].excess_m, 2.0 * distance * cosine, 1e-6);
    EXPECT_EQ(paths.reflections[0].count, 1);
    EXPECT_DOUBLE_EQ(paths.reflections[0].loss_db, 12.0);  // the wall's 6 and the antenna's 6
  }
  EXPECT_GT(found, 800);
}

TEST(SignalPaths, SingleReflectionsAreThoseOfTheImageMethodWallByWall) {
  RandomEngine engine = make_engine(2);
  int found = 0;
  for (int trial = 0; trial < 40; ++trial) {
    const World world = trial % 2 == 0 ? grid_city(engine, 0.3) : irregular_city(engine);
    Scene scene(world, without_limits());
    for (int pose = 0; pose < 60; ++pose) {
      const Eigen::Vector3d antenna(uniform(engine, -90.0, 90.0), uniform(engine, -90.0, 90.0), 1.5);
      if (scene.index.is_inside(antenna)) continue;
      const Eigen::Vector3d u = random_direction(engine);
      const SignalPaths paths = scene.trace(antenna, u);
      EXPECT_EQ(paths.is_blocked, !is_free(world, antenna, u, 1e9));
      const std::vector<double> expected = single_reflections(world, antenna, u);
      const std::vector<double> excesses = sorted_excesses(paths);
      ASSERT_EQ(excesses.size(), expected.size()) << "trial " << trial << " pose " << pose;
      for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(excesses[i], expected[i], 1e-6);
      found += static_cast<int>(expected.size());
    }
  }
  EXPECT_GT(found, 200);
}

TEST(SignalPaths, ChainsObeyTheLawOfReflectionAndTheImages) {
  RandomEngine engine = make_engine(3);
  SignalParameters parameters = without_limits();
  parameters.max_reflections = 5;
  std::array<int, kMaxReflections + 1> found{};
  for (int city = 0; city < 5; ++city) {
    Scene scene(grid_city(engine, 0.2 * city), parameters);
    for (int pose = 0; pose < 300; ++pose) {
      const Eigen::Vector3d antenna(uniform(engine, -90.0, 90.0), uniform(engine, -90.0, 90.0), 1.5);
      const Eigen::Vector3d u = random_direction(engine);
      for (const Reflection& path : scene.trace(antenna, u).reflections) {
        ++found[path.count];
        Eigen::Vector3d image = antenna;
        Eigen::Vector3d from = antenna;
        for (int i = 0; i < path.count; ++i) {
          const Eigen::Vector3d point = path.points[i];
          const Eigen::Vector3d in = (point - from).normalized();
          const Eigen::Vector3d out = i + 1 < path.count ? (path.points[i + 1] - point).normalized() : u;
          const Eigen::Vector3d normal = (out - in).normalized();
          ASSERT_NEAR(normal.z(), 0.0, 1e-4);
          ASSERT_TRUE(is_free(scene.world, from, in, (point - from).norm() - 1e-4));
          image -= 2.0 * normal.dot(image - point) * normal;
          from = point;
        }
        ASSERT_TRUE(is_free(scene.world, from + 1e-5 * u, u, 1e9));
        EXPECT_NEAR(path.excess_m, u.dot(antenna - image), 1e-3);
        EXPECT_GT(path.excess_m, 0.0);
        EXPECT_DOUBLE_EQ(path.loss_db, 6.0 * path.count + (path.count % 2 == 1 ? 6.0 : 0.0));
      }
    }
  }
  for (int count = 1; count <= 4; ++count) EXPECT_GT(found[count], 10) << count;
  EXPECT_EQ(found[6], 0);
}

TEST(SignalPaths, CanyonGivesTheChainsThatItsImagesGive) {
  // A street of width 20 m along x, walls to y = 0 and y = 20; the antenna at y = 5, the satellite over y = 20.
  SignalParameters parameters = without_limits();
  parameters.max_reflections = 4;
  const double depth = 2000.0;
  Scene scene(World{{box({0.0, -5.0}, depth, 10.0, 0.0, 30.0), box({0.0, 25.0}, depth, 10.0, 0.0, 30.0)}, {}},
              parameters);
  const Eigen::Vector3d antenna(0.0, 5.0, 0.0);
  for (double elevation_deg = 6.0; elevation_deg < 88.0; elevation_deg += 1.37) {
    const Eigen::Vector3d u = direction(0.0, elevation_deg);
    const double slope = std::tan(degrees_to_radians(elevation_deg));
    // Unfolded, the ray crosses the street's walls at these distances; it is free once above 30 m at one of them, and a
    // path if it then runs towards +y.
    const auto escapes = [&](double first, int count) {
      const double last = first + 20.0 * (count - 1);  // where it meets its last wall
      return (count == 0 || last * slope <= 30.0) && (count == 0 ? first : last + 20.0) * slope > 30.0;
    };
    std::vector<double> expected;
    for (const int count : {2, 4}) {  // leaves towards +y: an even number of walls
      if (escapes(15.0, count)) expected.push_back(20.0 * count * u.y());
    }
    for (const int count : {1, 3}) {  // leaves towards -y
      if (escapes(5.0, count)) expected.push_back((2.0 * 5.0 + 20.0 * (count - 1)) * u.y());
    }
    std::sort(expected.begin(), expected.end());
    const SignalPaths paths = scene.trace(antenna, u);
    EXPECT_EQ(paths.is_blocked, 15.0 * slope <= 30.0);
    const std::vector<double> excesses = sorted_excesses(paths);
    ASSERT_EQ(excesses.size(), expected.size()) << elevation_deg;
    for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(excesses[i], expected[i], 1e-4) << elevation_deg;
  }
}

TEST(SignalPaths, LimitsLeaveReflectionsOut) {
  const World world{{box({0.0, 30.0}, 100.0, 20.0, 0.0, 40.0)}, {}};  // its wall at y = 20
  const Eigen::Vector3d antenna(0.0, 0.0, 1.5);
  const Eigen::Vector3d u = direction(180.0, 30.0);
  SignalParameters parameters;
  const auto count = [&] { return Scene(world, parameters).trace(antenna, u).reflections.size(); };
  EXPECT_EQ(count(), 1u);
  parameters.max_reflections = 0;
  EXPECT_EQ(count(), 0u);
  parameters = {};
  parameters.reflection_range = 19.9;
  EXPECT_EQ(count(), 0u);
  parameters = {};
  parameters.max_loss = 11.9;
  EXPECT_EQ(count(), 0u);
  parameters = {};
  parameters.max_directions = 1;  // single reflections are found nevertheless
  EXPECT_EQ(count(), 1u);
}

TEST(SignalPaths, DiffractionGrowsSteadilyIntoTheShadow) {
  Scene scene{World{{box({0.0, 30.0}, 200.0, 20.0, 0.0, 21.5)}, {}}};  // 20 m above the antenna, 20 m away
  const Eigen::Vector3d antenna(0.0, 0.0, 1.5);
  double last = 0.0;
  for (double elevation_deg = 50.0; elevation_deg > 42.0; elevation_deg -= 0.01) {
    const SignalPaths paths = scene.trace(antenna, direction(0.0, elevation_deg));
    EXPECT_EQ(paths.is_blocked, elevation_deg < 45.0);
    ASSERT_TRUE(paths.has_direct);
    EXPECT_GE(paths.loss_db, last);
    EXPECT_LT(paths.loss_db, last + 0.1);
    last = paths.loss_db;
    if (!paths.is_blocked) continue;
    const Eigen::Vector3d way = paths.edge - antenna;
    EXPECT_TRUE(paths.edge.isApprox(Eigen::Vector3d(0.0, 20.0, 21.5), 1e-9));
    EXPECT_NEAR(paths.excess_m, way.norm() - way.dot(direction(0.0, elevation_deg)), 1e-9);
  }
  EXPECT_GT(last, 10.0);
  EXPECT_NEAR(scene.trace(antenna, direction(0.0, 45.001)).loss_db, 6.0, 0.1);
  EXPECT_FALSE(scene.trace(antenna, direction(0.0, 10.0)).has_direct);  // beyond max_loss
  EXPECT_EQ(scene.trace(antenna, direction(0.0, 60.0)).loss_db, 0.0);
}

TEST(SignalPaths, NothingIsDiffractedIntoATunnel) {
  SignalParameters parameters;
  parameters.max_loss = 100.0;
  Scene scene(World{{box({0.0, 0.0}, 40.0, 20.0, 0.0, 7.0, 6.0)}, {}}, parameters);
  for (const double elevation_deg : {26.5, 30.0, 60.0, 90.0}) {  // 26.5: out through the roof's side, an edge above it
    const SignalPaths inside = scene.trace({0.0, 0.0, 1.5}, direction(0.0, elevation_deg));
    EXPECT_TRUE(inside.is_blocked);
    EXPECT_FALSE(inside.has_direct);
  }
  // Out at the side under its roof: free, and the wall above the ray is no edge that costs anything.
  const SignalPaths sideways = scene.trace({0.0, 8.0, 1.5}, direction(0.0, 20.0));
  EXPECT_FALSE(sideways.is_blocked);
  EXPECT_EQ(sideways.loss_db, 0.0);
}

TEST(SignalPaths, NothingIsDiffractedThroughADeckBehindTheEdge) {
  const Building house = box({0.0, 30.0}, 200.0, 20.0, 0.0, 21.5);
  const Building deck = box({0.0, 60.0}, 200.0, 60.0, 0.0, 42.0, 40.0);
  const Eigen::Vector3d antenna(0.0, 0.0, 1.5);
  const Eigen::Vector3d u = direction(0.0, 44.5);
  EXPECT_TRUE(Scene(World{{house}, {}}).trace(antenna, u).has_direct);
  EXPECT_FALSE(Scene(World{{house, deck}, {}}).trace(antenna, u).has_direct);
}

TEST(SignalPaths, CrownsAttenuateByTheWayThroughThem) {
  Tree tree;
  tree.position = {0.0, 10.0};
  tree.trunk_radius_m = 0.2;
  tree.crown_radius_m = 3.0;
  tree.crown_base_m = 3.0;
  tree.crown_top_m = 9.0;
  tree.attenuation_db_per_m = 1.5;
  SignalParameters parameters;
  parameters.trunk_loss = 10.0;
  Scene scene(World{{}, {tree}}, parameters);
  const Eigen::Vector3d antenna(0.0, 0.0, 2.0);
  // In at y = 7 where z > 3; out at y = 13 where z < 9: the whole diameter, slanted.
  const double flat = std::atan2(5.0, 13.0);
  EXPECT_NEAR(scene.trace(antenna, direction(0.0, radians_to_degrees(flat))).loss_db, 1.5 * 6.0 / std::cos(flat), 1e-9);
  // Out through the top at y = 7 / tan(el).
  const double steep = std::atan2(7.0, 10.0);
  EXPECT_NEAR(scene.trace(antenna, direction(0.0, radians_to_degrees(steep))).loss_db, 1.5 * 3.0 / std::cos(steep),
              1e-9);
  EXPECT_NEAR(scene.trace(antenna, direction(0.0, 3.0)).loss_db, 10.0, 1e-9);  // under the crown, into the trunk
  EXPECT_EQ(scene.trace(antenna, direction(20.0, 30.0)).loss_db, 0.0);         // past it
  EXPECT_EQ(scene.trace(antenna, direction(180.0, 30.0)).loss_db, 0.0);        // away from it
  EXPECT_NEAR(scene.trace({1.0, 10.0, 2.0}, {0.0, 0.0, 1.0}).loss_db, 1.5 * 6.0, 1e-9);
  EXPECT_FALSE(scene.trace(antenna, direction(0.0, 20.0)).is_blocked);
}

TEST(SignalPaths, ABuildingMoreNeverFreesALineOfSight) {
  RandomEngine engine = make_engine(5);
  World world = irregular_city(engine);
  World more = world;
  more.buildings.push_back(box({10.0, 5.0}, 30.0, 30.0, 0.4, 45.0));
  Scene before(world);
  Scene after(more);
  for (int trial = 0; trial < 1000; ++trial) {
    const Eigen::Vector3d antenna(uniform(engine, -90.0, 90.0), uniform(engine, -90.0, 90.0), 1.5);
    const Eigen::Vector3d u = random_direction(engine);
    const SignalPaths with_less = before.trace(antenna, u);
    const SignalPaths with_more = after.trace(antenna, u);
    EXPECT_LE(with_less.is_blocked, with_more.is_blocked);
    EXPECT_GE(with_less.has_direct, with_more.has_direct);
    EXPECT_LE(with_less.loss_db, with_more.has_direct ? with_more.loss_db + 1e-12 : 1e9);
  }
}

}  // namespace
}  // namespace urban_gnss
