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
#include <string>
#include <vector>

#include "bag_tracks.hpp"
#include "command_line.hpp"
#include "evaluation_text.hpp"
#include "files/bag_reader.hpp"
#include "files/output_file.hpp"
#include "replay/several_recordings.hpp"
#include "urban_gnss_localization/evaluation/report_json.hpp"
#include "urban_gnss_localization/evaluation/stamp_text.hpp"
#include "urban_gnss_localization/evaluation/track_export.hpp"
#include "urban_gnss_localization/evaluation/track_report.hpp"
#include "urban_gnss_localization/evaluation/trajectory_errors.hpp"
#include "urban_gnss_localization/evaluation/tum.hpp"
#include "urban_gnss_localization/ros/plotting.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace {

namespace fs = std::filesystem;
using urban_gnss::BagReader;
using urban_gnss::ErrorSample;
using urban_gnss::InputFiles;
using urban_gnss::OdometryTrack;
using urban_gnss::Run;
using urban_gnss::Stamp;
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
      urban_gnss::print_track(std::cout, results.reports[i], results.summaries[i]);
    }
  } else {
    urban_gnss::print_table(std::cout, results.runs);
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
