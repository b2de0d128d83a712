// Shows the tracks in bags: estimates, fixes and what was decided about them, as a page and for maps. Where there is
// ground truth, it scores estimates and raw fixes against it: a table, JSON, error series and plots.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "bag_tracks.hpp"
#include "command_line.hpp"
#include "files/bag_reader.hpp"
#include "files/output_file.hpp"
#include "replay/several_recordings.hpp"
#include "replay/text_counts.hpp"
#include "urban_gnss_localization/evaluation/report_json.hpp"
#include "urban_gnss_localization/evaluation/stamp_text.hpp"
#include "urban_gnss_localization/evaluation/track_export.hpp"
#include "urban_gnss_localization/evaluation/track_report.hpp"
#include "urban_gnss_localization/evaluation/trajectory_errors.hpp"
#include "urban_gnss_localization/evaluation/tum.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/ros/plotting.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace {

namespace fs = std::filesystem;
using urban_gnss::BagReader;
using urban_gnss::ErrorSample;
using urban_gnss::InputFiles;
using urban_gnss::OdometryTrack;
using urban_gnss::Stamp;
using urban_gnss::Summary;
using urban_gnss::TimedPose;
using urban_gnss::TrackReport;
using urban_gnss::TrackSummary;
using urban_gnss::Trajectory;
using urban_gnss::TrajectoryErrors;
using urban_gnss::without_leading_slash;

/// Of a line in the page: more than a screen has pixels.
constexpr std::size_t kMostPoints = 20000;

struct Options {
  std::vector<std::string> bags;
  std::string output;
  std::string truth_bag;
  std::string truth_topic{urban_gnss::topics::kTruth};
  bool needs_truth{false};
  std::vector<std::string> estimate_topics;
  std::string fix_topic{urban_gnss::topics::kFix};
  double max_gap_s{1.0};
  bool plots{true};
  std::string kml_file, gpx_file, geojson_file;

  Stamp max_gap() const { return urban_gnss::from_seconds(max_gap_s); }
};

/// One row of the table.
struct Run {
  std::string name;  ///< "<bag's stem>/<topic>"
  TrajectoryErrors errors;
};

std::string as_file_name(std::string name) {
  for (char& c : name) {
    if (c == '/') c = '_';
  }
  return name;
}

/// A number with nine significant digits, NaN as "nan" whatever its sign.
std::string cell(double value) {
  if (std::isnan(value)) return "nan";
  char text[32];
  std::snprintf(text, sizeof(text), "%.9g", value);
  return text;
}

void write_error_series(const fs::path& path, const InputFiles& inputs, const std::vector<ErrorSample>& samples,
                        Stamp start) {
  urban_gnss::write_file(path, inputs, [&](std::ostream& file) {
    file << "t,position_error_m,heading_error_rad,est_x,est_y,truth_x,truth_y,sigma_m,nees\n";
    for (const ErrorSample& sample : samples) {
      file << urban_gnss::format_stamp(sample.stamp - start) << ',' << cell(sample.position_error_m) << ','
           << cell(sample.heading_error_rad) << ',' << cell(sample.estimate.x) << ',' << cell(sample.estimate.y) << ','
           << cell(sample.truth.x) << ',' << cell(sample.truth.y) << ',' << cell(sample.position_sigma_m) << ','
           << cell(sample.nees) << '\n';
    }
  });
}

void write_fix_series(const fs::path& path, const InputFiles& inputs, const std::vector<ErrorSample>& samples,
                      Stamp start) {
  urban_gnss::write_file(path, inputs, [&](std::ostream& file) {
    file << "t,fix_x,fix_y,error_m\n";
    for (const ErrorSample& sample : samples) {
      file << urban_gnss::format_stamp(sample.stamp - start) << ',' << cell(sample.estimate.x) << ','
           << cell(sample.estimate.y) << ',' << cell(sample.position_error_m) << '\n';
    }
  });
}

void write_trajectory(const fs::path& path, const InputFiles& inputs, const Trajectory& trajectory) {
  urban_gnss::write_file(path, inputs, [&](std::ostream& file) { urban_gnss::write_tum(file, trajectory); });
}

/// What was scored, for other tools that read TUM files. Fixes, which have no yaw, get zero.
Trajectory scored_poses(const std::vector<ErrorSample>& samples) {
  Trajectory poses;
  for (const ErrorSample& sample : samples) {
    TimedPose pose;
    pose.stamp = sample.stamp;
    pose.pose = sample.estimate;
    if (std::isnan(pose.pose.yaw)) pose.pose.yaw = 0.0;
    poses.push_back(pose);
  }
  return poses;
}

