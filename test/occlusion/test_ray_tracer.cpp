#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "plain_voxel_ray_tracer.hpp"
#include "synthetic_walls.hpp"
#include "urban_gnss_localization/occlusion/kd_tree_ray_tracer.hpp"
#include "urban_gnss_localization/occlusion/voxel_ray_tracer.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

VoxelMap map_of(const PointCloud& cloud, double spacing_m) {
  VoxelMap map(voxel_map_parameters_for(spacing_m));
  map.add_points(cloud);
  return map;
}

KdTreeRayTracerParameters kd_tree_parameters_for(double spacing_m) {
  KdTreeRayTracerParameters parameters;
  parameters.min_range = VoxelRayTracerParameters().min_range;
  parameters.range_step = 0.5 * spacing_m;
  parameters.search_radius = parameters.search_radius_max = 0.75 * spacing_m;
  parameters.search_radius_slope = 0.0;
  return parameters;
}

Eigen::Vector3d draw_antenna(RandomEngine& engine) {
  return {-50.0 + 100.0 * draw_uniform(engine), -4.0 + 8.0 * draw_uniform(engine), 1.5};
}

TEST(VoxelRayTracer, IsRightButForRaysWithinHalfASampleOfAnEdge) {
  const auto walls = street();
  for (const double spacing_m : {0.6, 1.0, 1.7}) {
    const VoxelMap map = map_of(sampled(walls, spacing_m), spacing_m);
    const VoxelRayTracer tracer(map, {});
    RandomEngine engine = make_engine(3);
    int blocked = 0;
    int at_edges = 0;
    for (int i = 0; i < 3000; ++i) {
      const Eigen::Vector3d antenna = draw_antenna(engine);
      const Eigen::Vector3d direction = draw_sky_direction(engine, 0.05);
      const auto inner = exact_range(walls, antenna, direction, -0.5 * spacing_m);
      const auto outer = exact_range(walls, antenna, direction, 0.5 * spacing_m);
      if (inner.has_value() != outer.has_value()) {
        ++at_edges;
        continue;
      }
      const RayOutcome outcome = tracer.trace(antenna, direction);
      ASSERT_EQ(outcome.blocked, inner.has_value()) << spacing_m << " m, ray " << i;
      ASSERT_EQ(outcome.vegetation_m, 0.0);
      if (!outcome.blocked) {
        ASSERT_EQ(outcome.range_m, kInfinity);
        continue;
      }
      ++blocked;
      // A triangle across the corner of two walls lies a little before either, and along a wall its depth is uncertain.
      ASSERT_LT(outcome.range_m, *inner + 6.0 * spacing_m) << spacing_m << " m, ray " << i;
      ASSERT_GT(outcome.range_m, *outer - 3.0 * spacing_m) << spacing_m << " m, ray " << i;
    }
    EXPECT_GT(blocked, 800);
    EXPECT_LT(at_edges, 600);
  }
}

TEST(VoxelRayTracer, EdgesAreWhereTheOutermostPointsAre) {
  // Without the rim of a voxel walk: a ray that passes 5 cm beside the wall is free, 5 cm inside it is not.
  for (const double yaw : {0.0, 0.3, M_PI / 4.0}) {
    const Eigen::Vector2d along(std::cos(yaw), std::sin(yaw));
    const Eigen::Vector2d middle = 20.0 * Eigen::Vector2d(-along.y(), along.x());
    const auto side = wall(middle - 10.0 * along, middle + 10.0 * along, -5.0, 15.0);
    const VoxelMap map = map_of(sampled({side}, 0.5), 0.5);
    const VoxelRayTracer tracer(map, {});
    for (double offset_m = -9.0; offset_m < 9.0; offset_m += 0.37) {
      const auto towards = [&](double along_m, double height_m) {
        const Eigen::Vector2d place = middle + along_m * along;
        return Eigen::Vector3d(place.x(), place.y(), height_m).normalized().eval();
      };
      const double height_m = 5.0 + offset_m;
      EXPECT_TRUE(tracer.trace(Eigen::Vector3d::Zero(), towards(offset_m, 14.95)).blocked) << yaw << ' ' << offset_m;
      EXPECT_FALSE(tracer.trace(Eigen::Vector3d::Zero(), towards(offset_m, 15.05)).blocked) << yaw << ' ' << offset_m;
      EXPECT_TRUE(tracer.trace(Eigen::Vector3d::Zero(), towards(9.8, height_m)).blocked) << yaw << ' ' << height_m;
      EXPECT_FALSE(tracer.trace(Eigen::Vector3d::Zero(), towards(10.2, height_m)).blocked) << yaw << ' ' << height_m;
    }
  }
}

