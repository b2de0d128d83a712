#pragma once

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <ostream>
#include <sstream>
#include <string>
#include <vector>

#include "replay/text_counts.hpp"
#include "urban_gnss_localization/evaluation/track_report.hpp"
#include "urban_gnss_localization/evaluation/trajectory_errors.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"

/// What `evaluate` prints.
namespace urban_gnss {

/// One row of the table.
struct Run {
  std::string name;  ///< "<bag's stem>/<topic>"
  TrajectoryErrors errors;
};

/// The errors of all runs.
inline void print_table(std::ostream& out, const std::vector<Run>& runs) {
  std::size_t width = 4;
  for (const Run& run : runs) width = std::max(width, run.name.size());
  const auto number = [&](double value, int column_width, int decimals) {
    std::ostringstream text;
    if (std::isnan(value)) {
      text << '-';
    } else {
      text << std::fixed << std::setprecision(decimals) << value;
    }
    out << ' ' << std::right << std::setw(column_width - 1) << text.str();  // apart, however long it is
  };
  out << std::left << std::setw(static_cast<int>(width)) << "name" << std::right << std::setw(9) << "samples"
      << std::setw(10) << "coverage" << std::setw(9) << "median" << std::setw(9) << "mean" << std::setw(9) << "sigma"
      << std::setw(9) << "rmse" << std::setw(9) << "p95" << std::setw(9) << "max" << std::setw(13) << "heading_deg"
      << std::setw(10) << "NEES" << std::setw(7) << "<5m" << std::setw(7) << "<10m" << '\n';
  for (const Run& run : runs) {
    const auto& summary = run.errors.summary;
    const Summary& position = summary.position_m;
    out << std::left << std::setw(static_cast<int>(width)) << run.name << std::right << std::setw(9) << summary.samples;
    number(summary.coverage, 10, 3);
    for (const double metres :
         {position.median, position.mean, position.sigma, position.rmse, position.p95, position.max}) {
      number(metres, 9, 2);
    }
    number(radians_to_degrees(summary.heading_rad.rmse), 13, 2);
    number(summary.nees_mean, 10, 2);
    number(summary.share_below_5m, 7, 3);
    number(summary.share_below_10m, 7, 3);
    out << '\n';
  }
  out << "errors in m; heading_deg is the heading's root mean square error\n"
         "NEES: squared error over the claimed covariance, of x, y and yaw; 3 is honest, more is worse than claimed\n";
}

/// "3 (longest 12.5 s, from 40.1 s)", counted from the begin.
inline std::string describe(const std::vector<Gap>& gaps, Stamp start) {
  if (gaps.empty()) return "none";
  const auto longest = std::max_element(gaps.begin(), gaps.end(),
                                        [](const auto& a, const auto& b) { return a.end - a.begin < b.end - b.begin; });
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << gaps.size() << " (longest " << to_seconds(longest->end - longest->begin)
       << " s, from " << to_seconds(longest->begin - start) << " s)";
  return text.str();
}

/// What is known of a track without a truth.
inline void print_track(std::ostream& out, const TrackReport& report, const TrackSummary& summary) {
  const Stamp start = report.estimate.empty() ? Stamp(0) : report.estimate.front().stamp;
  out << report.name << (report.localizer.empty() ? "" : " (" + report.localizer + ")") << ": " << summary.estimates
      << " estimates, " << std::fixed << std::setprecision(1) << summary.duration_s << " s, " << std::setprecision(0)
      << summary.distance_m << " m\n  claimed sigma: median " << std::setprecision(2) << summary.sigma_m.median
      << " m, 95 % " << summary.sigma_m.p95 << " m; speed: mean " << summary.speed_mps.mean << " m/s, max "
      << summary.speed_mps.max << " m/s; gaps: " << describe(summary.gaps, start) << '\n';
  out << "  " << summary.fixes << " fixes";
  if (report.fixes_without_position > 0) out << " and " << report.fixes_without_position << " without a position";
  out << ':';
  for (const auto& [decision, count] : summary.decisions) out << "  " << decision << ' ' << count;
  out << "\n  without a fix that was used: " << describe(summary.gaps_of_fixes, start) << '\n';
  TextCounts rejections;
  for (const DecidedFix& fix : report.fixes) {
    if (fix.outcome && is_rejected(fix.outcome->decision)) {
      rejections.add(std::string(to_string(fix.outcome->decision)) + ": " + fix.outcome->reason);
    }
  }
  for (const auto& [kind, texts] : rejections.kinds()) out << "  " << texts.count << " times " << texts.first << '\n';
  for (const auto& [state, seconds] : summary.seconds_in_state) {
    out << "  " << state << ": " << std::setprecision(1) << seconds << " s\n";
  }
  for (const auto& [reason, seconds] : summary.seconds_not_healthy) {
    out << "  not healthy: " << seconds << " s: " << reason << '\n';
  }
}

}  // namespace urban_gnss
