// The cost of the occlusion test's parts on a map of more than a million points: 40 satellites traced (read it against
// 0.1 ms), one scan of 20 000 points inserted (10 ms) and aligned (60 ms), and all that becomes of a cloud of 120 000
// (100 ms, where they come at 10 Hz).
//
// What a user would take instead is measured beside it, where it is installed: PCL's octree, OctoMap, nanoflann.
//
//   occlusion_benchmark --benchmark_min_time=0.5

#include <benchmark/benchmark.h>
#include <pcl/kdtree/kdtree_flann.h>
#include <pcl/octree/octree_search.h>

#include <algorithm>
#include <cmath>
#include <vector>
#if __has_include(<octomap/octomap.h>)
#include <octomap/octomap.h>
#endif
#if __has_include(<nanoflann.hpp>)
#include <nanoflann.hpp>
#endif

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/occlusion/kd_tree_ray_tracer.hpp"
#include "urban_gnss_localization/occlusion/local_map.hpp"
#include "urban_gnss_localization/occlusion/point_grid.hpp"
#include "urban_gnss_localization/occlusion/scan_aligner.hpp"
#include "urban_gnss_localization/occlusion/voxel_map.hpp"
#include "urban_gnss_localization/occlusion/voxel_ray_tracer.hpp"

namespace urban_gnss {
namespace {

constexpr double kPitch_m = 60.0;     ///< of the street grid
constexpr double kBuilding_m = 40.0;  ///< side of each building; the streets are as wide as what remains
constexpr int kBlocks = 8;            ///< a side
constexpr double kTurn_rad = 0.3;     ///< so that no wall is along the voxels

double height_m(int column, int row) { return 15.0 + 7.0 * ((5 * column + 3 * row + 40) % 7); }

/// The walls of a grid of square buildings, in points `spacing_m` apart with 3 cm of noise.
const PointCloud& city() {
  static const PointCloud cloud = [] {
    constexpr double spacing_m = 0.5;
    RandomEngine engine = make_engine(1);
    const Eigen::Rotation2Dd turn(kTurn_rad);
    PointCloud points;
    for (int column = -kBlocks / 2; column < kBlocks / 2; ++column) {
      for (int row = -kBlocks / 2; row < kBlocks / 2; ++row) {
        const Eigen::Vector2d corner(column * kPitch_m + 10.0, row * kPitch_m + 10.0);
        for (double z = 0.0; z <= height_m(column, row); z += spacing_m) {
          for (double s = 0.0; s < kBuilding_m; s += spacing_m) {
            for (const Eigen::Vector2d& offset :
                 {Eigen::Vector2d(s, 0), Eigen::Vector2d(kBuilding_m, s), Eigen::Vector2d(kBuilding_m - s, kBuilding_m),
                  Eigen::Vector2d(0, kBuilding_m - s)}) {
              const Eigen::Vector2d place = turn * (corner + offset);
              points.emplace_back(place.x() + 0.03 * draw_normal(engine), place.y() + 0.03 * draw_normal(engine),
                                  z + 0.03 * draw_normal(engine));
            }
          }
        }
      }
    }
    return points;
  }();
  return cloud;
}

const VoxelMap& city_map() {
  static const VoxelMap map = [] {
    VoxelMapParameters parameters;
    parameters.max_voxels = 10000000;
    VoxelMap result(parameters);
    result.add_points(city());
    return result;
  }();
  return map;
}

struct Ray {
  Eigen::Vector3d origin;
  Eigen::Vector3d direction;
};

/// Rays to 40 satellites above 10 degrees, spread evenly over the sky: one epoch after the other. Either on a drive of
/// 1 m/s along a street at 10 Hz, where an epoch finds the map's part in the cache that the one before it used, or at
/// 25 places far apart, where it does not.
std::vector<Ray> rays(bool is_drive) {
  RandomEngine engine = make_engine(2);
  const Eigen::Rotation2Dd turn(kTurn_rad);
  std::vector<Eigen::Vector3d> sky;
  while (sky.size() < 40) {
    const double z = 0.17 + 0.83 * draw_uniform(engine);
    const double azimuth = 2.0 * M_PI * draw_uniform(engine);
    const double horizontal = std::sqrt(1.0 - z * z);
    sky.emplace_back(horizontal * std::cos(azimuth), horizontal * std::sin(azimuth), z);
  }
  std::vector<Ray> result;
  for (int epoch = 0; epoch < (is_drive ? 600 : 25); ++epoch) {
    const double along_m = is_drive ? -30.0 + 0.1 * epoch : 120.0 * (draw_uniform(engine) - 0.5);
    const double across_m = is_drive ? 2.0 : 14.0 * (draw_uniform(engine) - 0.5);
    const bool is_eastward = is_drive || epoch % 2 == 0;
    const Eigen::Vector2d place =
        turn * (is_eastward ? Eigen::Vector2d(along_m, across_m) : Eigen::Vector2d(across_m, along_m));
    for (const Eigen::Vector3d& direction : sky) result.push_back({{place.x(), place.y(), 1.5}, direction});
  }
  return result;
}

void trace_satellites(benchmark::State& state, const RayTracer& tracer, bool is_drive) {
  const std::vector<Ray> all = rays(is_drive);
  std::size_t next = 0;
  std::size_t blocked = 0;
  std::size_t traced = 0;
  for (auto _ : state) {
    for (int satellite = 0; satellite < 40; ++satellite, next = (next + 1) % all.size()) {
      blocked += tracer.trace(all[next].origin, all[next].direction).blocked ? 1U : 0U;
    }
    traced += 40;
  }
  state.counters["blocked"] = static_cast<double>(blocked) / static_cast<double>(traced);
  state.counters["us_per_ray"] =
      benchmark::Counter(static_cast<double>(traced) / 1e6, benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

/// The argument is 1 for the drive, 0 for places far apart.
void BM_Trace40Voxel(benchmark::State& state) {
  const VoxelRayTracer tracer(city_map(), {});
  trace_satellites(state, tracer, state.range(0) == 1);
  state.counters["points"] = static_cast<double>(city().size());
  state.counters["voxels"] = static_cast<double>(city_map().size());
  state.counters["map_MB"] = static_cast<double>(city_map().memory_bytes()) / 1e6;
}
BENCHMARK(BM_Trace40Voxel)->Arg(1)->Arg(0)->Unit(benchmark::kMicrosecond);

/// The argument tells whether the search radius grows with the range.
void BM_Trace40KdTree(benchmark::State& state) {
  KdTreeRayTracerParameters parameters;
  if (state.range(0) == 0) {
    parameters.search_radius = parameters.search_radius_max = 0.375;
    parameters.search_radius_slope = 0.0;
  }
  const KdTreeRayTracer tracer(city(), parameters);
  trace_satellites(state, tracer, true);
}
BENCHMARK(BM_Trace40KdTree)->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

pcl::PointCloud<pcl::PointXYZ>::Ptr to_pcl_cloud(const PointCloud& cloud) {
  pcl::PointCloud<pcl::PointXYZ>::Ptr result(new pcl::PointCloud<pcl::PointXYZ>);
  for (const Eigen::Vector3f& point : cloud) result->push_back({point.x(), point.y(), point.z()});
  return result;
}

/// PCL's octree at our voxel's size, up to the first voxel that the ray meets: a ray slips through a wall whose samples
/// are as far apart as voxels are wide.
class PclOctreeTracer : public RayTracer {
 public:
  PclOctreeTracer() : octree_(0.5) {
    octree_.setInputCloud(to_pcl_cloud(city()));
    octree_.addPointsFromInputCloud();
  }
  RayOutcome trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const override {
    const Eigen::Vector3d start = origin + direction;  // beyond min_range
    std::vector<pcl::PointXYZ, Eigen::aligned_allocator<pcl::PointXYZ>> centers;
    const bool is_met =
        octree_.getIntersectedVoxelCenters(start.cast<float>(), direction.cast<float>(), centers, 1) > 0;
    return {is_met, 0.0, 0.0};
  }

 private:
  pcl::octree::OctreePointCloudSearch<pcl::PointXYZ> octree_;
};

void BM_Trace40PclOctree(benchmark::State& state) {
  static const PclOctreeTracer tracer;
  trace_satellites(state, tracer, state.range(0) == 1);
}
BENCHMARK(BM_Trace40PclOctree)->Arg(1)->Arg(0)->Unit(benchmark::kMicrosecond);

#if __has_include(<octomap/octomap.h>)
/// OctoMap at our voxel's size, with the city's points as occupied, unknown space as free.
class OctoMapTracer : public RayTracer {
 public:
  OctoMapTracer() : tree_(0.5) {
    for (const Eigen::Vector3f& point : city()) tree_.updateNode(point.x(), point.y(), point.z(), true, true);
    tree_.updateInnerOccupancy();
  }
  RayOutcome trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const override {
    const auto point = [](const Eigen::Vector3d& v) {
      return octomap::point3d(static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z()));
    };
    octomap::point3d end;
    return {tree_.castRay(point(origin + direction), point(direction), end, true, 500.0), 0.0, 0.0};
  }

 private:
  octomap::OcTree tree_;
};

void BM_Trace40OctoMap(benchmark::State& state) {
  static const OctoMapTracer tracer;
  trace_satellites(state, tracer, state.range(0) == 1);
}
BENCHMARK(BM_Trace40OctoMap)->Arg(1)->Arg(0)->Unit(benchmark::kMicrosecond);
#endif

/// What a lidar of so many beams sees on a drive through the city, in the map frame.
std::vector<PointCloud> scans(std::vector<Eigen::Vector3d>& sensors, std::size_t beams = 20000, int count = 10) {
  const VoxelRayTracer tracer(city_map(), {});
  RandomEngine engine = make_engine(3);
  const Eigen::Rotation2Dd turn(kTurn_rad);
  std::vector<PointCloud> result;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d street = turn * Eigen::Vector2d(-10.0 + 1.0 * i, 2.0);
    const Eigen::Vector3d sensor(street.x(), street.y(), 1.8);
    PointCloud scan;
    while (scan.size() < beams) {
      const double elevation = -0.1 + 0.6 * draw_uniform(engine);
      const double azimuth = 2.0 * M_PI * draw_uniform(engine);
      const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                                      std::sin(elevation));
      const RayOutcome outcome = tracer.trace(sensor, direction);
      if (!outcome.blocked || outcome.range_m > 100.0) continue;
      scan.push_back((sensor + (outcome.range_m + 0.02 * draw_normal(engine)) * direction).cast<float>());
    }
    result.push_back(scan);
    sensors.push_back(sensor);
  }
  return result;
}

/// Moves three points in ten of a scan to things that stand about the sensor.
void clutter(PointCloud& scan, const Eigen::Vector3d& sensor) {
  RandomEngine engine = make_engine(5);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    if (i % 10 >= 3) continue;
    const Eigen::Vector3d direction = (scan[i].cast<double>() - sensor).normalized();
    scan[i] = (sensor + (3.0 + 7.0 * draw_uniform(engine)) * direction).cast<float>();
  }
}