/// Whether the ray pierces a triangle of linked points, by trying all of them in double precision.
bool pierces_any(const PointCloud& points, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                 double link_m, double reach_m, double depth_m) {
  std::vector<Eigen::Vector3d> near;
  for (const Eigen::Vector3f& point : points) {
    const Eigen::Vector3d offset = point.cast<double>() - origin;
    if (offset.dot(direction) >= 1.0 && offset.cross(direction).norm() <= reach_m) near.push_back(offset);
  }
  for (std::size_t i = 0; i < near.size(); ++i) {
    for (std::size_t j = i + 1; j < near.size(); ++j) {
      if ((near[i] - near[j]).norm() > link_m) continue;
      for (std::size_t k = j + 1; k < near.size(); ++k) {
        if ((near[i] - near[k]).norm() > link_m || (near[j] - near[k]).norm() > link_m) continue;
        Eigen::Matrix3d corners;
        corners << near[i], near[j], near[k];
        const Eigen::Vector3d weights = corners.fullPivLu().solve(direction);
        if (!weights.allFinite() || weights.minCoeff() < 0.0) continue;
        if (!(corners * weights).isApprox(direction, 1e-9)) continue;  // three points in line
        const double range_m = 1.0 / weights.sum();
        bool is_within_depth = true;
        for (const std::size_t corner : {i, j, k}) {
          is_within_depth = is_within_depth && std::abs(near[corner].dot(direction) - range_m) <= depth_m;
        }
        if (is_within_depth) return true;
      }
    }
  }
  return false;
}

TEST(VoxelRayTracer, AgreesWithTryingAllTriangles) {
  RandomEngine engine = make_engine(11);
  int blocked = 0;
  for (int trial = 0; trial < 12; ++trial) {
    PointCloud cloud;
    for (int i = 0; i < 900; ++i) {
      const auto coordinate = [&] { return static_cast<float>(-10.0 + 20.0 * draw_uniform(engine)); };
      const float x = coordinate();
      const float y = coordinate();
      cloud.emplace_back(x, y, coordinate());
    }
    const VoxelMap map = map_of(cloud, 0.6);
    const VoxelRayTracer tracer(map, {});
    const double link_m = 3.2 * 0.6;
    const double reach_m = link_m / std::sqrt(3.0);
    for (int ray = 0; ray < 100; ++ray) {
      const Eigen::Vector3d origin(-12.0, -8.0 + 16.0 * draw_uniform(engine), -8.0 + 16.0 * draw_uniform(engine));
      const Eigen::Vector3d direction =
          Eigen::Vector3d(1.0, draw_uniform(engine) - 0.5, draw_uniform(engine) - 0.5).normalized();
      const bool outcome = tracer.trace(origin, direction).blocked;
      blocked += outcome ? 1 : 0;
      if (outcome) {
        EXPECT_TRUE(pierces_any(map.points(), origin, direction, link_m + 1e-3, reach_m + 1e-3, kInfinity));
      } else {
        EXPECT_FALSE(pierces_any(map.points(), origin, direction, link_m - 1e-3, reach_m - 1e-3, reach_m - 1e-3));
      }
    }
  }
  EXPECT_GT(blocked, 150);
  EXPECT_LT(blocked, 1000);
}

