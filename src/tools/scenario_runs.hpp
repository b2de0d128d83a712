#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <type_traits>
#include <vector>

#include "find_scenario.hpp"
#include "parallel_jobs.hpp"
#include "urban_gnss_localization/simulation/scenario.hpp"

namespace urban_gnss {

/// The drives of a Monte-Carlo experiment: every scenario with every seed.
struct ScenarioRuns {
  std::vector<std::string> scenarios;    ///< files, or names of the package's
  std::vector<std::string> overrides{};  ///< of every scenario, as --scenario-set takes them
  int seed_count = 10;
  int first_seed = 1;
  double duration_s = 0.0;  ///< at most; 0: the scenario's
  int jobs = 1;             ///< threads

  std::vector<int> seeds() const {
    std::vector<int> all;
    for (int i = 0; i < seed_count; ++i) all.push_back(first_seed + i);
    return all;
  }
  /// The files that the runs read.
  std::vector<std::filesystem::path> files() const {
    std::vector<std::filesystem::path> all;
    for (const std::string& scenario : scenarios) {
      const auto of_one = files_of_scenario(scenario);
      all.insert(all.end(), of_one.begin(), of_one.end());
    }
    return all;
  }
  Scenario load(const std::string& scenario, int seed) const {
    std::vector<std::string> all = overrides;
    all.push_back("seed=" + std::to_string(seed));
    if (duration_s > 0.0) all.push_back("duration=" + std::to_string(duration_s));
    return load_scenario(find_scenario(scenario).string(), all);
  }
};

/// Calls experiment(scenario, on_progress) for every scenario with every seed, in parallel. What it gives, by scenario
/// and seed. Throws the first exception of an experiment, and what find_scenario and load_scenario throw.
template <class Experiment>
auto run_scenarios(const ScenarioRuns& runs, const Experiment& experiment) {
  using OnProgress = std::function<void(double)>;
  using Result = std::invoke_result_t<const Experiment&, const Scenario&, const OnProgress&>;
  const std::vector<int> seeds = runs.seeds();
  std::vector<std::vector<Result>> results(runs.scenarios.size(), std::vector<Result>(seeds.size()));
  run_jobs(
      results.size() * seeds.size(), runs.jobs, [&](std::size_t index) { return runs.scenarios[index / seeds.size()]; },
      [&](std::size_t index, const OnProgress& on_progress) {
        const std::size_t i = index / seeds.size();
        const std::size_t s = index % seeds.size();
        results[i][s] = experiment(runs.load(runs.scenarios[i], seeds[s]), on_progress);
      });
  return results;
}

}  // namespace urban_gnss
