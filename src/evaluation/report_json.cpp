#include "urban_gnss_localization/evaluation/report_json.hpp"

#include <cmath>

namespace urban_gnss {
namespace {

/// The library would write a NaN as null by itself, but only in text: the value itself must be null for its readers.
nlohmann::json number(double value) { return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr); }

nlohmann::json to_json(const Summary& summary) {
  return {{"mean", number(summary.mean)},     {"sigma", number(summary.sigma)}, {"rmse", number(summary.rmse)},
          {"median", number(summary.median)}, {"p95", number(summary.p95)},     {"max", number(summary.max)}};
}

}  // namespace

nlohmann::json to_json(const ErrorSummary& summary) {
  return {{"samples", summary.samples},
          {"coverage", number(summary.coverage)},
          {"position_m", to_json(summary.position_m)},
          {"heading_rad", to_json(summary.heading_rad)},
          {"nees_mean", number(summary.nees_mean)},
          {"share_below_5m", number(summary.share_below_5m)},
          {"share_below_10m", number(summary.share_below_10m)}};
}

}  // namespace urban_gnss