TEST(VoxelRayTracer, EqualsThePlainOneToTheLastBit) {
  RandomEngine engine = make_engine(31);
  const auto in_cube = [&](double half_m) -> Eigen::Vector3d {
    return half_m * Eigen::Vector3d(draw_uniform(engine) - 0.5, draw_uniform(engine) - 0.5, draw_uniform(engine) - 0.5);
  };
  VoxelMapParameters parameters;
  parameters.ray_stride = 1;
  int blocked = 0;
  int in_vegetation = 0;
  // Sparse, dense with more points about a ray than are kept, and walls.
  for (const int points : {700, 12000, 0}) {
    VoxelMap map(parameters);
    PointCloud cloud = points > 0 ? PointCloud() : sampled(street(), 0.45);
    for (int i = 0; i < points; ++i) cloud.push_back(in_cube(16.0).cast<float>());
    for (int scan = 0; scan < 8; ++scan) map.add_scan(cloud, in_cube(20.0));
    VoxelRayTracerParameters wide;
    wide.link_length = 4.0;
    wide.max_permeability = points == 0 ? 0.5 : 0.8;
    const VoxelRayTracer tracer(map, wide);
    const PlainVoxelRayTracer plain(map, wide);
    for (int ray = 0; ray < 400; ++ray) {
      const Eigen::Vector3d origin = in_cube(40.0);
      const Eigen::Vector3d direction =
          ray % 8 == 0 ? Eigen::Vector3d(Eigen::Vector3d::Unit(ray % 3)) : (in_cube(10.0) - origin).normalized().eval();
      const RayOutcome expected = plain.trace(origin, direction);
      const RayOutcome outcome = tracer.trace(origin, direction);
      ASSERT_EQ(outcome.blocked, expected.blocked) << points << " points, ray " << ray;
      ASSERT_EQ(outcome.range_m, expected.range_m) << points << " points, ray " << ray;
      ASSERT_EQ(outcome.vegetation_m, expected.vegetation_m) << points << " points, ray " << ray;
      blocked += outcome.blocked ? 1 : 0;
      in_vegetation += outcome.vegetation_m > 0.0 ? 1 : 0;
    }
  }
  EXPECT_GT(blocked, 200);
  EXPECT_GT(in_vegetation, 100);
}

TEST(VoxelRayTracer, SkippingEmptySpaceSkipsNoWall) {
  // Small far-apart walls about the origin, where coordinates change sign, with empty bricks between them.
  RandomEngine engine = make_engine(21);
  std::vector<Rectangle> walls;
  for (int i = 0; i < 60; ++i) {
    const double yaw = 2.0 * M_PI * draw_uniform(engine);
    const Eigen::Vector2d along(std::cos(yaw), std::sin(yaw));
    const Eigen::Vector2d middle(-150.0 + 300.0 * draw_uniform(engine), -150.0 + 300.0 * draw_uniform(engine));
    const double foot_m = -60.0 + 100.0 * draw_uniform(engine);
    walls.push_back(wall(middle - 5.0 * along, middle + 5.0 * along, foot_m, foot_m + 8.0));
  }
  const VoxelMap map = map_of(sampled(walls, 0.7), 0.5);
  const PointCloud points = map.points();
  const VoxelRayTracer tracer(map, {});
  const double link_m = 3.2 * 0.5;
  const double reach_m = link_m / std::sqrt(3.0);
  int blocked = 0;
  for (int ray = 0; ray < 400; ++ray) {
    const Eigen::Vector3d origin(-20.0 + 40.0 * draw_uniform(engine), -20.0 + 40.0 * draw_uniform(engine),
                                 -20.0 + 40.0 * draw_uniform(engine));
    // Half of them near a point of a wall, some along the axes of the grid, on which faces are met edge on.
    const auto target = static_cast<std::size_t>(draw_uniform(engine) * static_cast<double>(points.size()));
    const Eigen::Vector3d beside(draw_uniform(engine) - 0.5, draw_uniform(engine) - 0.5, draw_uniform(engine) - 0.5);
    const Eigen::Vector3d axis = Eigen::Vector3d::Unit(ray % 3) * (ray % 4 < 2 ? 1.0 : -1.0);
    const Eigen::Vector3d direction = ray % 8 == 0   ? axis
                                      : ray % 2 == 0 ? draw_sky_direction(engine, -0.5)
                                                     : (points[target].cast<double>() + beside - origin).normalized();
    const bool outcome = tracer.trace(origin, direction).blocked;
    blocked += outcome ? 1 : 0;
    if (outcome) {
      EXPECT_TRUE(pierces_any(points, origin, direction, link_m + 1e-3, reach_m + 1e-3, kInfinity)) << ray;
    } else {
      EXPECT_FALSE(pierces_any(points, origin, direction, link_m - 1e-3, reach_m - 1e-3, reach_m - 1e-3)) << ray;
    }
  }
  EXPECT_GT(blocked, 100);
  EXPECT_LT(blocked, 300);
}

TEST(VoxelRayTracer, NeitherSinglePointsNorPolesBlock) {
  PointCloud cloud;
  for (int i = 0; i < 40; ++i) cloud.emplace_back(10.0F, 0.0F, 0.25F * static_cast<float>(i));
  cloud.emplace_back(-10.0F, 0.0F, 3.0F);
  const VoxelMap map = map_of(cloud, 0.5);
  const VoxelRayTracer tracer(map, {});
  EXPECT_FALSE(tracer.trace({0, 0, 1}, Eigen::Vector3d(10, 0, 3).normalized()).blocked);
  EXPECT_FALSE(tracer.trace({0, 0, 1}, Eigen::Vector3d(-10, 0, 2).normalized()).blocked);
}

