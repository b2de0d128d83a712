#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <vector>

#include "receiver_rig.hpp"
#include "urban_gnss_localization/simulation/constellation.hpp"
#include "urban_gnss_localization/simulation/receiver.hpp"

namespace urban_gnss {
namespace {

/// Drives of 10 min at 10 m/s through a downtown of blocks of 80 m x 60 m, or none, under the sky of Hong Kong.
struct Drive {
  std::vector<double> errors_m;
  std::vector<double> correlation_times_s;
  std::map<PathClass, std::vector<double>> range_errors_m;
  std::map<PathClass, std::vector<double>> cn0_dbhz;
  int without_fix{0};
};

World downtown(RandomEngine& engine, double street_m) {
  World world;
  for (int i = 0; i < 7; ++i) {
    for (int j = 0; j < 7; ++j) {
      if (draw_uniform(engine) < 0.08) continue;  // a square
      for (int part = 0; part < 4; ++part) {
        const double x = i * (80.0 + street_m) + part % 2 * 40.0;
        const double y = j * (60.0 + street_m) + part / 2 * 30.0;
        Building building;
        building.footprint = {{x, y}, {x + 40.0, y}, {x + 40.0, y + 30.0}, {x, y + 30.0}};
        building.roof_m = 30.0 + 30.0 * draw_uniform(engine);
        building.reflection_loss_db = 4.0;  // facades of glass and concrete
        world.buildings.push_back(building);
      }
    }
  }
  return world;
}

/// Lag at which the autocorrelation falls below 1/e.
double correlation_time_s(const std::vector<Eigen::Vector2d>& errors) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& error : errors) mean += error / static_cast<double>(errors.size());
  const auto correlation = [&](std::size_t lag) {
    double sum = 0.0;
    for (std::size_t i = 0; i + lag < errors.size(); ++i) sum += (errors[i] - mean).dot(errors[i + lag] - mean);
    return sum / static_cast<double>(errors.size() - lag);
  };
  std::size_t lag = 1;
  while (lag + 1 < errors.size() && correlation(lag) > correlation(0) / std::exp(1.0)) ++lag;
  return static_cast<double>(lag) * kEpoch;
}

void drive(std::uint64_t seed, bool is_downtown, Drive& result) {
  RandomEngine engine = make_engine(20131107, seed);
  const double street_m = 17.0 + 3.0 * draw_uniform(engine);
  const World world = is_downtown ? downtown(engine, street_m) : World{};
  const WallIndex index(world);
  SignalTracer tracer(world, index, SignalParameters{});
  Receiver receiver(ReceiverParameters{}, seed);
  const Stamp start = from_seconds(1.7e9 + 7000.0 * static_cast<double>(seed));
  const Sky sky(SkyParameters{}, {22.3, 114.17, 10.0}, start);

  const Eigen::Vector2d corner(80.0 + 0.7 * street_m, 60.0 + 0.3 * street_m);
  const Eigen::Vector2d size(4.0 * (80.0 + street_m), 4.0 * (60.0 + street_m));
  const double sides_m[] = {size.x(), size.y(), size.x(), size.y()};
  const Eigen::Vector2d directions[] = {{1.0, 0.0}, {0.0, 1.0}, {-1.0, 0.0}, {0.0, -1.0}};
  std::vector<VisibleSatellite> visible;
  std::vector<ReceivedSatellite> received;
  std::vector<Eigen::Vector2d> errors;
  for (int i = 0; i < 3000; ++i) {
    double way_m = std::fmod(10.0 * kEpoch * i, 2.0 * size.sum());
    Eigen::Vector2d place = corner;
    int side = 0;
    for (; way_m > sides_m[side]; ++side) {
      place += sides_m[side] * directions[side];
      way_m -= sides_m[side];
    }
    place += way_m * directions[side];
    const Eigen::Vector3d antenna(place.x(), place.y(), 1.8);
    const Eigen::Vector3d velocity(10.0 * directions[side].x(), 10.0 * directions[side].y(), 0.0);
    sky.above_horizon(start + from_seconds(kEpoch * i), visible);
    received.resize(visible.size());
    for (std::size_t k = 0; k < visible.size(); ++k) {
      received[k].id = visible[k].id;
      received[k].look = visible[k].look;
      received[k].line_of_sight = line_of_sight(visible[k].look);
      tracer.trace(antenna, received[k].line_of_sight, received[k].paths);
    }
    const ReceiverEpoch epoch = receiver.epoch(kEpoch, antenna, velocity, received);
    for (const SatelliteReport& report : epoch.satellites) {
      if (!report.is_tracked) continue;
      result.range_errors_m[report.path_class].push_back(report.range_error_m);
      result.cn0_dbhz[report.path_class].push_back(report.cn0_dbhz);
    }
    if (i < 50) continue;  // the start
    if (!epoch.fix) {
      ++result.without_fix;
      continue;
    }
    errors.push_back((epoch.fix->position - antenna).head<2>());
    result.errors_m.push_back(errors.back().norm());
  }
  result.correlation_times_s.push_back(correlation_time_s(errors));
}

TEST(ReceiverInTheCity, ErrorsAreThoseOfRealReceivers) {
  Drive result;
  for (std::uint64_t seed = 0; seed < 4; ++seed) drive(seed, true, result);
  const double median = quantile(result.errors_m, 0.5);
  const double most = quantile(result.errors_m, 0.95);
  EXPECT_GT(median, 5.0);
  EXPECT_LT(median, 20.0);
  EXPECT_GT(most, 20.0);
  EXPECT_LT(most, 60.0);
  EXPECT_GT(quantile(result.correlation_times_s, 0.0), 5.0);
  EXPECT_LT(quantile(result.correlation_times_s, 1.0), 40.0);
  EXPECT_LT(result.without_fix, 0.1 * 4 * 2950);
  const double nlos_m = quantile(result.range_errors_m[PathClass::kNlos], 0.5);
  EXPECT_GT(nlos_m, 15.0);
  EXPECT_LT(nlos_m, 40.0);
  EXPECT_LT(std::abs(quantile(result.range_errors_m[PathClass::kDirect], 0.5)), 2.5);
  EXPECT_LT(quantile(result.cn0_dbhz[PathClass::kNlos], 0.5) + 5.0, quantile(result.cn0_dbhz[PathClass::kDirect], 0.5));
  RecordProperty("median_mm", static_cast<int>(1e3 * median));
  RecordProperty("quantile_95_mm", static_cast<int>(1e3 * most));
  RecordProperty("nlos_median_mm", static_cast<int>(1e3 * nlos_m));
}

TEST(ReceiverInTheOpen, MedianErrorIsUnderThreeMetres) {
  Drive result;
  drive(1, false, result);
  EXPECT_LT(quantile(result.errors_m, 0.5), 3.0);
  EXPECT_GT(quantile(result.errors_m, 0.5), 0.2);
  EXPECT_EQ(result.without_fix, 0);
  EXPECT_TRUE(result.range_errors_m[PathClass::kNlos].empty());
}

}  // namespace
}  // namespace urban_gnss