/// Says where an estimate ends before the truth does, as that of a run that was cut off.
void warn_of_missing_end(const std::string& name, const Trajectory& truth, const Trajectory& estimate, double gap_s) {
  if (truth.empty() || estimate.empty()) return;
  const double missing_s = urban_gnss::to_seconds(truth.back().stamp - estimate.back().stamp);
  if (missing_s <= gap_s) return;
  std::cerr << name << ": ends " << std::fixed << std::setprecision(1) << missing_s << " s before the truth, which has "
            << urban_gnss::to_seconds(truth.back().stamp - truth.front().stamp)
            << " s: its errors are of the part before\n";
}

/// Those that were asked for, or every odometry/filtered, in whatever namespace.
std::vector<std::string> find_estimate_topics(const BagReader& bag, const Options& options) {
  if (!options.estimate_topics.empty()) return options.estimate_topics;
  const std::string end = std::string("/") + urban_gnss::topics::kEstimate;
  std::vector<std::string> found;
  for (const urban_gnss::BagConnection& connection : bag.connections()) {
    const std::string topic = "/" + without_leading_slash(connection.topic);
    const bool ends_so = topic.size() >= end.size() && topic.compare(topic.size() - end.size(), end.size(), end) == 0;
    if (ends_so && connection.type == "nav_msgs/Odometry") found.push_back(topic);
  }
  return found;
}

/// What one bag and that of the truth, which may be the same, have in common for all estimates.
struct Drive {
  std::string stem;
  std::optional<OdometryTrack> truth;
  std::optional<urban_gnss::LocalFrame> map;
  urban_gnss::FixTrack fixes;
};

Drive read_drive(const std::string& path, const BagReader& bag, const BagReader& truth_bag, const Options& options) {
  Drive drive;
  drive.stem = fs::path(path).stem().string();
  drive.truth = read_odometry(truth_bag, options.truth_topic);
  if (!drive.truth && options.needs_truth) {
    throw std::runtime_error(truth_bag.name() + ": no ground truth on topic " + options.truth_topic +
                             (options.truth_bag.empty() ? " (another bag's is taken with --truth)" : ""));
  }
  drive.map = urban_gnss::read_datum(bag);
  if (!drive.map) drive.map = urban_gnss::read_datum(truth_bag);
  const BagReader& fix_bag = bag.count(options.fix_topic) > 0 ? bag : truth_bag;
  if (drive.map) {
    drive.fixes = urban_gnss::read_fixes(fix_bag, options.fix_topic, *drive.map);
  } else if (fix_bag.count(options.fix_topic) > 0) {
    std::cerr << drive.stem << "/" << without_leading_slash(options.fix_topic)
              << ": not placed, as no bag has a gps/datum\n";
  }
  return drive;
}

/// The estimate of one topic, without errors; nothing where the bag does not have it.
std::optional<TrackReport> read_report(const BagReader& bag, const Drive& drive, const std::string& topic) {
  auto estimate = urban_gnss::read_odometry(bag, topic);
  if (!estimate) return std::nullopt;
  urban_gnss::StatusTrack status = urban_gnss::read_status(bag, topic);
  TrackReport report;
  report.name = drive.stem + "/" + without_leading_slash(topic);
  if (drive.truth && estimate->frame != drive.truth->frame) {
    std::cerr << report.name << ": is in frame '" << estimate->frame << "', the truth in '" << drive.truth->frame
              << "'; they are compared as if it were one\n";
  }
  report.localizer = status.localizer;
  report.map = drive.map;
  report.estimate = std::move(estimate->trajectory);
  report.speeds_mps = std::move(estimate->speeds_mps);
  report.states = std::move(status.states);
  report.fixes_without_position = drive.fixes.without_position;
  for (const TimedPose& pose : drive.fixes.fixes) {
    urban_gnss::DecidedFix fix{pose.stamp, pose.pose.position(), urban_gnss::position_sigma_m(pose.covariance), {}};
    const auto outcome = status.outcomes.find(pose.stamp);
    if (outcome != status.outcomes.end()) fix.outcome = outcome->second;
    report.fixes.push_back(std::move(fix));
  }
  return report;
}

void write_run(const Run& run, const std::optional<TrajectoryErrors>& fixes, Stamp start, const Options& options,
               const InputFiles& inputs) {
  const fs::path output(options.output);
  const std::string name = as_file_name(run.name);
  write_error_series(output / "data" / ("errors_" + name + ".csv"), inputs, run.errors.samples, start);
  write_trajectory(output / ("errors_" + name + ".tum"), inputs, scored_poses(run.errors.samples));
  // With every run, as each one's plot shows the fixes that it had.
  if (fixes) write_fix_series(output / "data" / ("fixes_" + name + ".csv"), inputs, fixes->samples, start);
}

