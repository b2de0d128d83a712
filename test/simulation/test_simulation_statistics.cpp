#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "matchers.hpp"
#include "urban_gnss_localization/simulation/simulation_statistics.hpp"

namespace urban_gnss {
namespace {

using Series = std::vector<std::optional<Eigen::Vector2d>>;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// x_k = a x_{k-1} + noise with the time constant `time_s`: its autocorrelation is exp(-lag / time_s).
Series ar1(std::size_t count, double interval_s, double time_s, std::uint64_t seed) {
  auto engine = make_engine(seed);
  const double a = std::exp(-interval_s / time_s);
  const double sigma = std::sqrt(1.0 - a * a);
  Eigen::Vector2d x(draw_normal(engine), draw_normal(engine));
  Series series;
  for (std::size_t i = 0; i < count; ++i) {
    series.emplace_back(x);
    const double east = draw_normal(engine);
    const double north = draw_normal(engine);
    x = a * x + sigma * Eigen::Vector2d(east, north);
  }
  return series;
}

// The variance of an estimated autocorrelation of AR(1), by Bartlett's formula, is at most (1 + a^2)/(1 - a^2)/N =
// time/(interval N) for long times; both axes halve it. At 1/e the slope is -1/(e time), so that the lag has a sigma of
// e time sqrt(time/(2 duration)): here 2.7 %, of which 4 are allowed.
TEST(CorrelationTime, IsTheTimeConstantOfAnAr1Series) {
  for (const double time_s : {2.0, 10.0}) {
    const std::size_t count = static_cast<std::size_t>(5000.0 * time_s / 0.2);
    const double sigma_s = std::exp(1.0) * time_s * std::sqrt(1.0 / (2.0 * 5000.0));
    EXPECT_NEAR(correlation_time(ar1(count, 0.2, time_s, 1), 0.2), time_s, 4.0 * sigma_s);
  }
}

TEST(CorrelationTime, GapsDoNotCount) {
  Series series = ar1(20000, 0.2, 4.0, 2);
  const double whole_s = correlation_time(series, 0.2);
  for (std::size_t i = 0; i < series.size(); ++i) {
    if (i % 100 < 20) series[i].reset();
  }
  EXPECT_NEAR(correlation_time(series, 0.2), whole_s, 0.1 * whole_s);
}

TEST(CorrelationTime, ScalesWithTheIntervalAndNotWithSizeOrMean) {
  Series series = ar1(5000, 0.2, 4.0, 3);
  const double time_s = correlation_time(series, 0.2);
  EXPECT_NEAR(correlation_time(series, 0.4), 2.0 * time_s, 1e-9);
  for (auto& value : series) value = 7.0 * *value + Eigen::Vector2d(100.0, -50.0);
  EXPECT_NEAR(correlation_time(series, 0.2), time_s, 1e-6);
}

// Four values with mean zero: the covariance at lag 1 is 1/3 of what it is at lag 0, then by hand.
TEST(CorrelationTime, IsInterpolatedBetweenLags) {
  Series series;
  for (const double x : {1.0, 1.0, -1.0, -1.0}) series.emplace_back(Eigen::Vector2d(x, 0.0));
  // Lag 1: (1 - 1 + 1)/3 = 1/3 < 1/e; from 1 at lag 0 to 1/3 at lag 1.
  EXPECT_NEAR(correlation_time(series, 2.0), 2.0 * (1.0 - std::exp(-1.0)) / (1.0 - 1.0 / 3.0), 1e-12);
}

TEST(CorrelationTime, IsUnknownWhereThereIsTooLittle) {
  EXPECT_TRUE(std::isnan(correlation_time({}, 0.2)));
  EXPECT_TRUE(std::isnan(correlation_time({Eigen::Vector2d(1.0, 2.0)}, 0.2)));
  EXPECT_TRUE(std::isnan(correlation_time(Series(50), 0.2))) << "gaps alone";
  EXPECT_TRUE(std::isnan(correlation_time(Series(50, Eigen::Vector2d(1.0, 2.0)), 0.2))) << "a constant";
  Series one(50);
  one[3] = Eigen::Vector2d(1.0, 2.0);
  EXPECT_TRUE(std::isnan(correlation_time(one, 0.2)));
}

/// An epoch of 5 Hz as the simulator gives it: fix, what is wrong with it, signals.
class Epochs {
 public:
  void add_fix(const Eigen::Vector2d& error, double claimed_sigma_m, int used, int publisher = 0) {
    const Stamp stamp = stamp_;
    FixEvent fix;
    fix.published.publisher = publisher;
    fix.published.fix.covariance = std::pow(claimed_sigma_m, 2) * Eigen::Matrix3d::Identity();
    fix.used_count = used;
    statistics.add({stamp, stamp + Stamp(1000), fix});
    if (publisher != 0) return;
    FixTruthEvent truth;
    truth.error << error, 99.0;
    statistics.add({stamp, stamp + Stamp(1000), truth});
    stamp_ += from_seconds(0.2);
  }
  void add_gap() {
    FixEvent fix;
    fix.published.has_fix = false;
    statistics.add({stamp_, stamp_, fix});
    stamp_ += from_seconds(0.2);
  }
  void add_signals(const std::vector<SatelliteReport>& reports) {
    SignalsEvent signals;
    for (const SatelliteReport& report : reports) {
      SignalTruth truth;
      truth.report = report;
      signals.signals.push_back(truth);
    }
    statistics.add({stamp_, stamp_, signals});
  }

