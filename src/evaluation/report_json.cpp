#include "urban_gnss_localization/evaluation/report_json.hpp"

#include <cmath>

namespace urban_gnss {

nlohmann::json number_or_null(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

namespace {

nlohmann::json to_json(const Summary& summary) {
  return {{"mean", number_or_null(summary.mean)}, {"sigma", number_or_null(summary.sigma)},
          {"rmse", number_or_null(summary.rmse)}, {"median", number_or_null(summary.median)},
          {"p95", number_or_null(summary.p95)},   {"max", number_or_null(summary.max)}};
}

}  // namespace

nlohmann::json to_json(const ErrorSummary& summary) {
  return {{"samples", summary.samples},
          {"coverage", number_or_null(summary.coverage)},
          {"position_m", to_json(summary.position_m)},
          {"heading_rad", to_json(summary.heading_rad)},
          {"nees_mean", number_or_null(summary.nees_mean)},
          {"position_nees_mean", number_or_null(summary.position_nees_mean)},
          {"inside_95", number_or_null(summary.inside_95)},
          {"beyond_protection", number_or_null(summary.beyond_protection)},
          {"share_below_5m", number_or_null(summary.share_below_5m)},
          {"share_below_10m", number_or_null(summary.share_below_10m)}};
}

}  // namespace urban_gnss
