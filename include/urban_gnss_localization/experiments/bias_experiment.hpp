#pragma once

#include <Eigen/Core>
#include <array>
#include <chrono>
#include <optional>
#include <utility>
#include <vector>

#include "urban_gnss_localization/evaluation/trajectory.hpp"
#include "urban_gnss_localization/localizers/kim/complementary_ekf.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"
#include "urban_gnss_localization/simulation/scenario.hpp"

namespace urban_gnss {

/// What the comparison of Kim et al., figure 6, depends on, the scenario aside.
struct BiasExperimentConditions {
  /// The mode is replaced.
  ComplementaryEkfParameters filter = published_complementary_ekf();
  LocalizationParameters localization;  ///< datum and antenna are replaced by the scenario's
};

/// Which filter is compared, and what it is given.
struct BiasContestant {
  const char* name;
  ComplementaryMode mode;
  /// An oracle: it is not given the fixes between the buildings nor those after them that are off by more than
  /// kRecovered_m, so that it shows what the odometry alone can do there.
  bool is_withheld;
};
inline constexpr std::array<BiasContestant, 7> kBiasContestants{
    {{"standard", ComplementaryMode::kStandard, false},
     {"gated", ComplementaryMode::kGated, false},
     {"compensated", ComplementaryMode::kCompensated, false},
     {"standard_as_printed", ComplementaryMode::kStandardAsPrinted, false},
     {"gated_as_printed", ComplementaryMode::kGatedAsPrinted, false},
     {"compensated_as_printed", ComplementaryMode::kCompensatedAsPrinted, false},
     {"withheld", ComplementaryMode::kStandard, true}}};
inline constexpr double kRecovered_m = 3.0;

struct BiasContestantRun {
  Trajectory estimate;
  std::vector<BiasEstimate> biases;  ///< one for each fix that the filter was given after its start
};

/// One drive through a scenario, every filter on the same measurements. All in the scenario's map frame.
struct BiasRun {
  Trajectory truth;
  std::vector<std::pair<Stamp, Eigen::Vector2d>> fix_errors;  ///< m, fix minus antenna
  /// First and last of the truth's stamps inside the convex hull of all footprints: between the buildings.
  std::optional<std::pair<Stamp, Stamp>> between;
  std::array<BiasContestantRun, kBiasContestants.size()> contestants;
};

/// 0 before the buildings, 1 between them, 2 after. Where there are none, everything is before.
std::size_t phase_of(const BiasRun& run, Stamp stamp);

/// s from leaving the buildings until the bias is insignificant (its filter closed, or b' M^-1 b below
/// close_probability's quantile) and stays so for kSettled; nothing where it does not, or where there are no buildings.
std::optional<double> settling_time_s(const BiasRun& run, const std::vector<BiasEstimate>& biases);
inline constexpr Stamp kSettled = std::chrono::seconds(10);

/// Drives the scenario with a filter of each mode. The filters start from fixes and motion and see nothing of the
/// truth, the withheld one aside. Throws what CitySimulator throws.
BiasRun run_bias_experiment(const Scenario& scenario, const BiasExperimentConditions& conditions);

}  // namespace urban_gnss