/// The argument tells whether the map holds the city already.
void BM_InsertScan20k(benchmark::State& state) {
  std::vector<Eigen::Vector3d> sensors;
  const std::vector<PointCloud> all = scans(sensors);
  VoxelMapParameters parameters;
  parameters.max_voxels = 10000000;
  parameters.window = 1000.0;
  VoxelMap map(parameters);
  if (state.range(0) == 1) map.add_points(city());
  std::size_t next = 0;
  for (auto _ : state) {
    if (state.range(0) == 0 && next == 0) map.clear();
    benchmark::DoNotOptimize(map.add_scan(all[next], sensors[next]));
    next = (next + 1) % all.size();
  }
  state.counters["voxels"] = static_cast<double>(map.size());
}
BENCHMARK(BM_InsertScan20k)->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

constexpr AlignmentMethod kMethods[] = {AlignmentMethod::kRobust, AlignmentMethod::kPclIcp};

ScanAlignerParameters by(AlignmentMethod method) {
  ScanAlignerParameters parameters;
  parameters.alignment_method = method;
  return parameters;
}

/// Everything that a keyframe's alignment costs: the map about it, the voxel filter, tree and iterations. The first
/// argument is the method. The second: 0 is a good guess (0.36 m and 0.3 degrees off), 1 a poor one (1.4 m and 4.6
/// degrees), 2 a good one with three points in ten on things that are not in the map.
void BM_AlignScan20k(benchmark::State& state) {
  const ScanAlignerParameters parameters = by(kMethods[state.range(0)]);
  std::vector<Eigen::Vector3d> sensors;
  std::vector<PointCloud> all = scans(sensors);
  const bool is_poor = state.range(1) == 1;
  if (state.range(1) == 2) {
    for (std::size_t i = 0; i < all.size(); ++i) clutter(all[i], sensors[i]);
  }
  std::size_t next = 0;
  std::size_t accepted = 0;
  std::size_t wrong = 0;
  double points = 0.0;
  double error_m = 0.0;
  for (auto _ : state) {
    // About the sensor: a scan is in the map frame already, so that the right pose is the identity.
    const Eigen::Translation3d place(sensors[next]);
    const Eigen::Isometry3d guess =
        Eigen::Translation3d(is_poor ? Eigen::Vector3d(1.2, -0.7, 0.0) : Eigen::Vector3d(0.3, -0.2, 0.0)) * place *
        Eigen::AngleAxisd(is_poor ? 0.08 : 0.005, Eigen::Vector3d::UnitZ()) * place.inverse();
    const PointCloud nearby = city_map().points_within(sensors[next], 60.0);
    points = static_cast<double>(nearby.size());
    const Alignment alignment = ScanAligner(nearby, parameters).align(voxel_filtered(all[next], 0.5), guess);
    if (alignment.is_accepted()) {
      const double off_m = (alignment.pose * sensors[next] - sensors[next]).norm();
      ++accepted;
      error_m += off_m;
      wrong += off_m > 0.2 ? 1U : 0U;
    }
    next = (next + 1) % all.size();
  }
  const auto count = static_cast<double>(state.iterations());
  state.counters["map_points"] = points;
  state.counters["accepted"] = static_cast<double>(accepted) / count;
  state.counters["wrong"] = static_cast<double>(wrong) / count;
  state.counters["error_m"] = error_m / static_cast<double>(std::max<std::size_t>(1, accepted));
}
BENCHMARK(BM_AlignScan20k)
    ->Args({0, 0})
    ->Args({0, 1})
    ->Args({0, 2})
    ->Args({1, 0})
    ->Args({1, 1})
    ->Args({1, 2})
    ->Unit(benchmark::kMillisecond);

