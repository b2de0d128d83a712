#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <vector>

#include "plain_voxel_ray_tracer.hpp"
#include "synthetic_walls.hpp"
#include "urban_gnss_localization/occlusion/voxel_map.hpp"
#include "urban_gnss_localization/occlusion/voxel_ray_tracer.hpp"

namespace urban_gnss {
namespace {

TEST(KeyIndex, BehavesLikeAMap) {
  RandomEngine engine = make_engine(1);
  KeyIndex index;
  std::map<KeyIndex::Key, KeyIndex::Index> reference;
  for (int i = 0; i < 200000; ++i) {
    // Neighbouring keys, so that probing and the gaps that deletion leaves are met.
    const auto key = static_cast<KeyIndex::Key>(3000.0 * draw_uniform(engine));
    const auto value = static_cast<KeyIndex::Index>(i);
    if (draw_uniform(engine) < 0.5) {
      ASSERT_EQ(index.find_or_insert(key, value), reference.emplace(key, value).first->second);
    } else {
      index.erase(key);
      reference.erase(key);
    }
    ASSERT_EQ(index.size(), reference.size());
    const auto probe = static_cast<KeyIndex::Key>(3000.0 * draw_uniform(engine));
    const auto expected = reference.find(probe);
    ASSERT_EQ(index.find(probe), expected == reference.end() ? KeyIndex::kNone : expected->second);
  }
  std::size_t visited = 0;
  index.for_each([&](KeyIndex::Key key, KeyIndex::Index value) {
    ++visited;
    EXPECT_EQ(reference.at(key), value);
  });
  EXPECT_EQ(visited, reference.size());
}

TEST(VoxelWalk, KeysKeepCoordinates) {
  for (const int x : {0, 1, -1, 77, -kMaxVoxelCoordinate, kMaxVoxelCoordinate}) {
    const VoxelCoordinates voxel(x, -x, x / 2);
    EXPECT_EQ(voxel_of_key(voxel_key(voxel)), voxel);
  }
}

TEST(VoxelWalk, PassesWhatDenseSamplesPassAndOnlyThat) {
  RandomEngine engine = make_engine(4);
  const auto less = [](const VoxelCoordinates& a, const VoxelCoordinates& b) { return voxel_key(a) < voxel_key(b); };
  for (int trial = 0; trial < 300; ++trial) {
    const auto coordinate = [&] { return 20.0 * draw_uniform(engine) - 10.0; };
    Eigen::Vector3d origin(coordinate(), coordinate(), coordinate());
    Eigen::Vector3d direction(coordinate(), coordinate(), coordinate());
    if (trial % 3 == 0) direction[trial % 9 / 3] = 0.0;  // along faces of the grid
    if (trial % 7 == 0) direction = Eigen::Vector3d::Unit(trial % 3) * (trial % 2 == 0 ? 1.0 : -1.0);
    direction.normalize();
    std::vector<VoxelCoordinates> walked;
    double last_m = 1.0;
    walk_voxels(origin, direction, 1.0, 25.0, 0.7, [&](const VoxelCoordinates& voxel, double from_m, double to_m) {
      EXPECT_EQ(from_m, last_m);
      EXPECT_LE(to_m, 25.0);
      last_m = to_m;
      // The stretch lies in the voxel.
      const Eigen::Vector3d middle = origin + 0.5 * (from_m + to_m) * direction;
      EXPECT_LE((middle / 0.7 - voxel.cast<double>() - Eigen::Vector3d::Constant(0.5)).cwiseAbs().maxCoeff(),
                0.5 + 1e-9);
      if (!walked.empty()) {
        EXPECT_EQ((voxel - walked.back()).cwiseAbs().sum(), 1) << "through a face";
      }
      walked.push_back(voxel);
      return true;
    });
    EXPECT_EQ(last_m, 25.0);
    const std::set<VoxelCoordinates, decltype(less)> passed(walked.begin(), walked.end(), less);
    for (double r = 1.0; r < 25.0; r += 0.003) {
      const Eigen::Vector3d place = (origin + r * direction) / 0.7;
      const Eigen::Vector3d to_face = place - place.array().round().matrix();
      if (to_face.cwiseAbs().minCoeff() < 1e-6) continue;  // on a face, either side is right
      ASSERT_EQ(passed.count(voxel_of(place, 1.0)), 1u);
    }
  }
}

TEST(VoxelWalk, EqualsThePlainOneToTheLastBit) {
  RandomEngine engine = make_engine(5);
  for (int trial = 0; trial < 500; ++trial) {
    const auto coordinate = [&] { return 20.0 * draw_uniform(engine) - 10.0; };
    Eigen::Vector3d origin(coordinate(), coordinate(), coordinate());
    Eigen::Vector3d direction(coordinate(), coordinate(), coordinate());
    if (trial % 3 == 0) direction[trial % 9 / 3] = 0.0;
    if (trial % 5 == 0) direction = {1.0, 1.0, trial % 2 == 0 ? 1.0 : -1.0};  // through corners
    if (trial % 10 == 0) origin = origin.array().round();
    direction.normalize();
    struct Step {
      VoxelCoordinates cube;
      double from_m;
      double to_m;
    };
    std::vector<Step> plain;
    walk_plainly(origin, direction, 0.5, 30.0, 0.5, [&](const auto& cube, double from_m, double to_m) {
      plain.push_back({cube, from_m, to_m});
      return true;
    });
    std::size_t steps = 0;
    walk_voxels(origin, direction, 0.5, 30.0, 0.5, [&](const auto& cube, double from_m, double to_m) {
      EXPECT_LT(steps, plain.size());
      if (steps >= plain.size()) return false;
      EXPECT_EQ(cube, plain[steps].cube);
      EXPECT_EQ(from_m, plain[steps].from_m);
      EXPECT_EQ(to_m, plain[steps].to_m);
      ++steps;
      return true;
    });
    ASSERT_EQ(steps, plain.size()) << trial;
  }
}

TEST(VoxelWalk, StopsWhenTold) {
  int visits = 0;
  walk_voxels({0.5, 0.5, 0.5}, {1, 0, 0}, 0.0, 100.0, 1.0, [&](const auto&, double, double) { return ++visits < 7; });
  EXPECT_EQ(visits, 7);
}

TEST(VoxelMap, KeepsMeansAndCounts) {
  VoxelMap map{VoxelMapParameters()};
  const InsertReport report = map.add_points({{0.1F, 0.1F, 0.1F}, {0.3F, 0.1F, 0.1F}, {-0.1F, 0.1F, 0.1F}});
  EXPECT_EQ(report.points, 3u);
  EXPECT_EQ(report.new_voxels, 2u);
  EXPECT_EQ(map.size(), 2u);
  const auto voxel = map.find({0.2, 0.2, 0.2});
  ASSERT_NE(voxel, VoxelMap::kNone);
  EXPECT_EQ(map.returns(voxel), 2u);
  EXPECT_NEAR(map.position(voxel).x(), 0.2F, 1e-6F);
  EXPECT_EQ(map.find({0.7, 0.2, 0.2}), VoxelMap::kNone);
  EXPECT_EQ(map.points_within({-0.1, 0.1, 0.1}, 0.1).size(), 1u);
  map.clear();
  EXPECT_EQ(map.size(), 0u);
  EXPECT_EQ(map.find({0.2, 0.2, 0.2}), VoxelMap::kNone);
}

TEST(VoxelMap, EqualsPointAfterPointInAPlainMap) {
  struct Voxel {
    Eigen::Vector3f mean;
    std::uint32_t returns;
  };
  std::map<std::uint64_t, Voxel> plain;
  VoxelMap map{VoxelMapParameters()};
  RandomEngine engine = make_engine(8);
  for (int cloud = 0; cloud < 20; ++cloud) {
    PointCloud points;
    for (int i = 0; i < 997; ++i) {  // many to a voxel, new ones among known ones, neighbours one after the other
      const double spread_m = i % 2 == 0 ? 1.0 : 12.0;
      points.push_back(
          (spread_m * Eigen::Vector3d(draw_normal(engine), draw_normal(engine), draw_normal(engine))).cast<float>());
    }
    const std::size_t before = plain.size();
    for (const Eigen::Vector3f& point : points) {
      const VoxelCoordinates at = (2.0 * point.cast<double>()).array().floor().cast<int>();
      Voxel& voxel = plain.emplace(voxel_key(at), Voxel{point, 0}).first->second;
      if (voxel.returns++ > 0) voxel.mean += (point - voxel.mean) / static_cast<float>(voxel.returns);
    }
    EXPECT_EQ(map.add_points(points).new_voxels, plain.size() - before);
  }
  ASSERT_EQ(map.size(), plain.size());
  for (const auto& [key, voxel] : plain) {
    const auto found = map.find(0.5 * (voxel_of_key(key).cast<double>().array() + 0.5).matrix());
    ASSERT_NE(found, VoxelMap::kNone);
    EXPECT_EQ(map.position(found), voxel.mean);
    EXPECT_EQ(map.returns(found), voxel.returns);
  }
}

TEST(VoxelMap, UnusablePointsAreCounted) {
  VoxelMap map{VoxelMapParameters()};
  const PointCloud cloud = {{NAN, 0, 0}, {0, INFINITY, 0}, {0, 0, -INFINITY}, {3e5F, 0, 0}, {0, 1e30F, 0}, {5, 5, 5}};
  InsertReport report = map.add_scan(cloud, {0, 0, 0});
  EXPECT_EQ(report.unusable, 5u);
  EXPECT_EQ(map.size(), 1u);
  report = map.add_scan({}, {0, 0, 0});
  EXPECT_EQ(report.points, 0u);
  report = map.add_scan({{1, 1, 1}}, {0, std::nan(""), 0});
  EXPECT_EQ(report.unusable, 1u);
  EXPECT_EQ(map.size(), 1u);
}

TEST(VoxelMap, WindowDropsWhatIsFarAndKeepsRoofsSeenEarlier) {
  VoxelMapParameters parameters;
  parameters.window = 50.0;
  VoxelMap map(parameters);
  const PointCloud roof = sampled({wall({10, 10}, {20, 10}, 20, 25)}, 0.5);
  map.add_scan(roof, {0, 0, 0});
  const std::size_t size = map.size();
  EXPECT_GT(size, 100u);
  for (double x = 1.0; x < 40.0; x += 1.0) map.add_scan({}, {x, 0, 0});
  EXPECT_EQ(map.size(), size);  // not seen any more, still within the window of all of it
  std::size_t dropped = 0;
  for (double x = 40.0; x < 90.0; x += 1.0) {
    dropped += map.add_scan({}, {x, 0, 0}).dropped_by_window;
    for (const Eigen::Vector3f& point : map.points()) {
      // Attended to at every twentieth part of the window.
      ASSERT_LT((point.cast<double>() - Eigen::Vector3d(x, 0, 0)).norm(), 50.0 + 2.5 + 1.0);
    }
  }
  EXPECT_EQ(map.size(), 0u);
  EXPECT_EQ(dropped, size);
  EXPECT_FALSE(VoxelRayTracer(map, {}).trace({0, 0, 0}, Eigen::Vector3d(15, 10, 22).normalized()).blocked);
  map.add_scan(roof, {0, 0, 0});
  EXPECT_EQ(map.size(), size);
  EXPECT_TRUE(VoxelRayTracer(map, {}).trace({0, 0, 0}, Eigen::Vector3d(15, 10, 22).normalized()).blocked);
}

TEST(VoxelMap, MemoryIsBoundedAndTheFarthestGo) {
  VoxelMapParameters parameters;
  parameters.max_voxels = 2000;
  parameters.window = 1000.0;
  VoxelMap map(parameters);
  RandomEngine engine = make_engine(6);
  std::size_t dropped = 0;
  std::size_t added = 0;
  std::size_t memory = 0;
  for (int scan = 0; scan < 200; ++scan) {
    const Eigen::Vector3d sensor(0.5 * scan, 0, 0);
    PointCloud cloud;
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector3d offset(draw_normal(engine), draw_normal(engine), draw_normal(engine));
      cloud.push_back((sensor + 20.0 * offset).cast<float>());
    }
    const InsertReport report = map.add_scan(cloud, sensor);
    dropped += report.dropped_by_limit;
    added += report.new_voxels;
    ASSERT_LE(map.size(), 2000u);
    if (scan == 100) memory = map.memory_bytes();
  }
  EXPECT_GT(dropped, 1000u);
  EXPECT_EQ(added - dropped, map.size());
  EXPECT_LT(map.memory_bytes(), 1.5 * static_cast<double>(memory));  // places are used again
  // Every voxel that is kept can be found, and is near the last places of the sensor.
  for (const Eigen::Vector3f& point : map.points()) {
    EXPECT_LT((point.cast<double>() - Eigen::Vector3d(99.5, 0, 0)).norm(), 60.0);
    EXPECT_NE(map.find(point.cast<double>()), VoxelMap::kNone);
  }
}

TEST(VoxelMap, TraceAfterDropsEqualsAFreshMap) {
  VoxelMapParameters parameters;
  parameters.window = 30.0;
  VoxelMap moved(parameters);
  const PointCloud cloud = sampled(street(), 0.4);
  for (double x = -60.0; x <= 0.0; x += 5.0) moved.add_scan(cloud, {x, 0, 0});
  VoxelMap fresh(parameters);
  fresh.add_scan(cloud, {0, 0, 0});
  ASSERT_EQ(moved.size(), fresh.size());
  const VoxelRayTracer a(moved, {});
  const VoxelRayTracer b(fresh, {});
  RandomEngine engine = make_engine(9);
  int blocked = 0;
  int equal = 0;
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d direction = draw_sky_direction(engine, 0.1);
    const bool is_blocked = b.trace({0, 0, 1.5}, direction).blocked;
    blocked += is_blocked ? 1 : 0;
    // The drops are attended to within 1.5 m of travel, and repeated points move a mean by rounding.
    equal += a.trace({0, 0, 1.5}, direction).blocked == is_blocked ? 1 : 0;
  }
  EXPECT_GT(blocked, 100);
  EXPECT_GE(equal, 995);
}

