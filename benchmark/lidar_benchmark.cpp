// The cost of one scan of the simulated lidars in a city of 100 buildings. Read the spinning one against its period of
// 100 ms: half a core is 50 ms. A rotating scanner's half turn takes 2 s.
//
//   lidar_benchmark --benchmark_min_time=0.5

#include <benchmark/benchmark.h>

#include "urban_gnss_localization/simulation/lidar.hpp"

namespace urban_gnss {
namespace {

/// Ten by ten blocks of 40 m between streets of 20 m, their roofs from 8 to 60 m, a tree every 12 m along one side.
World city() {
  RandomEngine engine = make_engine(1);
  World world;
  for (int row = 0; row < 10; ++row) {
    for (int column = 0; column < 10; ++column) {
      const Eigen::Vector2d corner(60.0 * column + 10.0, 60.0 * row + 10.0);
      Building building;
      building.footprint = {corner, corner + Eigen::Vector2d(40.0, 0.0), corner + Eigen::Vector2d(40.0, 40.0),
                            corner + Eigen::Vector2d(0.0, 40.0)};
      building.roof_m = 8.0 + 52.0 * draw_uniform(engine);
      world.buildings.push_back(building);
      for (int i = 0; i < 4; ++i) {
        Tree tree;
        tree.position = corner + Eigen::Vector2d(12.0 * i, -4.0);
        world.trees.push_back(tree);
      }
    }
  }
  return world;
}

std::vector<Car> traffic() {
  std::vector<Car> cars;
  for (int i = 0; i < 20; ++i) {
    CarParameters car;
    car.loop = {{240.0, 240.0}, {360.0, 240.0}, {360.0, 360.0}, {240.0, 360.0}};
    car.phase_m = 24.0 * i;
    cars.emplace_back(car);
  }
  return cars;
}

void BM_Scan(benchmark::State& state) {
  const World world = city();
  const WallIndex index(world);
  const std::vector<Car> cars = traffic();
  LidarParameters parameters;
  parameters.type = static_cast<LidarType>(state.range(0));
  Lidar lidar(parameters, world, index, 1);
  LidarScan scan;
  double time_s = 0.0;
  for (auto _ : state) {
    lidar.scan({241.0 + 5.0 * time_s, 302.0, 0.1}, time_s, cars, scan);
    time_s = time_s < 20.0 ? time_s + 0.1 : 0.0;
    benchmark::DoNotOptimize(scan.x.data());
  }
  state.SetLabel(enum_name(parameters.type));
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(lidar.ray_count()));
  state.counters["points"] = static_cast<double>(scan.size());
}
BENCHMARK(BM_Scan)
    ->Arg(static_cast<int>(LidarType::kSpinning))
    ->Arg(static_cast<int>(LidarType::kRotating2d))
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace urban_gnss
