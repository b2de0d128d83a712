// The cost of the interacting models' two steps, and of a fix solved from its ranges, against the interval of the
// odometry (5 ms at 200 Hz).
//
//   imm_ekf_benchmark --benchmark_min_time=0.5

#include <benchmark/benchmark.h>

#include <vector>

#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"
#include "urban_gnss_localization/gnss/range_fix.hpp"

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

/// A sky of `count` satellites in three constellations, every fourth of them reflected.
std::vector<SatelliteObservation> sky(int count) {
  const Constellation constellations[] = {Constellation::kGps, Constellation::kGalileo, Constellation::kGlonass};
  std::vector<SatelliteObservation> satellites;
  for (int i = 0; i < count; ++i) {
    SatelliteObservation satellite;
    satellite.id = {constellations[i % 3], i + 1};
    satellite.look = {2.4 * i, 0.2 + 0.035 * (7 * i % 30)};  // the golden angle
    const bool is_reflected = i % 4 == 3;
    satellite.cn0_dbhz = is_reflected ? 28.0 : 44.0;
    satellite.residual_m = -3.0 * line_of_sight(satellite.look).x() + (is_reflected ? 25.0 : 0.5 * (i % 5));
    satellites.push_back(satellite);
  }
  return satellites;
}

void BM_RangeFix(benchmark::State& state) {
  const auto satellites = sky(static_cast<int>(state.range(0)));
  const RelativePlace known{{2.0, 1.0}, 4.0 * Eigen::Matrix2d::Identity()};
  for (auto _ : state) benchmark::DoNotOptimize(range_fix(satellites, 44.0, known, {}));
}
BENCHMARK(BM_RangeFix)->Arg(12)->Arg(40);

void BM_ImmEkfCorrectWithRanges(benchmark::State& state) {
  ImmEkf imm = started();
  FixMeasurement fix;
  fix.covariance = 9.0 * Eigen::Matrix2d::Identity();
  fix.satellites = sky(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    fix.time_s += 1.0;
    benchmark::DoNotOptimize(imm.correct(fix));
  }
}
BENCHMARK(BM_ImmEkfCorrectWithRanges)->Arg(12)->Arg(40);

}  // namespace
}  // namespace urban_gnss