/// Scans of a lidar that looks at a plane at y = 10 m from places along a drive. A return is at the plane with
/// probability `density`; what passes meets a wall at y = 25 m. The plane's depth is spread over `thickness_m`.
void drive_past(VoxelMap& map, double density, double thickness_m, RandomEngine& engine) {
  for (double x = -10.0; x <= 10.0; x += 0.5) {
    const Eigen::Vector3d sensor(x, 0, 1.5);
    PointCloud cloud;
    for (double azimuth = -0.9; azimuth < 0.9; azimuth += 0.012) {
      for (double elevation = -0.1; elevation < 0.35; elevation += 0.02) {
        const Eigen::Vector3d direction(std::sin(azimuth) * std::cos(elevation),
                                        std::cos(azimuth) * std::cos(elevation), std::sin(elevation));
        const double depth_m = draw_uniform(engine) < density ? 10.0 + thickness_m * draw_uniform(engine) : 25.0;
        cloud.push_back((sensor + depth_m / direction.y() * direction).cast<float>());
      }
    }
    map.add_scan(cloud, sensor);
  }
}

TEST(VoxelMap, PermeabilityTellsAHedgeFromAWall) {
  VoxelMapParameters parameters;
  parameters.ray_stride = 4;
  RandomEngine engine = make_engine(12);
  const Eigen::Vector3d up = Eigen::Vector3d(0.1, 1.0, 0.15).normalized();
  {
    VoxelMap map(parameters);
    drive_past(map, 0.3, 0.5, engine);
    const RayOutcome near = VoxelRayTracer(map, {0.0, 20.0}).trace({0, 0, 1.5}, up);
    EXPECT_FALSE(near.blocked);
    EXPECT_GT(near.vegetation_m, 0.2);
    // Behind the hedge stands a wall, which is no hedge.
    const RayOutcome far = VoxelRayTracer(map, {}).trace({0, 0, 1.5}, up);
    EXPECT_TRUE(far.blocked);
    EXPECT_NEAR(far.range_m, 25.0 / up.y(), 0.5);
    std::vector<double> shares;
    for (const Eigen::Vector3f& point : map.points_within({0, 10.2, 2.0}, 3.0)) {
      shares.push_back(map.permeability(map.find(point.cast<double>())));
    }
    std::nth_element(shares.begin(), shares.begin() + static_cast<std::ptrdiff_t>(shares.size() / 2), shares.end());
    EXPECT_NEAR(shares[shares.size() / 2], 0.7, 0.15);
  }
  {
    VoxelMap map(parameters);
    drive_past(map, 1.0, 0.05, engine);
    const RayOutcome outcome = VoxelRayTracer(map, {}).trace({0, 0, 1.5}, up);
    EXPECT_TRUE(outcome.blocked);
    EXPECT_EQ(outcome.vegetation_m, 0.0);
    for (const Eigen::Vector3f& point : map.points_within({0, 10, 2}, 4.0)) {
      EXPECT_LT(map.permeability(map.find(point.cast<double>())), 0.2);
    }
  }
}