/// A search made for the points of the map about a scan, and asked for the nearest one to each of 1500 of its points 15
/// times over, as an alignment does.
template <class Search>
void search_nearest(benchmark::State& state) {
  std::vector<Eigen::Vector3d> sensors;
  const PointCloud scan = scans(sensors, 1500, 1).front();
  const PointCloud nearby = city_map().points_within(sensors.front(), 60.0);
  double sum_m2 = 0.0;
  for (auto _ : state) {
    const Search search(nearby);
    for (int i = 0; i < 15; ++i) {
      const Eigen::Vector3f shift(0.3F - 0.02F * static_cast<float>(i), 0.0F, 0.0F);
      for (const Eigen::Vector3f& point : scan) sum_m2 += search.nearest_m2(point + shift);
    }
  }
  state.counters["map_points"] = static_cast<double>(nearby.size());
  state.counters["mean_m2"] = sum_m2 / (15.0 * 1500.0 * static_cast<double>(state.iterations()));
}

struct GridSearch {
  explicit GridSearch(const PointCloud& cloud) : grid(cloud, 0.8) {}
  double nearest_m2(const Eigen::Vector3f& place) const {
    PointGrid::Neighbour found{};
    return grid.nearest(place, 2.0, found) ? static_cast<double>(found.squared_m2) : 4.0;
  }
  PointGrid grid;
};
BENCHMARK_TEMPLATE(search_nearest, GridSearch)->Name("BM_NearestOurGrid")->Unit(benchmark::kMillisecond);

