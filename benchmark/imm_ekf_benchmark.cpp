// The cost of the interacting models' two steps, against the interval of the odometry (5 ms at 200 Hz).
//
//   imm_ekf_benchmark --benchmark_min_time=0.5

#include <benchmark/benchmark.h>

#include "urban_gnss_localization/filters/imm_ekf.hpp"

namespace urban_gnss {
namespace {

constexpr Twist2 kTwist{1.5, 0.2};
constexpr double kStep_s = 0.005;

ImmEkf started() {
  ImmEkf imm{ImmEkfParameters(), MotionParameters()};
  PoseEstimate start;
  start.covariance = Eigen::Vector3d(1.0, 1.0, 0.01).asDiagonal();
  imm.initialize(start);
  return imm;
}

void BM_ImmEkfMove(benchmark::State& state) {
  ImmEkf imm = started();
  for (auto _ : state) {
    imm.move(kTwist, kStep_s);
    benchmark::DoNotOptimize(imm.pose());
  }
}
BENCHMARK(BM_ImmEkfMove);

void BM_ImmEkfCorrect(benchmark::State& state) {
  ImmEkf imm = started();
  FixMeasurement fix;
  fix.covariance = 9.0 * Eigen::Matrix2d::Identity();
  fix.antenna_in_body = {0.3, 0.0};
  for (auto _ : state) {
    fix.time_s += 1.0;
    benchmark::DoNotOptimize(imm.correct(fix));
  }
}
BENCHMARK(BM_ImmEkfCorrect);

}  // namespace
}  // namespace urban_gnss