/// All that is known of the estimates in the bags.
struct Results {
  std::vector<TrackReport> reports;
  std::vector<TrackSummary> summaries;  ///< of the reports
  std::vector<Run> runs;                ///< where there is a truth
};

/// Reads one bag, scores it where there is a truth, and writes its series.
void evaluate_bag(const std::string& path, const BagReader& bag, const BagReader& truth_bag, const Options& options,
                  const InputFiles& inputs, Results& results) {
  const Drive drive = read_drive(path, bag, truth_bag, options);
  std::optional<TrajectoryErrors> fixes;
  if (drive.truth && !drive.fixes.fixes.empty()) {
    fixes = urban_gnss::errors_at_fixes(drive.truth->trajectory, drive.fixes.fixes);
  }
  std::vector<Run> runs;
  std::vector<TrackReport> reports;
  for (const std::string& topic : find_estimate_topics(bag, options)) {
    auto report = read_report(bag, drive, topic);
    if (!report) continue;
    if (drive.truth) {
      warn_of_missing_end(report->name, drive.truth->trajectory, report->estimate, options.max_gap_s);
      runs.push_back(
          {report->name, urban_gnss::errors_at_truth(drive.truth->trajectory, report->estimate, options.max_gap())});
      report->truth = drive.truth->trajectory;
      report->errors = runs.back().errors.samples;
      if (fixes) report->fix_errors = fixes->samples;
    }
    reports.push_back(std::move(*report));
  }
  if (fixes) runs.push_back({drive.stem + "/" + without_leading_slash(options.fix_topic), *fixes});
  if (runs.empty() && reports.empty()) {
    throw std::runtime_error(
        path + ": none of the topics to evaluate is in it" +
        (options.estimate_topics.empty() ? " (another than odometry/filtered: --estimate-topic)" : "") + "; it has" +
        bag.topics());
  }
  for (const Run& run : runs) {
    if (run.errors.samples.empty()) std::cerr << run.name << ": no stamp in common with the truth\n";
  }
  if (!options.output.empty() && drive.truth) {
    const fs::path tum = fs::path(options.output) / ("truth_" + as_file_name(drive.stem) + ".tum");
    write_trajectory(tum, inputs, drive.truth->trajectory);
    for (const Run& run : runs) write_run(run, fixes, drive.truth->trajectory.front().stamp, options, inputs);
  }
  for (TrackReport& report : reports) {
    results.summaries.push_back(urban_gnss::summarize(report, options.max_gap()));
    results.reports.push_back(std::move(report));
  }
  std::move(runs.begin(), runs.end(), std::back_inserter(results.runs));
}

void print_table(std::ostream& out, const std::vector<Run>& runs) {
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
    number(urban_gnss::radians_to_degrees(summary.heading_rad.rmse), 13, 2);
    number(summary.nees_mean, 10, 2);
    number(summary.share_below_5m, 7, 3);
    number(summary.share_below_10m, 7, 3);
    out << '\n';
  }
  out << "errors in m; heading_deg is the heading's root mean square error\n"
         "NEES: squared error over the claimed covariance, of x, y and yaw; 3 is honest, more is worse than claimed\n";
}

/// "3 (longest 12.5 s, from 40.1 s)", counted from the begin.
std::string describe(const std::vector<urban_gnss::Gap>& gaps, Stamp start) {
  if (gaps.empty()) return "none";
  const auto longest = std::max_element(gaps.begin(), gaps.end(),
                                        [](const auto& a, const auto& b) { return a.end - a.begin < b.end - b.begin; });
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << gaps.size() << " (longest "
       << urban_gnss::to_seconds(longest->end - longest->begin) << " s, from "
       << urban_gnss::to_seconds(longest->begin - start) << " s)";
  return text.str();
}

void print_track(std::ostream& out, const TrackReport& report, const TrackSummary& summary) {
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
  urban_gnss::TextCounts rejections;
  for (const urban_gnss::DecidedFix& fix : report.fixes) {
    if (fix.outcome && is_rejected(fix.outcome->decision)) {
      rejections.add(std::string(to_string(fix.outcome->decision)) + ": " + fix.outcome->reason);
    }
  }
  for (const auto& [kind, texts] : rejections.kinds()) out << "  " << texts.count << " times " << texts.first << '\n';
  for (const auto& [state, seconds] : summary.seconds_in_state) {
    out << "  " << state << ": " << std::setprecision(1) << seconds << " s\n";
  }
}

