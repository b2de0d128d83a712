// The cost of the complementary filter: one prediction (each odometry message) and one correction (each fix).
//
//   complementary_ekf_benchmark --benchmark_min_time=0.5

#include <benchmark/benchmark.h>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/localizers/kim/complementary_ekf.hpp"

namespace urban_gnss {
namespace {

constexpr double kStep_s = 0.005;

void BM_Predict(benchmark::State& state) {
  ComplementaryEkf filter{ComplementaryEkfParameters()};
  for (auto _ : state) {
    filter.move({1.5, 0.1}, kStep_s);
    benchmark::DoNotOptimize(filter.pose());
  }
}
BENCHMARK(BM_Predict);

/// Argument 0: good fixes. 1: a bias that the second stage estimates; it changes its sign every 100 fixes.
void BM_Correct(benchmark::State& state) {
  ComplementaryEkfParameters parameters;
  parameters.lockout_policy = LockoutPolicy::kDeadReckoning;
  ComplementaryEkf filter(parameters);
  PoseEstimate start;
  start.covariance.diagonal() << 1.0, 1.0, 0.01;
  filter.initialize(start);
  RandomEngine engine = make_engine(1);
  FixMeasurement fix;
  std::size_t open = 0;
  std::vector<Eigen::Vector2d> noise(1024);
  for (Eigen::Vector2d& each : noise) each = {draw_normal(engine), draw_normal(engine)};
  std::size_t k = 0;
  for (auto _ : state) {
    ++k;
    fix.time_s += 1.0;
    fix.position = noise[k % noise.size()];
    if (state.range(0) == 1) fix.position.x() += k % 200 < 100 ? 15.0 : -15.0;
    benchmark::DoNotOptimize(filter.correct(fix));
    open += filter.is_bias_open();
    if (k % 500 == 0) filter.take_bias_estimates();
  }
  state.SetLabel(state.range(0) == 1 ? "biased" : "direct");
  state.counters["share_open"] = static_cast<double>(open) / static_cast<double>(k);
}
BENCHMARK(BM_Correct)->Arg(0)->Arg(1);

}  // namespace
}  // namespace urban_gnss
