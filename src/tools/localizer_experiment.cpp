// Localizers on simulated scenarios: every one on the same drives, with their errors against the truth.

#include "urban_gnss_localization/experiments/localizer_experiment.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "find_scenario.hpp"
#include "output_file.hpp"
#include "parallel_jobs.hpp"
#include "urban_gnss_localization/evaluation/report_json.hpp"
#include "urban_gnss_localization/localizers/kim/complementary_ekf.hpp"
#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"
#include "urban_gnss_localization/localizers/switching/switching_particle_filter.hpp"
#include "urban_gnss_localization/localizers/maier/ukf.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"

namespace fs = std::filesystem;
using namespace urban_gnss;

namespace {

const std::string kWithOcclusion = "+occlusion";

struct Options {
  std::vector<std::string> scenarios{"downtown_grid", "campus_loop", "building_pass", "open_sky", "tunnel"};
  std::vector<std::string> localizers{
      "paper",         "ekf",     "gated_ekf",         "complementary_ekf", "ukf",
      "ukf+occlusion", "imm_ekf", "imm_ekf+occlusion", "switching",         "switching+occlusion"};
  int seeds = 10;
  int first_seed = 1;
  double duration_s = 0.0;
  std::vector<std::string> overrides;
  std::vector<std::string> scenario_overrides;
  std::string json_file;
  int jobs = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
};

/// Everything with a name in --set.
struct Settings {
  LocalizerExperimentConditions conditions;
  ParticleFilterParameters particle_filter;
  MotionParameters particle_filter_motion;
  ComplementaryEkfParameters complementary_ekf;
  UkfParameters ukf;
  MotionParameters ukf_motion;
  ImmEkfParameters imm_ekf;
  MotionParameters imm_ekf_motion;
};

Settings read_settings(const std::vector<std::string>& overrides) {
  std::map<std::string, YAML::Node> sections;
  for (const std::string& text : overrides) {
    const auto dot = text.find('.');
    const auto equal = text.find('=');
    if (equal == std::string::npos || dot == std::string::npos || dot > equal) {
      throw std::runtime_error("--set " + text + ": must be SECTION.NAME=VALUE, e.g. ukf.student_dof=3");
    }
    sections[text.substr(0, dot)][text.substr(dot + 1, equal - dot - 1)] = YAML::Load(text.substr(equal + 1));
  }
  Settings settings;
  std::vector<std::string> faults;
  const auto read = [&](const std::string& section, auto&... parameters) {
    const auto found = sections.find(section);
    if (found == sections.end()) return;
    ParameterReader reader(found->second);
    (reader.read(parameters), ...);
    for (const std::string& fault : reader.finish()) faults.push_back(section + "." + fault);
    sections.erase(found);
  };
  read("localization", settings.conditions.localization);
  read("occlusion", settings.conditions.occlusion);
  read("gps_bias", settings.conditions.bias);
  read("particle_filter", settings.particle_filter, settings.particle_filter_motion);
  read("complementary_ekf", settings.complementary_ekf);
  read("ukf", settings.ukf, settings.ukf_motion);
  read("imm_ekf", settings.imm_ekf, settings.imm_ekf_motion);
  for (const auto& [section, values] : sections) faults.push_back(section + ": no such section");
  if (!faults.empty()) throw ParameterError("--set", faults);
  return settings;
}

std::function<std::unique_ptr<Localizer>()> localizer_of(const std::string& name, const Settings& settings) {
  const auto complementary = [&settings](ComplementaryMode mode) {
    ComplementaryEkfParameters parameters = settings.complementary_ekf;
    parameters.mode = mode;
    return [parameters] { return std::make_unique<ComplementaryEkf>(parameters); };
  };
  if (name == "paper" || name == "switching") {
    ParticleFilterParameters parameters = settings.particle_filter;
    parameters.mode = name == "paper" ? ParticleFilterMode::kPaper : ParticleFilterMode::kSwitching;
    return [parameters, &settings] { return make_particle_filter(parameters, settings.particle_filter_motion); };
  }
  if (name == "imm_ekf") {
    return [&settings] { return std::make_unique<ImmEkf>(settings.imm_ekf, settings.imm_ekf_motion); };
  }
  if (name == "ekf") return complementary(ComplementaryMode::kStandard);
  if (name == "gated_ekf") return complementary(ComplementaryMode::kGated);
  if (name == "complementary_ekf") return complementary(ComplementaryMode::kCompensated);
  if (name == "ukf") return [&settings] { return std::make_unique<Ukf>(settings.ukf, settings.ukf_motion); };
  throw std::runtime_error(
      "--localizers " + name +
      ": no such localizer; there are paper, switching, ekf, gated_ekf, complementary_ekf, ukf, imm_ekf, each also "
      "with " +
      kWithOcclusion);
}

std::vector<Contender> select_contenders(const std::vector<std::string>& names, const Settings& settings) {
  std::vector<Contender> contenders;
  for (const std::string& name : names) {
    Contender contender;
    contender.name = name;
    const auto plus = name.rfind(kWithOcclusion);
    contender.uses_occlusion = plus != std::string::npos && plus + kWithOcclusion.size() == name.size();
    contender.make = localizer_of(contender.uses_occlusion ? name.substr(0, plus) : name, settings);
    contenders.push_back(contender);
  }
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

void print_row(const std::string& name, const ContenderSummary& s) {
  const auto cell = [](double value, int width, int digits) {
    std::ostringstream text;
    if (std::isnan(value)) {
      text << '-';
    } else {
      text << std::fixed << std::setprecision(digits) << value;
    }
    std::cout << std::setw(width) << text.str();
  };
  std::cout << std::left << std::setw(28) << name << std::right;
  for (const double metres : {s.position_m.rmse, s.position_m.median, s.position_m.p95, s.position_m.max}) {
    cell(metres, 9, 2);
  }
  cell(radians_to_degrees(s.heading_rmse_rad), 13, 2);
  cell(s.nees_mean, 9, 2);
  cell(100.0 * s.coverage, 10, 1);
  std::cout << std::setw(10) << s.diverged;
  cell(s.reacquisition_s, 12, 1);
  std::cout << '\n';
}

void run_all(const Options& options, const std::string& command) {
  const Settings settings = read_settings(options.overrides);
  const std::vector<Contender> contenders = select_contenders(options.localizers, settings);
  const auto seeds = static_cast<std::size_t>(options.seeds);
  std::vector<std::vector<LocalizerRun>> runs(options.scenarios.size(), std::vector<LocalizerRun>(seeds));
  const auto start = std::chrono::steady_clock::now();
  const auto label = [&](std::size_t index) { return options.scenarios[index / seeds]; };
  run_jobs(runs.size() * seeds, options.jobs, label,
           [&](std::size_t index, const std::function<void(double)>& on_progress) {
             const std::size_t i = index / seeds;
             const std::size_t s = index % seeds;
             std::vector<std::string> overrides = options.scenario_overrides;
             overrides.push_back("seed=" + std::to_string(options.first_seed + static_cast<int>(s)));
             if (options.duration_s > 0.0) overrides.push_back("duration=" + std::to_string(options.duration_s));
             const Scenario scenario = load_scenario(find_scenario(options.scenarios[i]).string(), overrides);
             runs[i][s] = run_localizer_experiment(scenario, contenders, settings.conditions, on_progress);
           });

  nlohmann::json metrics;
  metrics["command"] = command;
  metrics["wall_s"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  for (std::size_t s = 0; s < seeds; ++s) metrics["seeds"].push_back(options.first_seed + static_cast<int>(s));
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const std::string name = fs::path(options.scenarios[i]).stem().string();
    std::cout << "\n== " << name << '\n'
              << std::left << std::setw(28) << "position error, m" << std::right
              << "     rmse   median      p95      max  heading, deg     NEES  coverage  diverged  back after\n";
    for (std::size_t c = 0; c < contenders.size(); ++c) {
      const ContenderSummary summary = summarize_contender(runs[i], c);
      print_row(contenders[c].name, summary);
      metrics["scenarios"][name][contenders[c].name] = to_json(summary);
    }
  }
  std::cout
      << "\nheading: root mean square; a consistent estimate has a NEES of 3; coverage in %; diverged: drives with "
         "an error beyond "
      << kDiverged_m << " m; back after: s until the error was below " << kGoodFix_m
      << " m again after an outage's first good fix, at worst\n";
  if (!options.json_file.empty())
    write_file(options.json_file, [&](std::ostream& out) { out << metrics.dump(2) << '\n'; });
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("Localizers on simulated scenarios, with their errors against the truth.");
  app.option_defaults()->always_capture_default();
  app.add_option("--scenarios", options.scenarios, "files, or names of the package's; comma-separated")->delimiter(',');
  app.add_option("--localizers", options.localizers,
                 "comma-separated; NAME" + kWithOcclusion + ": with the covariances of the occlusion node")
      ->delimiter(',');
  app.add_option("--seeds", options.seeds, "how many seeds")->check(CLI::PositiveNumber);
  app.add_option("--first-seed", options.first_seed, "the first of them")->check(CLI::NonNegativeNumber);
  app.add_option("--duration", options.duration_s, "s to simulate at most; default: the scenario's")
      ->check(CLI::PositiveNumber);
  app.add_option("--set", options.overrides,
                 "another parameter, SECTION.NAME=VALUE with the section localization, occlusion, gps_bias or a "
                 "localizer's; repeatable");
  app.add_option("--scenario-set", options.scenario_overrides,
                 "a value of the scenario, SECTION.NAME=VALUE; repeatable");
  app.add_option("--json", options.json_file, "write the metrics here");
  app.add_option("--jobs", options.jobs, "threads")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  std::string command = "rosrun urban_gnss_localization localizer_experiment";
  for (int i = 1; i < argc; ++i) command += std::string(" ") + argv[i];
  try {
    run_all(options, command);
  } catch (const std::exception& error) {
    std::cerr << "localizer_experiment: " << error.what() << '\n';
    return 1;
  }
  return 0;
}
