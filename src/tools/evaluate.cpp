// Scores the estimates and the raw fixes in bags against ground truth: a table, JSON, error series and plots.

#include <nav_msgs/Odometry.h>
#include <sensor_msgs/NavSatFix.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "command_line.hpp"
#include "files/bag_reader.hpp"
#include "files/output_file.hpp"
#include "urban_gnss_localization/evaluation/report_json.hpp"
#include "urban_gnss_localization/evaluation/stamp_text.hpp"
#include "urban_gnss_localization/evaluation/trajectory_errors.hpp"
#include "urban_gnss_localization/evaluation/tum.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/plotting.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace {

namespace fs = std::filesystem;
using urban_gnss::BagReader;
using urban_gnss::ErrorSample;
using urban_gnss::InputFiles;
using urban_gnss::LocalFrame;
using urban_gnss::Stamp;
using urban_gnss::Summary;
using urban_gnss::TimedPose;
using urban_gnss::Trajectory;
using urban_gnss::TrajectoryErrors;
using urban_gnss::without_leading_slash;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

struct Options {
  std::vector<std::string> bags;
  std::string output;
  std::string truth_bag;
  std::string truth_topic{urban_gnss::topics::kTruth};
  std::vector<std::string> estimate_topics{urban_gnss::topics::kEstimate};
  std::string fix_topic{urban_gnss::topics::kFix};
  double max_gap_s{1.0};
  bool plots{true};
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

/// Calls `use` with every message of the topic, written with or without a leading slash. False where there is none.
template <class Message, class Use>
bool for_each_message(const BagReader& bag, const std::string& topic, Use use) {
  urban_gnss::BagMessages messages(bag, {without_leading_slash(topic)});
  while (const auto message = messages.next()) use(*urban_gnss::expect<Message>(*message));
  return messages.size() > 0;
}

struct OdometryTrack {
  Trajectory trajectory;
  std::string frame;
};

/// Empty where the bag has no such topic.
std::optional<OdometryTrack> read_odometry(const BagReader& bag, const std::string& topic) {
  OdometryTrack track;
  std::size_t not_finite = 0;
  const bool found = for_each_message<nav_msgs::Odometry>(bag, topic, [&](const nav_msgs::Odometry& odometry) {
    track.frame = without_leading_slash(odometry.header.frame_id);
    track.trajectory.push_back(urban_gnss::to_timed_pose(odometry));
    if (!urban_gnss::is_finite(track.trajectory.back().pose)) ++not_finite;
  });
  if (!found) return std::nullopt;
  if (not_finite > 0) {
    std::cerr << bag.name() << ": topic " << topic << ": " << not_finite << " poses are not finite\n";
  }
  urban_gnss::sort_by_stamp(track.trajectory);
  return track;
}

std::optional<LocalFrame> read_datum(const BagReader& bag) {
  std::optional<LocalFrame> frame;
  for_each_message<sensor_msgs::NavSatFix>(bag, urban_gnss::topics::kDatum, [&](const sensor_msgs::NavSatFix& datum) {
    frame.emplace(urban_gnss::GeodeticPosition{datum.latitude, datum.longitude, datum.altitude});
  });
  return frame;
}

/// The fixes as poses without a yaw; those without a position are left out.
Trajectory read_fixes(const BagReader& bag, const std::string& topic, const LocalFrame& frame) {
  Trajectory fixes;
  for_each_message<sensor_msgs::NavSatFix>(bag, topic, [&](const sensor_msgs::NavSatFix& fix) {
    if (fix.status.status < sensor_msgs::NavSatStatus::STATUS_FIX) return;
    // A fix without a height is still a horizontal fix.
    const double altitude = std::isfinite(fix.altitude) ? fix.altitude : frame.datum().altitude_m;
    const Eigen::Vector3d local = frame.to_local({fix.latitude, fix.longitude, altitude});
    if (!local.allFinite()) return;
    TimedPose pose;
    pose.stamp = urban_gnss::to_stamp(fix.header.stamp);
    pose.pose = {local.x(), local.y(), kNan};
    if (fix.position_covariance_type != sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN) {
      pose.covariance.topLeftCorner<2, 2>() << fix.position_covariance[0], fix.position_covariance[1],
          fix.position_covariance[3], fix.position_covariance[4];
    }
    fixes.push_back(pose);
  });
  urban_gnss::sort_by_stamp(fixes);
  return fixes;
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

/// Errors of every estimate topic in the bag that was asked for.
std::vector<Run> evaluate_estimates(const BagReader& bag, const std::string& stem, const OdometryTrack& truth,
                                    const Options& options) {
  std::vector<Run> runs;
  for (const std::string& topic : options.estimate_topics) {
    const auto estimate = read_odometry(bag, topic);
    if (!estimate) continue;
    const std::string name = stem + "/" + without_leading_slash(topic);
    if (estimate->frame != truth.frame) {
      std::cerr << name << ": in frame " << estimate->frame << ", but the truth is in " << truth.frame << '\n';
    }
    warn_of_missing_end(name, truth.trajectory, estimate->trajectory, options.max_gap_s);
    runs.push_back({name, urban_gnss::errors_at_truth(truth.trajectory, estimate->trajectory,
                                                      urban_gnss::from_seconds(options.max_gap_s))});
  }
  return runs;
}

/// Errors of the raw fixes; nothing where there are none, or no datum to place them by.
std::optional<Run> evaluate_fixes(const BagReader& bag, const BagReader& truth_bag, const std::string& stem,
                                  const OdometryTrack& truth, const Options& options) {
  const std::string name = stem + "/" + without_leading_slash(options.fix_topic);
  auto frame = read_datum(bag);
  if (!frame) frame = read_datum(truth_bag);
  if (!frame) {
    std::cerr << name << ": not evaluated, as no bag has a gps/datum\n";
    return std::nullopt;
  }
  const Trajectory fixes = read_fixes(bag, options.fix_topic, *frame);
  if (fixes.empty()) return std::nullopt;
  return Run{name, urban_gnss::errors_at_fixes(truth.trajectory, fixes)};
}

/// Scores one bag and writes its series. The truth comes from `truth_bag`, which may be the same one.
std::vector<Run> evaluate_bag(const std::string& path, const BagReader& bag, const BagReader& truth_bag,
                              const Options& options, const InputFiles& inputs) {
  const auto truth = read_odometry(truth_bag, options.truth_topic);
  if (!truth) {
    throw std::runtime_error(truth_bag.name() + ": no ground truth on topic " + options.truth_topic +
                             " (another bag's is taken with --truth)");
  }
  const std::string stem = fs::path(path).stem().string();
  std::vector<Run> runs = evaluate_estimates(bag, stem, *truth, options);
  const auto fixes = evaluate_fixes(bag, truth_bag, stem, *truth, options);
  if (fixes) runs.push_back(*fixes);
  if (runs.empty()) throw std::runtime_error(path + ": none of the topics to evaluate is in it");

  const Stamp start = truth->trajectory.front().stamp;
  const fs::path output(options.output);
  write_trajectory(output / ("truth_" + as_file_name(stem) + ".tum"), inputs, truth->trajectory);
  for (const Run& run : runs) {
    if (run.errors.samples.empty()) std::cerr << run.name << ": no stamp in common with the truth\n";
    const std::string name = as_file_name(run.name);
    write_error_series(output / "data" / ("errors_" + name + ".csv"), inputs, run.errors.samples, start);
    write_trajectory(output / ("errors_" + name + ".tum"), inputs, scored_poses(run.errors.samples));
    // With every run, as each one's plot shows the fixes that it had.
    if (fixes) write_fix_series(output / "data" / ("fixes_" + name + ".csv"), inputs, fixes->errors.samples, start);
  }
  return runs;
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
    out << std::right << std::setw(column_width) << text.str();
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
  out << "errors in m; heading_deg is the heading's root mean square error; a consistent estimate has a NEES of 3\n";
}

void write_metrics(const fs::path& path, const InputFiles& inputs, const std::vector<Run>& runs) {
  nlohmann::json metrics = {{"runs", nlohmann::json::object()}};
  for (const Run& run : runs) metrics["runs"][run.name] = urban_gnss::to_json(run.errors.summary);
  urban_gnss::write_file(path, inputs, [&](std::ostream& file) { file << metrics.dump(2) << '\n'; });
}

void evaluate(const Options& options, const InputFiles& inputs) {
  std::set<std::string> stems;
  for (const std::string& bag : options.bags) {
    const std::string stem = fs::path(bag).stem().string();
    if (!stems.insert(stem).second) {
      throw std::runtime_error("two bags are called " + stem + ": their results would share one name");
    }
  }
  std::optional<BagReader> truth_bag;
  if (!options.truth_bag.empty()) truth_bag.emplace(options.truth_bag);

  std::vector<Run> runs;
  for (const std::string& bag : options.bags) {
    const BagReader opened(bag);
    for (Run& run : evaluate_bag(bag, opened, truth_bag ? *truth_bag : opened, options, inputs)) {
      runs.push_back(std::move(run));
    }
  }
  print_table(std::cout, runs);
  write_metrics(fs::path(options.output) / "metrics.json", inputs, runs);
  if (options.plots) urban_gnss::run_plotter("plot_evaluation.py", options.output);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  bool no_plots = false;
  urban_gnss::CommandLine line("evaluate", "Scores estimates and raw fixes in bags against ground truth.");
  CLI::App& app = line.app();
  app.add_option("BAG", options.bags, "bags to evaluate")->required()->check(CLI::ExistingFile);
  line.add_output_folder("--output", options.output, "folder for metrics.json, data/, trajectories and plots")
      ->required();
  app.add_option("--truth", options.truth_bag, "bag with the ground truth; default: each bag's own")
      ->check(CLI::ExistingFile);
  app.add_option("--truth-topic", options.truth_topic, "nav_msgs/Odometry");
  CLI::Option* estimate_topic =
      app.add_option("--estimate-topic", options.estimate_topics,
                     "nav_msgs/Odometry, may be given several times; default: odometry/filtered");
#if CLI11_VERSION_MAJOR >= 2
  estimate_topic->allow_extra_args(false);  // one topic each, so that a bag may follow it
#else
  static_cast<void>(estimate_topic);  // Ubuntu 20.04's CLI11 cannot: there the bags come first
#endif
  app.add_option("--fix-topic", options.fix_topic, "sensor_msgs/NavSatFix");
  app.add_option("--max-gap", options.max_gap_s, "longest time over which an estimate is interpolated, s")
      ->check(CLI::Range(1e-3, 1e6));
  app.add_flag("--no-plots", no_plots, "write no plots");
  return line.run(argc, argv, [&] {
    options.plots = !no_plots;
    evaluate(options, line.inputs());
  });
}