TEST(VoxelRayTracer, RangesAreKept) {
  const VoxelMap map = map_of(sampled({wall({10, -5}, {10, 5}, 0, 10)}, 0.5), 0.5);
  VoxelRayTracerParameters parameters;
  parameters.min_range = 12.0;
  const Eigen::Vector3d origin(0.0, 0.1, 4.2);
  EXPECT_FALSE(VoxelRayTracer(map, parameters).trace(origin, Eigen::Vector3d::UnitX()).blocked);
  parameters = {};
  parameters.max_range = 9.0;
  EXPECT_FALSE(VoxelRayTracer(map, parameters).trace(origin, Eigen::Vector3d::UnitX()).blocked);
  parameters.max_range = 11.0;
  const RayOutcome outcome = VoxelRayTracer(map, parameters).trace(origin, Eigen::Vector3d::UnitX());
  EXPECT_TRUE(outcome.blocked);
  EXPECT_NEAR(outcome.range_m, 10.0, 1e-3);
  EXPECT_FALSE(VoxelRayTracer(map, parameters).trace(origin, -Eigen::Vector3d::UnitX()).blocked);
}

TEST(VoxelRayTracer, AddedWallsOnlyHide) {
  auto walls = street();
  const VoxelMap before = map_of(sampled(walls, 1.0), 1.0);
  walls.push_back(wall({-10.0, 4.5}, {25.0, 9.0}, 0.0, 9.0));
  const VoxelMap after = map_of(sampled(walls, 1.0), 1.0);
  const VoxelRayTracer tracer_before(before, {});
  const VoxelRayTracer tracer_after(after, {});
  RandomEngine engine = make_engine(5);
  int hidden = 0;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d antenna = draw_antenna(engine);
    const Eigen::Vector3d direction = draw_sky_direction(engine, 0.1);
    const bool was = tracer_before.trace(antenna, direction).blocked;
    const bool is = tracer_after.trace(antenna, direction).blocked;
    EXPECT_TRUE(is || !was);
    hidden += is && !was ? 1 : 0;
  }
  EXPECT_GT(hidden, 20);
}

TEST(RayTracers, AgreeAtEqualResolution) {
  const auto walls = street();
  const PointCloud cloud = sampled(walls, 0.5);
  const VoxelMap map = map_of(cloud, 0.5);
  const VoxelRayTracer voxels(map, {});
  const KdTreeRayTracer tree(cloud, kd_tree_parameters_for(0.5));
  RandomEngine engine = make_engine(8);
  int equal = 0;
  constexpr int kRays = 1000;
  for (int i = 0; i < kRays; ++i) {
    const Eigen::Vector3d antenna = draw_antenna(engine);
    const Eigen::Vector3d direction = draw_sky_direction(engine, 0.17);
    const RayOutcome a = voxels.trace(antenna, direction);
    const RayOutcome b = tree.trace(antenna, direction);
    equal += a.blocked == b.blocked ? 1 : 0;
    // What the tracer without a rim calls blocked, the one with a rim calls blocked, too.
    EXPECT_TRUE(b.blocked || !a.blocked);
  }
  EXPECT_GE(equal, 0.98 * kRays);
}

TEST(RayTracers, NothingAndNonsenseAreFree) {
  const PointCloud unusable = {{std::nanf(""), 0.0F, 0.0F}, {0.0F, INFINITY, 0.0F}};
  for (const PointCloud& cloud : {PointCloud(), unusable}) {
    const VoxelMap map = map_of(cloud, 1.0);
    EXPECT_EQ(map.size(), 0u);
    EXPECT_FALSE(VoxelRayTracer(map, {}).trace({0, 0, 0}, {0, 0, 1}).blocked);
    EXPECT_FALSE(KdTreeRayTracer(cloud, {}).trace({0, 0, 0}, {0, 0, 1}).blocked);
  }
  const PointCloud cloud = sampled({wall({10, -5}, {10, 5}, 0, 10)}, 1.0);
  const VoxelMap map = map_of(cloud, 1.0);
  const VoxelRayTracer voxels(map, {});
  const KdTreeRayTracer tree(cloud, {});
  for (const double bad : {kNaN, kInfinity}) {
    EXPECT_FALSE(voxels.trace({bad, 0, 5}, {1, 0, 0}).blocked);
    EXPECT_FALSE(voxels.trace({0, 0, 5}, {bad, 0, 0}).blocked);
    EXPECT_FALSE(tree.trace({bad, 0, 5}, {1, 0, 0}).blocked);
    EXPECT_FALSE(tree.trace({0, 0, 5}, {bad, 0, 0}).blocked);
  }
}