  SimulationStatistics statistics;

 private:
  Stamp stamp_{from_seconds(1000.0)};
};

SatelliteReport report(PathClass path_class, double range_error_m, double cn0_dbhz) {
  SatelliteReport report;
  report.path_class = path_class;
  report.is_tracked = path_class != PathClass::kBlocked;
  report.range_error_m = report.is_tracked ? range_error_m : kNaN;
  report.cn0_dbhz = report.is_tracked ? cn0_dbhz : kNaN;
  return report;
}

TEST(SimulationStatistics, SummaryOfFixesByHand) {
  Epochs epochs;
  epochs.add_fix({3.0, 4.0}, 2.0, 8);
  epochs.add_gap();
  epochs.add_fix({0.0, -1.0}, 1.0, 6);
  epochs.add_fix({0.0, 0.0}, 1.0, 5, 1);  // a second publisher is not the receiver
  epochs.add_fix({-2.0, 0.0}, 4.0, 10);
  const ReceiverSummary summary = epochs.statistics.summary();
  EXPECT_EQ(summary.epochs, 4u);
  EXPECT_DOUBLE_EQ(summary.availability, 0.75);
  EXPECT_EQ(summary.error_m.count, 3u);
  EXPECT_DOUBLE_EQ(summary.error_m.median, 2.0);
  EXPECT_DOUBLE_EQ(summary.error_m.max, 5.0) << "horizontal";
  EXPECT_DOUBLE_EQ(summary.error_m.rmse, std::sqrt((25.0 + 1.0 + 4.0) / 3.0));
  EXPECT_DOUBLE_EQ(summary.claimed_sigma_m.median, 2.0);
  EXPECT_DOUBLE_EQ(summary.nees_mean, (25.0 / 4.0 + 1.0 / 1.0 + 4.0 / 16.0) / 3.0);
  EXPECT_DOUBLE_EQ(summary.used_mean, 8.0);
}

TEST(SimulationStatistics, NanFixIsNoFix) {
  Epochs epochs;
  epochs.add_fix({1.0, 0.0}, 1.0, 8);
  FixEvent nan;
  nan.published.fix.position.setConstant(kNaN);  // the simulator gives no truth for it
  epochs.statistics.add({from_seconds(2000.0), from_seconds(2000.1), nan});
  FixTruthEvent late;  // of an epoch that is not the last
  late.error << 50.0, 0.0, 0.0;
  epochs.statistics.add({from_seconds(1000.0), from_seconds(2000.2), late});
  const ReceiverSummary summary = epochs.statistics.summary();
  EXPECT_DOUBLE_EQ(summary.availability, 0.5);
  EXPECT_DOUBLE_EQ(summary.error_m.max, 1.0);
}

TEST(SimulationStatistics, SummaryOfPathClassesByHand) {
  Epochs epochs;
  epochs.add_signals({report(PathClass::kDirect, 1.0, 45.0), report(PathClass::kNlos, 30.0, 30.0),
                      report(PathClass::kBlocked, 0.0, 0.0)});
  epochs.add_signals({report(PathClass::kDirect, -3.0, 43.0), report(PathClass::kNlos, 50.0, 26.0),
                      report(PathClass::kDirect, -1.0, 44.0)});
  const ReceiverSummary summary = epochs.statistics.summary();
  const auto& direct = summary.classes[static_cast<std::size_t>(PathClass::kDirect)];
  EXPECT_EQ(direct.path_class, PathClass::kDirect);
  EXPECT_EQ(direct.count, 3u);
  EXPECT_DOUBLE_EQ(direct.range_error_m.median, -1.0);
  EXPECT_DOUBLE_EQ(direct.absolute_range_error_m.median, 1.0);
  EXPECT_DOUBLE_EQ(direct.absolute_range_error_m.max, 3.0);
  EXPECT_DOUBLE_EQ(direct.cn0_dbhz.median, 44.0);
  const auto& nlos = summary.classes[static_cast<std::size_t>(PathClass::kNlos)];
  EXPECT_EQ(nlos.count, 2u);
  EXPECT_DOUBLE_EQ(nlos.range_error_m.mean, 40.0);
  const auto& blocked = summary.classes[static_cast<std::size_t>(PathClass::kBlocked)];
  EXPECT_EQ(blocked.count, 1u);
  EXPECT_EQ(blocked.range_error_m.count, 0u);
  EXPECT_EQ(summary.classes[static_cast<std::size_t>(PathClass::kMultipath)].count, 0u);
}

TEST(SimulationStatistics, CorrelationTimeKnowsTheIntervalOfTheEpochs) {
  Epochs epochs;
  const Series series = ar1(3000, 0.2, 4.0, 4);
  for (const auto& error : series) epochs.add_fix(*error, 1.0, 8);
  EXPECT_NEAR(epochs.statistics.summary().correlation_time_s, correlation_time(series, 0.2), 1e-6);
  EXPECT_NEAR(epochs.statistics.summary().nees_mean, 2.0, 0.6) << "an honest claim";
}

TEST(SimulationStatistics, NothingIsNullInJson) {
  const ReceiverSummary nothing = SimulationStatistics().summary();
  EXPECT_EQ(nothing.epochs, 0u);
  EXPECT_TRUE(std::isnan(nothing.availability));
  const nlohmann::json json = to_json(nothing);
  EXPECT_TRUE(json["availability"].is_null());
  EXPECT_TRUE(json["error_m"]["median"].is_null());
  EXPECT_TRUE(json["nees_mean"].is_null());
  EXPECT_EQ(json["path_classes"].size(), 4u);
  EXPECT_EQ(json["path_classes"]["nlos"]["count"], 0);
}

TEST(SimulationStatistics, JsonHasTheNumbers) {
  Epochs epochs;
  epochs.add_fix({3.0, 4.0}, 2.0, 8);
  epochs.add_signals({report(PathClass::kMultipath, 2.0, 40.0)});
  const nlohmann::json json = to_json(epochs.statistics.summary());
  EXPECT_EQ(json["epochs"], 1);
  EXPECT_EQ(json["error_m"]["max"], 5.0);
  EXPECT_EQ(json["claimed_sigma_m"]["median"], 2.0);
  EXPECT_EQ(json["satellites_used_mean"], 8.0);
  EXPECT_TRUE(json["correlation_time_s"].is_null());
  EXPECT_EQ(json["path_classes"]["multipath"]["range_error_m"]["p95"], 2.0);
}

}  // namespace
}  // namespace urban_gnss
