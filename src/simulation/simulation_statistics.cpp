#include "urban_gnss_localization/simulation/simulation_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "urban_gnss_localization/evaluation/report_json.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

nlohmann::json quantiles(const Summary& summary) {
  return {{"median", number_or_null(summary.median)},
          {"p95", number_or_null(summary.p95)},
          {"max", number_or_null(summary.max)}};
}

}  // namespace

double correlation_time(const std::vector<std::optional<Eigen::Vector2d>>& series, double interval_s) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  std::size_t count = 0;
  for (const auto& value : series) {
    if (!value) continue;
    mean += *value;
    ++count;
  }
  if (count < 2) return kNaN;
  mean /= static_cast<double>(count);
  const auto covariance = [&](std::size_t lag) {
    double sum = 0.0;
    std::size_t pairs = 0;
    for (std::size_t i = 0; i + lag < series.size(); ++i) {
      if (!series[i] || !series[i + lag]) continue;
      sum += (*series[i] - mean).dot(*series[i + lag] - mean);
      ++pairs;
    }
    return pairs > 0 ? sum / static_cast<double>(pairs) : kNaN;
  };
  const double variance = covariance(0);
  const double threshold = std::exp(-1.0);
  double previous = 1.0;
  for (std::size_t lag = 1; lag < series.size() / 2; ++lag) {
    const double correlation = covariance(lag) / variance;
    if (correlation < threshold) {
      const double share = (previous - threshold) / (previous - correlation);
      return interval_s * (static_cast<double>(lag - 1) + share);
    }
    previous = correlation;
  }
  return kNaN;
}

void SimulationStatistics::add(const SimulationEvent& event) {
  if (const auto* fix = std::get_if<FixEvent>(&event.content)) {
    if (fix->published.publisher != 0) return;
    const ReceiverFix& solution = fix->published.fix;
    std::optional<double> claimed_variance_m2;
    if (solution.covariance_type != CovarianceType::kUnknown) claimed_variance_m2 = solution.covariance(0, 0);
    epochs_.push_back({event.stamp, std::nullopt, claimed_variance_m2, fix->used_count});
  } else if (const auto* truth = std::get_if<FixTruthEvent>(&event.content)) {
    // The truth of a fix follows it.
    if (!epochs_.empty() && epochs_.back().stamp == event.stamp) epochs_.back().error = truth->error.head<2>();
  } else if (const auto* signals = std::get_if<SignalsEvent>(&event.content)) {
    for (const SignalTruth& signal : signals->signals) {
      const auto i = static_cast<std::size_t>(signal.report.path_class);
      ++counts_[i];
      if (!signal.report.is_tracked) continue;
      range_errors_m_[i].push_back(signal.report.range_error_m);
      cn0_dbhz_[i].push_back(signal.report.cn0_dbhz);
    }
  }
}

ReceiverSummary SimulationStatistics::summary() const {
  ReceiverSummary summary;
  summary.epochs = epochs_.size();
  std::vector<std::optional<Eigen::Vector2d>> series;
  std::vector<double> errors_m;
  std::vector<double> sigmas_m;
  double nees = 0.0;
  double used = 0.0;
  for (const Epoch& epoch : epochs_) {
    series.push_back(epoch.error);
    if (!epoch.error) continue;
    errors_m.push_back(epoch.error->norm());
    used += epoch.used;
    if (!epoch.claimed_variance_m2) continue;
    sigmas_m.push_back(std::sqrt(*epoch.claimed_variance_m2));
    nees += epoch.error->squaredNorm() / *epoch.claimed_variance_m2;
  }
  const auto count = static_cast<double>(errors_m.size());
  summary.availability = epochs_.empty() ? kNaN : count / static_cast<double>(epochs_.size());
  summary.nees_mean = nees / static_cast<double>(sigmas_m.size());
  summary.used_mean = used / count;
  summary.error_m = summarize(errors_m);
  summary.claimed_sigma_m = summarize(sigmas_m);
  const double span_s = epochs_.size() < 2 ? 0.0 : to_seconds(epochs_.back().stamp - epochs_.front().stamp);
  summary.correlation_time_s =
      correlation_time(series, span_s / std::max(1.0, static_cast<double>(epochs_.size()) - 1.0));
  for (std::size_t i = 0; i < summary.classes.size(); ++i) {
    PathClassSummary& of_class = summary.classes[i];
    of_class.path_class = static_cast<PathClass>(i);
    of_class.count = counts_[i];
    of_class.range_error_m = summarize(range_errors_m_[i]);
    std::vector<double> absolute = range_errors_m_[i];
    for (double& error : absolute) error = std::abs(error);
    of_class.absolute_range_error_m = summarize(std::move(absolute));
    of_class.cn0_dbhz = summarize(cn0_dbhz_[i]);
  }
  return summary;
}

nlohmann::json to_json(const ReceiverSummary& summary) {
  nlohmann::json json = {{"epochs", summary.epochs},
                         {"availability", number_or_null(summary.availability)},
                         {"error_m", quantiles(summary.error_m)},
                         {"correlation_time_s", number_or_null(summary.correlation_time_s)},
                         {"claimed_sigma_m", quantiles(summary.claimed_sigma_m)},
                         {"nees_mean", number_or_null(summary.nees_mean)},
                         {"satellites_used_mean", number_or_null(summary.used_mean)}};
  for (const PathClassSummary& of_class : summary.classes) {
    json["path_classes"][enum_name(of_class.path_class)] = {
        {"count", of_class.count},
        {"range_error_m", quantiles(of_class.range_error_m)},
        {"absolute_range_error_m", quantiles(of_class.absolute_range_error_m)},
        {"cn0_dbhz", quantiles(of_class.cn0_dbhz)}};
  }
  return json;
}

}  // namespace urban_gnss
