// The cost of the UKF's two steps, against the interval of the odometry (5 ms at 200 Hz).
//
//   ukf_benchmark --benchmark_min_time=0.5

#include <benchmark/benchmark.h>

#include "urban_gnss_localization/localizers/maier/ukf.hpp"

namespace urban_gnss {
namespace {

constexpr Twist2 kTwist{1.5, 0.2};
constexpr double kStep_s = 0.005;

Ukf started() {
  Ukf ukf{UkfParameters(), MotionParameters()};
  PoseEstimate start;
  start.covariance = Eigen::Vector3d(1.0, 1.0, 0.01).asDiagonal();
  ukf.initialize(start);
  return ukf;
}

void BM_UkfMove(benchmark::State& state) {
  Ukf ukf = started();
  for (auto _ : state) {
    ukf.move(kTwist, kStep_s);
    benchmark::DoNotOptimize(ukf.pose());
  }
}
BENCHMARK(BM_UkfMove);

void BM_UkfCorrect(benchmark::State& state) {
  Ukf ukf = started();
  FixMeasurement fix;
  fix.covariance = 9.0 * Eigen::Matrix2d::Identity();
  fix.antenna_in_body = {0.3, 0.0};
  for (auto _ : state) {
    fix.time_s += 1.0;
    benchmark::DoNotOptimize(ukf.correct(fix));
  }
}
BENCHMARK(BM_UkfCorrect);

}  // namespace
}  // namespace urban_gnss