void write_exports(const Results& results, const Options& options, const InputFiles& inputs) {
  const auto write = [&](const std::string& file, auto writer) {
    if (file.empty()) return;
    urban_gnss::write_file(file, inputs, [&](std::ostream& out) { writer(out, results.reports, options.max_gap()); });
  };
  write(options.kml_file, urban_gnss::write_kml);
  write(options.gpx_file, urban_gnss::write_gpx);
  write(options.geojson_file, urban_gnss::write_geojson);
}

void write_folder(const Results& results, const std::string& command, const Options& options,
                  const InputFiles& inputs) {
  const fs::path output(options.output);
  nlohmann::json metrics = {
      {"command", command}, {"runs", nlohmann::json::object()}, {"tracks", nlohmann::json::object()}};
  for (const TrackReport& report : results.reports) metrics["order"].push_back(report.name);
  for (const Run& run : results.runs) metrics["runs"][run.name] = urban_gnss::to_json(run.errors.summary);
  for (std::size_t i = 0; i < results.reports.size(); ++i) {
    const TrackReport& report = results.reports[i];
    const TrackSummary& summary = results.summaries[i];
    metrics["tracks"][report.name] = urban_gnss::to_json(summary);
    const fs::path file = output / "data" / ("track_" + as_file_name(report.name) + ".json");
    urban_gnss::write_file(file, inputs, [&](std::ostream& out) {
      out << urban_gnss::to_json(report, summary, kMostPoints)
                 .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)
          << '\n';
    });
  }
  urban_gnss::write_file(output / "metrics.json", inputs, [&](std::ostream& file) { file << metrics.dump(2) << '\n'; });
  if (options.plots) urban_gnss::run_plotter("plot_evaluation.py", options.output);
}

void evaluate(const Options& options, const std::string& command, const InputFiles& inputs) {
  urban_gnss::require_names_of_their_own(options.bags);
  std::optional<BagReader> truth_bag;
  if (!options.truth_bag.empty()) truth_bag.emplace(options.truth_bag);

  Results results;
  for (const std::string& bag : options.bags) {
    const BagReader opened(bag);
    evaluate_bag(bag, opened, truth_bag ? *truth_bag : opened, options, inputs, results);
  }
  if (results.runs.empty()) {
    for (std::size_t i = 0; i < results.reports.size(); ++i) {
      print_track(std::cout, results.reports[i], results.summaries[i]);
    }
  } else {
    print_table(std::cout, results.runs);
  }
  write_exports(results, options, inputs);
  if (!options.output.empty()) write_folder(results, command, options, inputs);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  bool no_plots = false;
  urban_gnss::CommandLine line("evaluate",
                               "Shows the tracks in bags, as a page and for maps, and scores estimates and raw fixes "
                               "where there is ground truth.");
  CLI::App& app = line.app();
  app.add_option("BAG", options.bags, "bags to evaluate")->required()->check(CLI::ExistingFile);
  line.add_output_folder("--output", options.output,
                         "folder for report.html, metrics.json, data/, trajectories and plots");
  app.add_option("--truth", options.truth_bag, "bag with the ground truth; default: each bag's own, if it has one")
      ->check(CLI::ExistingFile);
  const CLI::Option* truth_topic = app.add_option("--truth-topic", options.truth_topic, "nav_msgs/Odometry");
  CLI::Option* estimate_topic = app.add_option("--estimate-topic", options.estimate_topics,
                                               "nav_msgs/Odometry, may be given several times; default: every "
                                               "odometry/filtered, in whatever namespace");
#if CLI11_VERSION_MAJOR >= 2
  estimate_topic->allow_extra_args(false);  // one topic each, so that a bag may follow it
#else
  static_cast<void>(estimate_topic);  // Ubuntu 20.04's CLI11 cannot: there the bags come first
#endif
  app.add_option("--fix-topic", options.fix_topic,
                 "sensor_msgs/NavSatFix, of the bag, or of the truth's where that has none");
  app.add_option("--max-gap", options.max_gap_s, "longest time over which an estimate is interpolated, s")
      ->check(CLI::Range(1e-3, 1e6));
  line.add_output("--kml", options.kml_file, "write the tracks here, for Google Earth, Mapviz, QGIS");
  line.add_output("--gpx", options.gpx_file, "write the tracks here, for phones and JOSM");
  line.add_output("--geojson", options.geojson_file, "write the tracks here, for QGIS and web maps");
  app.add_flag("--no-plots", no_plots, "write no plots and no page");
  return line.run(argc, argv, [&] {
    options.plots = !no_plots;
    options.needs_truth = !options.truth_bag.empty() || truth_topic->count() > 0;
    evaluate(options, line.command(), line.inputs());
  });
}