TEST(KdTreeRayTracer, RadiusIsLinearAndBounded) {
  KdTreeRayTracerParameters parameters;
  parameters.min_range = 1.0;
  parameters.range_step = 0.1;
  parameters.search_radius = 0.3;
  parameters.search_radius_slope = 0.02;
  parameters.search_radius_max = 1.0;
  const auto blocked = [&](float x, float y) {
    return KdTreeRayTracer({{x, y, 0.0F}}, parameters).trace({0, 0, 0}, {1, 0, 0}).blocked;
  };
  EXPECT_TRUE(blocked(10.0F, 0.49F));  // 0.3 + 0.02 * 10
  EXPECT_FALSE(blocked(10.0F, 0.55F));
  EXPECT_TRUE(blocked(100.0F, 0.98F));  // bounded
  EXPECT_FALSE(blocked(100.0F, 1.02F));
  EXPECT_FALSE(blocked(0.5F, 0.0F));    // nearer than min_range
  EXPECT_FALSE(blocked(502.0F, 0.0F));  // farther than max_range
}

TEST(KdTreeRayTracer, SoManyNeighboursObstruct) {
  KdTreeRayTracerParameters parameters;
  parameters.min_neighbours = 3;
  PointCloud cloud = {{10.0F, 0.1F, 0.0F}, {10.0F, -0.1F, 0.0F}};
  EXPECT_FALSE(KdTreeRayTracer(cloud, parameters).trace({0, 0, 0}, {1, 0, 0}).blocked);
  cloud.emplace_back(10.0F, 0.0F, 0.1F);
  const RayOutcome outcome = KdTreeRayTracer(cloud, parameters).trace({0, 0, 0}, {1, 0, 0});
  EXPECT_TRUE(outcome.blocked);
  EXPECT_NEAR(outcome.range_m, 10.0, 0.5);
}

TEST(RayTracers, ParametersMustBeInOrder) {
  KdTreeRayTracerParameters tree;
  tree.search_radius = 3.0;
  EXPECT_THROW(KdTreeRayTracer({}, tree), ParameterError);
  const VoxelMap map{VoxelMapParameters()};
  VoxelRayTracerParameters voxels;
  voxels.link_length = 4.5;
  EXPECT_THROW(VoxelRayTracer(map, voxels), ParameterError);
  voxels = {};
  voxels.min_range = 600.0;
  EXPECT_THROW(VoxelRayTracer(map, voxels), ParameterError);
}

TEST(PointCloud, SpacingOfSquaresAndOfRandomPoints) {
  EXPECT_NEAR(sample_spacing_m(sampled({wall({0, 0}, {40, 30}, 0, 40)}, 0.5)), 0.5, 0.01);
  RandomEngine engine = make_engine(2);
  PointCloud random;
  for (int i = 0; i < 10000; ++i) {
    const double x = 50.0 * draw_uniform(engine);
    random.push_back(Eigen::Vector3d(x, 3.0, 50.0 * draw_uniform(engine)).cast<float>());
  }
  EXPECT_NEAR(sample_spacing_m(random), 1.13 * 0.5, 0.03);
  EXPECT_EQ(sample_spacing_m({}), 0.0);
  EXPECT_EQ(sample_spacing_m(PointCloud(100, Eigen::Vector3f::Ones())), 0.0);
}

TEST(PointCloud, VoxelFilterTakesTheMean) {
  const PointCloud cloud = {
      {0.1F, 0.1F, 0.1F}, {0.3F, 0.1F, 0.1F}, {-0.1F, 0.1F, 0.1F}, {NAN, 0.0F, 0.0F}, {1e9F, 0.0F, 0.0F}};
  const PointCloud filtered = voxel_filtered(cloud, 1.0);
  ASSERT_EQ(filtered.size(), 2u);
  EXPECT_NEAR(filtered[0].x(), 0.2F, 1e-6F);
  EXPECT_EQ(filtered[1], cloud[2]);
}