struct PclSearch {
  explicit PclSearch(const PointCloud& cloud) { tree.setInputCloud(to_pcl_cloud(cloud)); }
  double nearest_m2(const Eigen::Vector3f& place) const {
    tree.nearestKSearch({place.x(), place.y(), place.z()}, 1, indices, squared_m2);
    return std::min(4.0, static_cast<double>(squared_m2[0]));
  }
  pcl::KdTreeFLANN<pcl::PointXYZ> tree;
  mutable std::vector<int> indices{0};
  mutable std::vector<float> squared_m2{0.0F};
};
BENCHMARK_TEMPLATE(search_nearest, PclSearch)->Name("BM_NearestPclKdTree")->Unit(benchmark::kMillisecond);

#if __has_include(<nanoflann.hpp>)
struct NanoflannSearch {
  struct Points {
    const PointCloud& cloud;
    std::size_t kdtree_get_point_count() const { return cloud.size(); }
    float kdtree_get_pt(std::size_t point, std::size_t axis) const {
      return cloud[point][static_cast<Eigen::Index>(axis)];
    }
    template <class Box>
    bool kdtree_get_bbox(Box&) const {
      return false;
    }
  };
  explicit NanoflannSearch(const PointCloud& cloud) : points{cloud}, tree(3, points) { tree.buildIndex(); }
  double nearest_m2(const Eigen::Vector3f& place) const {
    std::size_t index = 0;
    float squared_m2 = 0.0F;
    nanoflann::KNNResultSet<float> found(1);
    found.init(&index, &squared_m2);
    tree.findNeighbors(found, place.data(), nanoflann::SearchParams());
    return std::min(4.0, static_cast<double>(squared_m2));
  }
  Points points;
  nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Points>, Points, 3> tree;
};
BENCHMARK_TEMPLATE(search_nearest, NanoflannSearch)->Name("BM_NearestNanoflann")->Unit(benchmark::kMillisecond);
#endif

