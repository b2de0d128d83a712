// Tables I and II of Maier and Kleiner (2010) on simulated scenarios, in our setting and in theirs: how well each
// covariance model tells good fixes from bad ones, and what a UKF makes of its covariances.

#include "urban_gnss_localization/experiments/occlusion_experiment.hpp"

#include <Eigen/LU>
#include <chrono>
#include <cmath>
#include <exception>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "command_line.hpp"
#include "find_scenario.hpp"
#include "occlusion_series.hpp"
#include "files/output_file.hpp"
#include "overrides.hpp"
#include "scenario_runs.hpp"
#include "urban_gnss_localization/evaluation/report_json.hpp"
#include "urban_gnss_localization/evaluation/statistics.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"

namespace fs = std::filesystem;
using namespace urban_gnss;

namespace {

constexpr double kBadFix_m = 6.0;  ///< horizontal error from which a fix is bad; sigma_thresh of the paper

struct Options {
  ScenarioRuns runs{{"campus_loop", "building_pass", "downtown_grid", "open_sky"}};
  int cloud_every = 5;
  std::string occlusion_file;
  std::vector<std::string> occlusion_overrides;
  std::vector<std::string> ukf_overrides;
  std::string json_file;
  std::string series_directory;
};

OcclusionExperimentConditions read_conditions(const Options& options) {
  OcclusionExperimentConditions conditions;
  const std::string file = options.occlusion_file.empty()
                               ? (package_path() / "config/occlusion_simulator.yaml").string()
                               : options.occlusion_file;
  read_overrides(file + ", --set", load_map(file), options.occlusion_overrides, conditions.occlusion);
  read_overrides("--set", YAML::Node(YAML::NodeType::Map), options.occlusion_overrides, conditions.as_printed);
  WithMotion with_motion{conditions.ukf, conditions.motion};
  read_overrides("--ukf-set", YAML::Node(YAML::NodeType::Map), options.ukf_overrides, with_motion,
                 conditions.localization);
  conditions.cloud_every = options.cloud_every;
  return conditions;
}

double nees(const Eigen::Vector2d& error, const Eigen::Matrix2d& covariance) {
  return error.dot(covariance.inverse() * error);
}

double ratio(double part, double whole) {
  return whole > 0.0 ? part / whole : std::numeric_limits<double>::quiet_NaN();
}

/// Table I of one model: the confusion of good and bad fixes.
nlohmann::json classification_json(const std::vector<OcclusionRun>& runs, std::size_t model) {
  double counts[2][2] = {};  // [is good][is called good]
  double with_map = 0.0;
  for (const OcclusionRun& run : runs) {
    for (const WeighedFix& fix : run.models[model].fixes) {
      counts[fix.error_m.norm() <= kBadFix_m ? 1 : 0][fix.is_good ? 1 : 0] += 1.0;
      with_map += fix.has_map ? 1.0 : 0.0;
    }
  }
  const double good = counts[1][0] + counts[1][1];
  const double bad = counts[0][0] + counts[0][1];
  return {{"good_called_good", counts[1][1]},
          {"good_called_bad", counts[1][0]},
          {"bad_called_good", counts[0][1]},
          {"bad_called_bad", counts[0][0]},
          {"correct", number_or_null(ratio(counts[1][1] + counts[0][0], good + bad))},
          {"correct_of_good", number_or_null(ratio(counts[1][1], good))},
          {"correct_of_bad", number_or_null(ratio(counts[0][0], bad))},
          {"with_map", number_or_null(ratio(with_map, good + bad))}};
}

/// Share of satellites of which the setting's map says the truth, by whether they have a line of sight.
nlohmann::json satellites_json(const std::vector<OcclusionRun>& runs, std::size_t setting) {
  LineOfSightTally all;
  for (const OcclusionRun& run : runs) {
    for (const std::size_t truth : {0U, 1U}) {
      const LineOfSightTally& tally = run.satellites[setting];
      for (const std::size_t said : {0U, 1U}) all.counts[truth][said] += tally.counts[truth][said];
      all.known_sum[truth] += tally.known_sum[truth];
    }
  }
  const auto direct = static_cast<double>(all.count(true));
  const auto hidden = static_cast<double>(all.count(false));
  return {{"direct", direct},
          {"hidden", hidden},
          {"direct_called_free", number_or_null(ratio(static_cast<double>(all.counts[1][1]), direct))},
          {"hidden_called_blocked", number_or_null(ratio(static_cast<double>(all.counts[0][0]), hidden))},
          {"known_of_direct", number_or_null(ratio(all.known_sum[1], direct))},
          {"known_of_hidden", number_or_null(ratio(all.known_sum[0], hidden))}};
}

nlohmann::json fix_json(const std::vector<OcclusionRun>& runs, std::size_t model, bool is_claim) {
  std::vector<double> normalized;
  std::vector<double> good;
  std::vector<double> bad;
  for (const OcclusionRun& run : runs) {
    for (const WeighedFix& fix : run.models[model].fixes) {
      const double value = nees(fix.error_m, is_claim ? fix.claimed : fix.covariance);
      normalized.push_back(value);
      (fix.error_m.norm() <= kBadFix_m ? good : bad).push_back(value);
    }
  }
  const Summary summary = summarize(normalized);
  return {{"mean", number_or_null(summary.mean)},
          {"median", number_or_null(summary.median)},
          {"mean_of_good", number_or_null(summarize(good).mean)},
          {"mean_of_bad", number_or_null(summarize(bad).mean)}};
}

/// A row of Table II.
nlohmann::json trajectory_json(const std::vector<OcclusionRun>& runs,
                               const std::function<const Trajectory&(const OcclusionRun&)>& trajectory_of) {
  std::vector<double> position;
  std::vector<double> heading;
  double truths = 0.0;
  nlohmann::json by_seed = nlohmann::json::array();
  for (const OcclusionRun& run : runs) {
    const TrajectoryErrors errors = errors_at_truth(run.truth, trajectory_of(run));
    truths += static_cast<double>(run.truth.size());
    for (const ErrorSample& sample : errors.samples) {
      position.push_back(sample.position_error_m);
      heading.push_back(std::abs(sample.heading_error_rad));
    }
    by_seed.push_back(number_or_null(errors.summary.position_m.mean));
  }
  const double coverage = ratio(static_cast<double>(position.size()), truths);
  const Summary p = summarize(std::move(position));
  const Summary h = summarize(std::move(heading));
  return {{"position_mean_m", number_or_null(p.mean)},
          {"position_sigma_m", number_or_null(p.sigma)},
          {"position_max_m", number_or_null(p.max)},
          {"heading_mean_rad", number_or_null(h.mean)},
          {"heading_sigma_rad", number_or_null(h.sigma)},
          {"coverage", number_or_null(coverage)},
          {"position_mean_by_seed_m", by_seed}};
}

nlohmann::json scenario_json(const std::vector<OcclusionRun>& runs) {
  nlohmann::json json;
  json["fix_nees"]["claimed"] = fix_json(runs, 0, true);
  json["trajectory"]["odometry"] =
      trajectory_json(runs, [](const OcclusionRun& run) -> const Trajectory& { return run.odometry; });
  std::vector<double> errors;
  for (const OcclusionRun& run : runs) {
    for (const WeighedFix& fix : run.models[0].fixes) errors.push_back(fix.error_m.norm());
  }
  const Summary error = summarize(std::move(errors));
  json["fix_error_m"] = {{"mean", number_or_null(error.mean)},
                         {"median", number_or_null(error.median)},
                         {"p95", number_or_null(error.p95)},
                         {"max", number_or_null(error.max)}};
  for (std::size_t i = 0; i < kComparedModels.size(); ++i) {
    const std::string name = kComparedModels[i].name;
    json["fix_nees"][name] = fix_json(runs, i, false);
    json["trajectory"][name] =
        trajectory_json(runs, [i](const OcclusionRun& run) -> const Trajectory& { return run.models[i].estimate; });
    if (kComparedModels[i].model != CovarianceModel::kConventional) {
      json["classification"][name] = classification_json(runs, i);
    }
    if (kComparedModels[i].is_as_printed) continue;
    json["trajectory_student_t"][name] = trajectory_json(
        runs, [i](const OcclusionRun& run) -> const Trajectory& { return run.models[i].robust_estimate; });
  }
  json["satellites"] = satellites_json(runs, 0);
  json["satellites_as_printed"] = satellites_json(runs, 1);
  return json;
}

std::string text_of(const nlohmann::json& number, double factor, int digits) {
  if (number.is_null()) return "-";
  std::ostringstream text;
  text << std::fixed << std::setprecision(digits) << factor * number.get<double>();
  return text.str();
}

void print(const std::string& scenario, const nlohmann::json& json) {
  const auto& error = json["fix_error_m"];
  std::cout << "\n== " << scenario << ": fix error mean " << text_of(error["mean"], 1, 2) << " m, median "
            << text_of(error["median"], 1, 2) << ", 95 % " << text_of(error["p95"], 1, 2) << ", max "
            << text_of(error["max"], 1, 1) << '\n';
  std::cout
      << "Table I                  correct  of good  of bad   good>good  good>bad  bad>good   bad>bad   with map   "
         "satellites: direct>free  hidden>blocked  known direct/hidden\n";
  for (const ComparedModel& each : kComparedModels) {
    if (each.model == CovarianceModel::kConventional) continue;
    const auto& c = json["classification"][each.name];
    const auto& s = json[each.is_as_printed ? "satellites_as_printed" : "satellites"];
    std::cout << std::left << std::setw(23) << each.name << std::right << std::setw(7) << text_of(c["correct"], 100, 1)
              << " %" << std::setw(7) << text_of(c["correct_of_good"], 100, 1) << " %" << std::setw(6)
              << text_of(c["correct_of_bad"], 100, 1) << " %";
    for (const char* count : {"good_called_good", "good_called_bad", "bad_called_good", "bad_called_bad"})
      std::cout << std::setw(10) << text_of(c[count], 1, 0);
    std::cout << std::setw(9) << text_of(c["with_map"], 100, 1) << " %" << std::setw(22)
              << text_of(s["direct_called_free"], 100, 1) << " %" << std::setw(13)
              << text_of(s["hidden_called_blocked"], 100, 1) << " %   " << text_of(s["known_of_direct"], 1, 2) << " / "
              << text_of(s["known_of_hidden"], 1, 2) << '\n';
  }
  std::cout << "Table II                 position, m      max     orientation, deg   coverage   fix NEES (2): mean, of "
               "good, of bad\n";
  std::vector<std::string> rows{"odometry", "claimed"};
  for (const ComparedModel& each : kComparedModels) rows.emplace_back(each.name);
  for (const std::string& name : rows) {
    std::cout << std::left << std::setw(23) << name << std::right;
    if (json["trajectory"].contains(name)) {
      const auto& t = json["trajectory"][name];
      std::cout << std::setw(8) << text_of(t["position_mean_m"], 1, 2) << " +- " << std::setw(5)
                << text_of(t["position_sigma_m"], 1, 2) << std::setw(9) << text_of(t["position_max_m"], 1, 1)
                << std::setw(11) << text_of(t["heading_mean_rad"], radians_to_degrees(1.0), 2) << " +- " << std::setw(5)
                << text_of(t["heading_sigma_rad"], radians_to_degrees(1.0), 2) << std::setw(11)
                << text_of(t["coverage"], 100, 1) << " %";
    } else {
      std::cout << std::setw(59) << "";
    }
    if (json["fix_nees"].contains(name)) {
      const auto& n = json["fix_nees"][name];
      std::cout << std::setw(10) << text_of(n["mean"], 1, 2) << std::setw(9) << text_of(n["mean_of_good"], 1, 2)
                << std::setw(9) << text_of(n["mean_of_bad"], 1, 2);
    }
    std::cout << '\n';
  }
  std::cout << "With a Student-t UKF: position, m";
  for (const auto& [name, t] : json["trajectory_student_t"].items()) {
    std::cout << "   " << name << ' ' << text_of(t["position_mean_m"], 1, 2);
  }
  std::cout << '\n';
}

void run_all(const Options& options, const std::string& command, const InputFiles& inputs) {
  const OcclusionExperimentConditions conditions = read_conditions(options);
  const auto start = std::chrono::steady_clock::now();
  const std::vector<std::vector<OcclusionRun>> results =
      run_scenarios(options.runs, [&](const Scenario& scenario, const std::function<void(double)>& on_progress) {
        return run_occlusion_experiment(scenario, conditions, on_progress);
      });

  nlohmann::json metrics;
  metrics["command"] = command;
  metrics["wall_s"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  metrics["seeds"] = options.runs.seeds();
  for (std::size_t i = 0; i < results.size(); ++i) {
    const std::string name = fs::path(options.runs.scenarios[i]).stem().string();
    metrics["scenarios"][name] = scenario_json(results[i]);
    print(name, metrics["scenarios"][name]);
    if (!options.series_directory.empty()) write_series(options.series_directory, inputs, name, results[i].front());
  }
  if (!options.json_file.empty())
    write_file(options.json_file, inputs, [&](std::ostream& out) { out << metrics.dump(2) << '\n'; });
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CommandLine line("occlusion_experiment", "Tables I and II of Maier and Kleiner (2010) on simulated scenarios.");
  line.add_scenarios(options.runs.scenarios, options.runs.overrides);
  line.add_seeds(options.runs.seed_count, options.runs.first_seed);
  line.add_duration(options.runs.duration_s);
  line.app()
      .add_option("--cloud-every", options.cloud_every, "of a spinning lidar's scans, use one in so many")
      ->check(CLI::PositiveNumber);
  line.app().add_option("--occlusion", options.occlusion_file,
                        "parameters of the occlusion node; default: config/occlusion_simulator.yaml of the package");
  line.add_set("--set", options.occlusion_overrides, "a parameter of the occlusion node");
  line.add_set("--ukf-set", options.ukf_overrides, "a parameter of ukf or localization");
  line.add_json(options.json_file);
  line.add_output_folder("--series", options.series_directory,
                         "write the first seed's fixes and trajectories here as CSV, for figures");
  line.add_jobs(options.runs.jobs);
  return line.run(argc, argv, [&] {
    line.reads(options.runs.files());
    if (options.occlusion_file.empty()) line.reads(package_path() / "config");
    run_all(options, line.command(), line.inputs());
  });
}