TEST(PointCloud, FilesAreWrittenReadAndRefused) {
  const std::filesystem::path folder = std::filesystem::path(::testing::TempDir());
  const std::string path = (folder / "urban_gnss_point_cloud_test.pcd").string();
  const PointCloud cloud = sampled({wall({10, -5}, {10, 5}, 0, 10)}, 1.0);
  write_pcd(path, cloud);
  EXPECT_EQ(read_pcd(path), cloud);
  EXPECT_THROW(write_pcd((folder / "absent" / "x.pcd").string(), cloud), std::runtime_error);
  EXPECT_THROW(write_pcd(path, {}), std::runtime_error);
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
  EXPECT_THROW(read_pcd(path), std::runtime_error);
  std::ofstream(path) << "stamp,x,y\n1,2,3\n";
  EXPECT_THROW(read_pcd(path), std::runtime_error);
  std::filesystem::remove(path);
  EXPECT_THROW(read_pcd(path), std::runtime_error);
}

/// A cloud of two points in ASCII, with one entry of its header in place of another.
std::string pcd_with(const std::string& entry, const std::string& data = "1 2 3\n4 5 6\n") {
  std::string text;
  for (const std::string line : {"VERSION 0.7", "FIELDS x y z", "SIZE 4 4 4", "TYPE F F F", "COUNT 1 1 1", "WIDTH 2",
                                 "HEIGHT 1", "VIEWPOINT 0 0 0 1 0 0 0", "POINTS 2", "DATA ascii"}) {
    const std::string name = line.substr(0, line.find(' ') + 1);
    text += (entry.compare(0, name.size(), name) == 0 ? entry : line) + "\n";
  }
  return text + data;
}

TEST(PointCloud, AFileWithoutPointsIsAnEmptyCloud) {
  const std::string path = (std::filesystem::path(::testing::TempDir()) / "urban_gnss_empty_test.pcd").string();
  std::string text = pcd_with("HEIGHT 0", "");
  text.erase(text.find("POINTS 2\n"), 9);
  std::ofstream(path, std::ios::binary) << text;
  EXPECT_TRUE(read_pcd(path).empty());
  std::filesystem::remove(path);
}

TEST(PointCloud, HeadersThatLieAreRefusedBeforeTheyAreBelieved) {
  const std::string path = (std::filesystem::path(::testing::TempDir()) / "urban_gnss_header_test.pcd").string();
  const auto fault_of = [&](const std::string& text) -> std::string {
    std::ofstream(path, std::ios::binary) << text;
    try {
      read_pcd(path);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(fault_of(pcd_with("VERSION .7")), "");
  EXPECT_EQ(fault_of(pcd_with("HEIGHT 1\r")), "");
  const std::pair<std::string, std::string> cases[] = {
      {"COUNT 1 -1 1", "COUNT must be"},
      {"COUNT 1 1", "COUNT must have a value for each"},
      {"COUNT 1 1 99999999999", "COUNT must be"},
      {"SIZE 4 0 4", "SIZE must be"},
      {"SIZE 4 3 4", "no such TYPE and SIZE"},
      {"TYPE F F G", "no such TYPE and SIZE"},
      {"FIELDS x y", "must have a value for each"},
      {"FIELDS x y w", "x, y and z"},
      {"WIDTH -2", "WIDTH must be"},
      {"WIDTH 3", "POINTS must be WIDTH times HEIGHT"},
      {"WIDTH 4294967298", "WIDTH must be"},
      {"HEIGHT 2147483647", "POINTS must be WIDTH times HEIGHT"},
      {"DATA binary", "cut off"},
      {"DATA binary_compressed", "cut off"},
      {"DATA text", "DATA must be"},
      {"VIEWPOINT 0", "VIEWPOINT"},
  };
  for (const auto& [entry, words] : cases) {
    const std::string fault = fault_of(pcd_with(entry));
    EXPECT_NE(fault.find(path), std::string::npos) << entry << ": " << fault;
    EXPECT_NE(fault.find(words), std::string::npos) << entry << ": " << fault;
  }
  EXPECT_NE(fault_of(pcd_with("", "1 2 3\n4 5\n")).find("point 2 has 2 numbers"), std::string::npos);
  EXPECT_NE(fault_of(pcd_with("", "1 2 3\n")).find("it has 1 points"), std::string::npos);
  const std::string lying(
      "\x10\x00\x00\x00\xff\xff\xff\x7f"
      "0123456789abcdef",
      24);
  EXPECT_NE(fault_of(pcd_with("DATA binary_compressed", lying)).find("another size"), std::string::npos);
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace urban_gnss