TEST(ObservedSpace, TellsUnknownFromFree) {
  VoxelMapParameters parameters;
  parameters.ray_stride = 1;
  VoxelMap map(parameters);
  PointCloud cloud;  // a fan of rays towards +x
  for (double y = -20.0; y <= 20.0; y += 0.5) {
    for (double z = -5.0; z <= 20.0; z += 0.5) cloud.push_back(Eigen::Vector3d(40.0, y, z).cast<float>());
  }
  map.add_scan(cloud, {0.1, 0.1, 1.5});
  const auto known = [&](const Eigen::Vector3d& direction, double range_m) {
    return map.observed_space().known_fraction({0.1, 0.1, 1.5}, direction.normalized(), range_m);
  };
  EXPECT_DOUBLE_EQ(known({40, 3, 4}, 40.0), 1.0);
  EXPECT_LT(known({-1, 0, 0.2}, 40.0), 0.15);           // only the cube of the sensor itself
  EXPECT_NEAR(known({40, 0.3, 0.4}, 80.0), 0.5, 0.06);  // known up to the wall
  EXPECT_EQ(known({1, 0, 0}, 0.0), 0.0);
  EXPECT_EQ(map.observed_space().known_fraction({NAN, 0, 0}, {1, 0, 0}, 10.0), 0.0);
  EXPECT_LT(known({1, 0, 0}, 1e9), 1e-6);
  map.add_scan({}, {1000, 0, 0});
  EXPECT_EQ(map.observed_space().size(), 0u);
}

}  // namespace
}  // namespace urban_gnss
