// Figure 6 of Kim et al. on a simulated scenario: the complementary filter without compensation, with a gate and with
// compensation of the fix's bias, with truth.

#include "urban_gnss_localization/experiments/bias_experiment.hpp"

#include <array>
#include <chrono>
#include <cmath>
#include <exception>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "command_line.hpp"
#include "files/output_file.hpp"
#include "overrides.hpp"
#include "scenario_runs.hpp"
#include "urban_gnss_localization/evaluation/report_json.hpp"
#include "urban_gnss_localization/evaluation/statistics.hpp"
#include "urban_gnss_localization/evaluation/trajectory_errors.hpp"
#include "urban_gnss_localization/ros/plotting.hpp"

namespace fs = std::filesystem;
using namespace urban_gnss;

namespace {

constexpr std::array<const char*, 3> kPhases{"before", "between", "after"};  ///< as phase_of counts

struct Options {
  ScenarioRuns runs{{"building_pass_dgps", "sudden_bias", "building_pass", "open_sky"}};
  std::vector<std::string> overrides;
  std::string json_file;
  std::string plots;
};

nlohmann::json contestant_json(const std::vector<BiasRun>& runs, std::size_t contestant) {
  std::array<std::vector<double>, kPhases.size()> position;
  std::array<std::vector<double>, kPhases.size()> heading;
  std::array<std::vector<double>, kPhases.size()> nees;
  std::array<double, kPhases.size()> fixes{};
  std::array<double, kPhases.size()> alarms{};
  std::array<double, kPhases.size()> doubted{};
  nlohmann::json json;
  for (const BiasRun& run : runs) {
    const BiasContestantRun& of_run = run.contestants[contestant];
    std::array<std::vector<double>, kPhases.size()> of_seed;
    for (const ErrorSample& sample : errors_at_truth(run.truth, of_run.estimate).samples) {
      const std::size_t phase = phase_of(run, sample.stamp);
      position[phase].push_back(sample.position_error_m);
      of_seed[phase].push_back(sample.position_error_m);
      heading[phase].push_back(std::abs(sample.heading_error_rad));
      if (std::isfinite(sample.nees)) nees[phase].push_back(sample.nees);
    }
    for (std::size_t phase = 0; phase < kPhases.size(); ++phase) {
      json[kPhases[phase]]["position_mean_by_seed_m"].push_back(number_or_null(summarize(of_seed[phase]).mean));
    }
    bool was_doubted = false;
    for (const BiasEstimate& bias : of_run.biases) {
      const FixDecision decision = bias.outcome.decision;
      if (decision == FixDecision::kNotExamined) continue;
      const std::size_t phase = phase_of(run, bias.stamp);
      const bool is_doubted = decision == FixDecision::kBiasCompensated || is_rejected(decision);
      fixes[phase] += 1.0;
      doubted[phase] += is_doubted ? 1.0 : 0.0;
      alarms[phase] += is_doubted && !was_doubted ? 1.0 : 0.0;
      was_doubted = is_doubted;
    }
    const auto settled = settling_time_s(run, of_run.biases);
    json["settling_time_by_seed_s"].push_back(settled ? nlohmann::json(*settled) : nlohmann::json());
  }
  for (std::size_t phase = 0; phase < kPhases.size(); ++phase) {
    const Summary p = summarize(std::move(position[phase]));
    nlohmann::json& of_phase = json[kPhases[phase]];
    of_phase["position_mean_m"] = number_or_null(p.mean);
    of_phase["position_p95_m"] = number_or_null(p.p95);
    of_phase["position_max_m"] = number_or_null(p.max);
    of_phase["heading_mean_rad"] = number_or_null(summarize(std::move(heading[phase])).mean);
    of_phase["nees_mean"] = number_or_null(summarize(std::move(nees[phase])).mean);
    of_phase["fixes"] = fixes[phase];
    of_phase["alarms"] = alarms[phase];
    of_phase["doubted_share"] = number_or_null(doubted[phase] / fixes[phase]);
  }
  return json;
}

nlohmann::json scenario_json(const std::vector<BiasRun>& runs) {
  nlohmann::json json;
  std::array<std::vector<double>, kPhases.size()> errors;
  for (const BiasRun& run : runs) {
    for (const auto& [stamp, error] : run.fix_errors) errors[phase_of(run, stamp)].push_back(error.norm());
  }
  for (std::size_t phase = 0; phase < kPhases.size(); ++phase) {
    const Summary summary = summarize(std::move(errors[phase]));
    json["fixes"][kPhases[phase]] = {{"position_mean_m", number_or_null(summary.mean)},
                                     {"position_p95_m", number_or_null(summary.p95)},
                                     {"position_max_m", number_or_null(summary.max)}};
  }
  for (std::size_t i = 0; i < kBiasContestants.size(); ++i) {
    json["filters"][kBiasContestants[i].name] = contestant_json(runs, i);
  }
  return json;
}

std::string text_of(const nlohmann::json& number, int digits) {
  if (number.is_null()) return "-";
  std::ostringstream text;
  text << std::fixed << std::setprecision(digits) << number.get<double>();
  return text.str();
}

void print(const std::string& scenario, const nlohmann::json& json) {
  std::cout << "\n== " << scenario << '\n'
            << std::left << std::setw(22) << "" << std::right << "  mean error, m: before between   after"
            << "   max between   NEES (3): before between   after   doubted, %: before between   after"
            << "   settled after, s\n";
  std::vector<std::string> names{"fixes"};
  for (const BiasContestant& contestant : kBiasContestants) names.emplace_back(contestant.name);
  for (const std::string& name : names) {
    const bool is_filter = json["filters"].contains(name);
    const nlohmann::json& of_name = is_filter ? json["filters"][name] : json["fixes"];
    std::cout << std::left << std::setw(22) << name << std::right << std::setw(22);
    for (const char* phase : kPhases) std::cout << text_of(of_name[phase]["position_mean_m"], 2) << std::setw(8);
    std::cout << std::setw(14) << text_of(of_name["between"]["position_max_m"], 1);
    if (is_filter) {
      std::cout << std::setw(18);
      for (const char* phase : kPhases) std::cout << text_of(of_name[phase]["nees_mean"], 2) << std::setw(8);
      std::cout << std::setw(20);
      for (const char* phase : kPhases) {
        const auto& share = of_name[phase]["doubted_share"];
        std::cout << (share.is_null() ? "-" : text_of(100.0 * share.get<double>(), 2)) << std::setw(8);
      }
      std::cout << std::setw(3);
      for (const auto& settled : of_name["settling_time_by_seed_s"]) std::cout << ' ' << text_of(settled, 0);
    }
    std::cout << '\n';
  }
}

void write_series(const fs::path& directory, const InputFiles& inputs, const BiasRun& run) {
  const Stamp start = run.truth.front().stamp;
  const auto seconds = [&](Stamp stamp) { return to_seconds(stamp - start); };
  write_file(directory / "truth.csv", inputs, [&](std::ostream& out) {
    out << "t,x,y,phase\n" << std::setprecision(9);
    for (const TimedPose& pose : run.truth) {
      out << seconds(pose.stamp) << ',' << pose.pose.x << ',' << pose.pose.y << ',' << phase_of(run, pose.stamp)
          << '\n';
    }
  });
  write_file(directory / "fixes.csv", inputs, [&](std::ostream& out) {
    out << "t,error_x,error_y\n" << std::setprecision(9);
    for (const auto& [stamp, error] : run.fix_errors)
      out << seconds(stamp) << ',' << error.x() << ',' << error.y() << '\n';
  });
  for (std::size_t i = 0; i < kBiasContestants.size(); ++i) {
    const BiasContestantRun& contestant = run.contestants[i];
    const std::string name = kBiasContestants[i].name;
    write_file(directory / ("estimate_" + name + ".csv"), inputs, [&](std::ostream& out) {
      out << "t,x,y,error_m,sigma_m\n" << std::setprecision(9);
      for (const ErrorSample& sample : errors_at_truth(run.truth, contestant.estimate).samples) {
        out << seconds(sample.stamp) << ',' << sample.estimate.x << ',' << sample.estimate.y << ','
            << sample.position_error_m << ',' << sample.position_sigma_m << '\n';
      }
    });
    write_file(directory / ("bias_" + name + ".csv"), inputs, [&](std::ostream& out) {
      out << "t,bias_x,bias_y,sigma_x,sigma_y,significant,doubted\n" << std::setprecision(9);
      for (const BiasEstimate& bias : contestant.biases) {
        const FixDecision decision = bias.outcome.decision;
        out << seconds(bias.stamp) << ',' << bias.bias.x() << ',' << bias.bias.y() << ','
            << std::sqrt(bias.covariance(0, 0)) << ',' << std::sqrt(bias.covariance(1, 1)) << ',' << bias.in_shadow
            << ',' << (decision == FixDecision::kBiasCompensated || is_rejected(decision)) << '\n';
      }
    });
  }
}

void run_all(const Options& options, const std::string& command, const InputFiles& inputs) {
  BiasExperimentConditions conditions;
  read_overrides("--set", YAML::Node(YAML::NodeType::Map), options.overrides, conditions.filter,
                 conditions.localization);
  const auto start = std::chrono::steady_clock::now();
  const std::vector<std::vector<BiasRun>> results =
      run_scenarios(options.runs, [&](const Scenario& scenario, const std::function<void(double)>& on_progress) {
        BiasRun run = run_bias_experiment(scenario, conditions);
        on_progress(1.0);
        return run;
      });

  nlohmann::json metrics;
  metrics["command"] = command;
  metrics["wall_s"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  metrics["seeds"] = options.runs.seeds();
  for (std::size_t i = 0; i < results.size(); ++i) {
    const std::string name = fs::path(options.runs.scenarios[i]).stem().string();
    metrics["scenario_order"].push_back(name);
    metrics["scenarios"][name] = scenario_json(results[i]);
    print(name, metrics["scenarios"][name]);
    if (!options.plots.empty()) write_series(fs::path(options.plots) / "data" / name, inputs, results[i].front());
  }
  const auto write_json = [&](const fs::path& file) {
    write_file(file, inputs, [&](std::ostream& out) { out << metrics.dump(2) << '\n'; });
  };
  if (!options.json_file.empty()) write_json(options.json_file);
  if (options.plots.empty()) return;
  write_json(fs::path(options.plots) / "metrics.json");
  run_plotter("plot_bias_experiment.py", options.plots);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CommandLine line("bias_experiment",
                   "Figure 6 of Kim et al. on simulated scenarios: every filter on the same measurements.");
  line.add_scenarios(options.runs.scenarios, options.runs.overrides);
  line.add_seeds(options.runs.seed_count, options.runs.first_seed);
  line.add_set("--set", options.overrides, "a parameter of complementary_ekf or localization");
  line.add_json(options.json_file);
  line.add_output_folder("--plots", options.plots, "write figure, table and their data into this folder");
  line.add_jobs(options.runs.jobs);
  return line.run(argc, argv, [&] {
    line.reads(options.runs.files());
    run_all(options, line.command(), line.inputs());
  });
}