/// A map built on a drive of 60 m behind odometry that drifts by 5 % of the way to the left and 0.3 degrees a metre:
/// how far the map's pose is off at the end, and how many alignments were refused.
void BM_DriftOfTheMap(benchmark::State& state) {
  std::vector<Eigen::Vector3d> sensors;
  const std::vector<PointCloud> all = scans(sensors, 5000, 60);
  const auto sensor_in_base = Eigen::Isometry3d(Eigen::Translation3d(0.0, 0.0, 1.8));
  double error_m = 0.0;
  double refused = 0.0;
  for (auto _ : state) {
    LocalMap map({}, {}, by(kMethods[state.range(0)]));
    refused = 0.0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      const Eigen::Isometry3d base(Eigen::Translation3d(sensors[i] - sensor_in_base.translation()));
      const auto way = static_cast<double>(i);
      const Eigen::Isometry3d odometry =
          base * Eigen::Translation3d(0.0, 0.05 * way, 0.0) * Eigen::AngleAxisd(0.005 * way, Eigen::Vector3d::UnitZ());
      const PointCloud scan = transformed(all[i], (base * sensor_in_base).inverse());
      const ScanReport report = map.add_scan(scan, sensor_in_base, odometry);
      if (i > 0 && !report.alignment.is_accepted()) ++refused;
      error_m = (report.base_in_map.translation() - base.translation()).norm();
    }
  }
  state.counters["error_m"] = error_m;
  state.counters["refused"] = refused;
}
BENCHMARK(BM_DriftOfTheMap)->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

/// All that the core does with a cloud of a large lidar: cut, aligned if the argument is 1 (a keyframe), inserted.
/// Every tenth cloud is a keyframe at 10 Hz and 1 m/s, every cloud at 10 m/s.
void BM_AddCloud120k(benchmark::State& state) {
  static std::vector<Eigen::Vector3d> sensors;
  static const std::vector<PointCloud> scans_once = scans(sensors, 120000, 3);
  std::vector<PointCloud> all = scans_once;
  const auto sensor_in_base = Eigen::Isometry3d(Eigen::Translation3d(0.0, 0.0, 1.8));
  LocalMapParameters parameters;
  parameters.keyframe_distance = state.range(0) == 1 ? 1e-3 : 1e6;
  VoxelMapParameters voxels;
  voxels.window = 1000.0;
  LocalMap map(parameters, voxels, {});
  std::vector<Eigen::Isometry3d> bases;
  for (std::size_t i = 0; i < all.size(); ++i) {
    bases.emplace_back(Eigen::Translation3d(sensors[i] - sensor_in_base.translation()));
    all[i] = transformed(all[i], (bases[i] * sensor_in_base).inverse());
    map.add_scan(all[i], sensor_in_base, bases[i]);
  }
  std::size_t next = 0;
  std::size_t aligned = 0;
  for (auto _ : state) {
    aligned += map.add_scan(all[next], sensor_in_base, bases[next]).alignment.is_accepted() ? 1U : 0U;
    next = (next + 1) % all.size();
  }
  state.counters["aligned"] = static_cast<double>(aligned) / static_cast<double>(state.iterations());
  state.counters["voxels"] = static_cast<double>(map.map().size());
}
BENCHMARK(BM_AddCloud120k)->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace urban_gnss
