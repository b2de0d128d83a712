// Localizers on simulated scenarios: every one on the same drives, with their errors against the truth; or what faults
// of their inputs do to them.

#include "urban_gnss_localization/experiments/localizer_experiment.hpp"

#include <algorithm>
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
#include "urban_gnss_localization/experiments/fault_experiment.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/localizers/registry.hpp"
#include "urban_gnss_localization/pipeline/bias_pipeline.hpp"

namespace fs = std::filesystem;
using namespace urban_gnss;

namespace {

const std::string kWithOcclusion = "+occlusion";

struct Options {
  ScenarioRuns runs{{"downtown_grid", "campus_loop", "building_pass", "open_sky", "tunnel"}};
  std::vector<std::string> localizers;
  std::vector<std::string> overrides;
  std::string json_file;
  bool faults = false;
  double fault_onset_s = 60.0;
};

/// All variants of the registry, and after each that gains from it the same behind the occlusion node.
std::vector<std::string> default_localizers(const LocalizerRegistry& registry) {
  std::vector<std::string> names;
  for (const LocalizerVariant& variant : registry.variants()) {
    names.push_back(variant.name);
    if (variant.with_occlusion) names.push_back(variant.name + kWithOcclusion);
  }
  return names;
}

/// What --set says, by section: localization, occlusion, gps_bias or a localizer's name.
YAML::Node read_sections(const std::vector<std::string>& overrides, const LocalizerRegistry& registry) {
  std::vector<std::string> known{"localization", "occlusion", "gps_bias"};
  for (const LocalizerEntry& entry : registry.entries()) known.push_back(entry.name);
  YAML::Node sections(YAML::NodeType::Map);
  for (const std::string& text : overrides) {
    const std::string section = text.substr(0, text.find_first_of(".="));
    if (std::find(known.begin(), known.end(), section) == known.end()) {
      throw std::runtime_error("--set " + text + ": must be SECTION.NAME=VALUE, e.g. ukf.outliers=gate");
    }
    assign(sections, text);
  }
  for (const std::string& name : known) {
    if (!sections[name].IsDefined()) sections[name] = YAML::Node(YAML::NodeType::Map);
  }
  return sections;
}

LocalizerExperimentConditions read_conditions(const YAML::Node& sections) {
  LocalizerExperimentConditions conditions;
  read_overrides("--set localization", sections["localization"], {}, conditions.localization);
  read_overrides("--set occlusion", sections["occlusion"], {}, conditions.occlusion);
  BiasPipelineParameters gps_bias;
  read_overrides("--set gps_bias", sections["gps_bias"], {}, gps_bias);
  conditions.bias = gps_bias.bias;
  return conditions;
}

Contender make_contender(const std::string& name, const LocalizerRegistry& registry, const YAML::Node& sections) {
  Contender contender;
  contender.name = name;
  const auto plus = name.rfind(kWithOcclusion);
  contender.uses_occlusion = plus != std::string::npos && plus + kWithOcclusion.size() == name.size();
  const LocalizerChoice choice = registry.choose(contender.uses_occlusion ? name.substr(0, plus) : name);
  const std::shared_ptr<LocalizerSettings> settings = choice.entry->settings();
  read_overrides("--set " + choice.entry->name, YAML::Clone(sections[choice.entry->name]), choice.assignments,
                 *settings);
  contender.make = [settings] { return settings->make(); };
  return contender;
}

std::vector<Contender> select_contenders(const Options& options, const YAML::Node& sections) {
  const LocalizerRegistry registry = standard_localizers();
  std::vector<Contender> contenders;
  for (const std::string& name : options.localizers) contenders.push_back(make_contender(name, registry, sections));
  return contenders;
}

nlohmann::json to_json(const ContenderSummary& summary) {
  nlohmann::json json = {{"rmse_m", number_or_null(summary.position_m.rmse)},
                         {"median_m", number_or_null(summary.position_m.median)},
                         {"p95_m", number_or_null(summary.position_m.p95)},
                         {"max_m", number_or_null(summary.position_m.max)},
                         {"heading_rmse_rad", number_or_null(summary.heading_rmse_rad)},
                         {"nees_mean", number_or_null(summary.nees_mean)},
                         {"coverage", number_or_null(summary.coverage)},
                         {"diverged", summary.diverged},
                         {"reacquisition_s", number_or_null(summary.reacquisition_s)}};
  for (const double rmse : summary.rmse_m) json["rmse_by_seed_m"].push_back(number_or_null(rmse));
  return json;
}

/// A number that is not known is a dash, an infinite one `if_infinite`.
void print_cell(double value, int width, int digits, const std::string& if_infinite = "inf") {
  std::ostringstream text;
  if (std::isnan(value)) {
    text << '-';
  } else if (std::isinf(value)) {
    text << if_infinite;
  } else {
    text << std::fixed << std::setprecision(digits) << value;
  }
  std::cout << std::setw(width) << text.str();
}

void print_row(const std::string& name, const ContenderSummary& s) {
  std::cout << std::left << std::setw(28) << name << std::right;
  for (const double metres : {s.position_m.rmse, s.position_m.median, s.position_m.p95, s.position_m.max}) {
    print_cell(metres, 9, 2);
  }
  print_cell(radians_to_degrees(s.heading_rmse_rad), 13, 2);
  print_cell(s.nees_mean, 9, 2);
  print_cell(100.0 * s.coverage, 10, 1);
  std::cout << std::setw(10) << s.diverged;
  print_cell(s.reacquisition_s, 12, 1);
  std::cout << '\n';
}

/// Prints the errors of every contender in one scenario. The same as JSON.
nlohmann::json report_errors(const std::vector<Contender>& contenders, const std::vector<LocalizerRun>& runs) {
  std::cout << std::left << std::setw(28) << "position error, m" << std::right
            << "     rmse   median      p95      max  heading, deg     NEES  coverage  diverged  back after\n";
  nlohmann::json json;
  for (std::size_t c = 0; c < contenders.size(); ++c) {
    const ContenderSummary summary = summarize_contender(runs, c);
    print_row(contenders[c].name, summary);
    json[contenders[c].name] = to_json(summary);
  }
  return json;
}

nlohmann::json to_json(const FaultScore& score) {
  return {{"unhealthy_after_s", number_or_null(score.unhealthy_after_s)},
          {"worst_while_healthy_m", number_or_null(score.worst_while_healthy_m)},
          {"recovery_s", number_or_null(score.recovery_s)},
          {"inside_95", number_or_null(score.inside_95)},
          {"worst_m", number_or_null(score.worst_m)}};
}

void print_row(const std::string& fault, const std::string& name, const FaultScore& s) {
  std::cout << std::left << std::setw(20) << fault << std::setw(28) << name << std::right;
  print_cell(s.unhealthy_after_s, 15, 1, "-");
  print_cell(s.worst_while_healthy_m, 18, 1);
  print_cell(s.recovery_s, 12, 1, "never");
  print_cell(s.inside_95, 11, 2);
  print_cell(s.worst_m, 9, 1);
  std::cout << '\n';
}

/// Prints what every fault did to every contender in one scenario. The same as JSON, with that of each seed.
nlohmann::json report_faults(const std::vector<Contender>& contenders,
                             const std::vector<std::vector<FaultResult>>& drives) {
  std::cout << std::left << std::setw(20) << "fault" << std::setw(28) << "localizer" << std::right
            << "unhealthy in, s  worst healthy, m  back in, s  inside 95   max, m\n";
  nlohmann::json json;
  for (std::size_t f = 0; f < drives.front().size(); ++f) {
    const std::string& fault = drives.front()[f].fault;
    for (std::size_t c = 0; c < contenders.size(); ++c) {
      std::vector<FaultScore> scores;
      for (const std::vector<FaultResult>& drive : drives) scores.push_back(drive[f].scores[c]);
      const FaultScore worst = worst_of(scores);
      print_row(fault, contenders[c].name, worst);
      nlohmann::json& cell = json[fault][contenders[c].name] = to_json(worst);
      for (const FaultScore& score : scores) cell["by_seed"].push_back(to_json(score));
    }
  }
  return json;
}

/// Runs the experiment in all scenarios with all seeds, reports on each scenario, and writes the file of --json.
template <class Experiment, class Report>
void run_and_report(const Options& options, const std::string& command, const Experiment& experiment,
                    const Report& report, const InputFiles& inputs) {
  const auto start = std::chrono::steady_clock::now();
  const auto runs = run_scenarios(options.runs, experiment);
  nlohmann::json metrics;
  metrics["command"] = command;
  metrics["wall_s"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  metrics["seeds"] = options.runs.seeds();
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const std::string name = fs::path(options.runs.scenarios[i]).stem().string();
    std::cout << "\n== " << name << '\n';
    metrics["scenarios"][name] = report(runs[i]);
  }
  if (options.json_file.empty()) return;
  write_file(options.json_file, inputs, [&](std::ostream& out) { out << metrics.dump(2) << '\n'; });
}

using OnProgress = std::function<void(double)>;

void run_plain(const Options& options, const std::string& command, const std::vector<Contender>& contenders,
               const LocalizerExperimentConditions& conditions, const InputFiles& inputs) {
  const auto experiment = [&](const Scenario& scenario, const OnProgress& on_progress) {
    return run_localizer_experiment(scenario, contenders, conditions, on_progress);
  };
  run_and_report(
      options, command, experiment, [&](const auto& drives) { return report_errors(contenders, drives); }, inputs);
  std::cout << "\nheading: root mean square; a consistent estimate has a NEES of 3, one that is too sure of itself "
               "more; coverage in %; diverged: drives with "
               "an error beyond "
            << kDiverged_m << " m; back after: s until the error was below " << kGoodFix_m
            << " m again after an outage's first good fix, at worst\n";
}

void run_faults(const Options& options, const std::string& command, const std::vector<Contender>& contenders,
                const LocalizerExperimentConditions& conditions, const InputFiles& inputs) {
  const auto experiment = [&](const Scenario& scenario, const OnProgress& on_progress) {
    return run_fault_experiment(scenario, contenders, conditions, on_progress);
  };
  run_and_report(
      options, command, experiment, [&](const auto& drives) { return report_faults(contenders, drives); }, inputs);
  std::cout << "\nThe worst of the seeds, from the fault's onset on. unhealthy in: s from the onset; -: never. worst "
               "healthy: the largest error with a healthy status. back in: s from the fault's end until the estimate "
               "was healthy and good (error below "
            << kGoodFix_m << " m or twice the median without fault) for " << kRecovered_s
            << " s; -: the fault does not end. inside 95: share of the truth in the 95 % ellipse, mean of the seeds\n";
}

void run_all(const Options& options, const std::string& command, const InputFiles& inputs) {
  const YAML::Node sections = read_sections(options.overrides, standard_localizers());
  LocalizerExperimentConditions conditions = read_conditions(sections);
  conditions.fault_onset_s = options.fault_onset_s;
  (options.faults ? run_faults : run_plain)(options, command, select_contenders(options, sections), conditions, inputs);
}

/// With --faults, what the command line leaves open: every localizer without the occlusion node, on a drive of minutes.
void choose_fault_runs(CLI::App& app, Options& options) {
  if (app.count("--localizers") == 0) {
    options.localizers.clear();
    for (const LocalizerVariant& variant : standard_localizers().variants()) options.localizers.push_back(variant.name);
  }
  if (app.count("--scenarios") == 0) options.runs.scenarios = {"campus_loop"};
  if (app.count("--seeds") == 0) options.runs.seed_count = 4;
  if (app.count("--duration") == 0) options.runs.duration_s = 300.0;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  options.localizers = default_localizers(standard_localizers());
  CommandLine line("localizer_experiment", "Localizers on simulated scenarios, with their errors against the truth.");
  line.add_scenarios(options.runs.scenarios, options.runs.overrides);
  line.app()
      .add_option("--localizers", options.localizers,
                  "comma-separated, of " + standard_localizers().variant_names() + "; NAME" + kWithOcclusion +
                      ": with the covariances of the occlusion node")
      ->delimiter(',');
  line.add_seeds(options.runs.seed_count, options.runs.first_seed);
  line.add_duration(options.runs.duration_s);
  line.add_set("--set", options.overrides, "after localization., occlusion., gps_bias. or LOCALIZER., a parameter");
  line.add_json(options.json_file);
  line.add_jobs(options.runs.jobs);
  line.app().add_flag(
      "--faults", options.faults,
      "what faults of its inputs do to each localizer; by default without occlusion, 4 seeds, 300 s of campus_loop");
  line.app().add_option("--fault-onset", options.fault_onset_s, "s after the start")->check(CLI::NonNegativeNumber);
  return line.run(argc, argv, [&] {
    if (options.faults) choose_fault_runs(line.app(), options);
    line.reads(options.runs.files());
    run_all(options, line.command(), line.inputs());
  });
}
