#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/evaluation/trajectory_errors.hpp"
#include "urban_gnss_localization/experiments/input_faults.hpp"
#include "urban_gnss_localization/localizers/localizer.hpp"
#include "urban_gnss_localization/localizers/nishida/bias_kalman_filter.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"
#include "urban_gnss_localization/pipeline/occlusion_pipeline.hpp"
#include "urban_gnss_localization/simulation/scenario.hpp"

namespace urban_gnss {

/// A localizer that takes part, under the name it is reported by.
struct Contender {
  std::string name;
  std::function<std::unique_ptr<Localizer>()> make;
  bool uses_occlusion{false};  ///< its fixes have the covariance of the occlusion node, not the receiver's
  InputFault fault{};          ///< of what it is told
};

/// What all contenders share, the scenario aside.
struct LocalizerExperimentConditions {
  OcclusionPipelineParameters occlusion;  ///< antenna is replaced
  LocalizationParameters localization;    ///< datum and antenna are replaced by the scenario's
  GpsBiasParameters bias;                 ///< for those who want the bias's radius
  int cloud_every{5};                     ///< of a spinning lidar's scans, one in so many goes into the maps
  double fault_onset_s{60.0};             ///< of the contenders' faults, after the start of the drive
};

/// What a localizer said of itself at a stamp (LocalizationStatus.msg).
struct HealthSample {
  Stamp stamp{0};
  bool healthy{false};
};

/// A time without fixes, and when the first good fix came after it.
struct FixOutage {
  Stamp begin{0};     ///< the last fix before
  Stamp good_fix{0};  ///< the first fix after it with an error of at most kGoodFix_m
};

/// A fix with a horizontal error of at most this is good, and so is an estimate after an outage.
inline constexpr double kGoodFix_m = 5.0;
/// s without a fix that make an outage.
inline constexpr double kOutage_s = 10.0;
/// An estimate that is farther off has diverged.
inline constexpr double kDiverged_m = 100.0;

/// One drive through a scenario, every contender on the same measurements. All in the scenario's map frame.
struct LocalizerRun {
  Trajectory truth;
  std::vector<Trajectory> estimates;  ///< in the order of the contenders
  std::vector<FixOutage> outages;
  std::vector<std::vector<HealthSample>> health;   ///< every 0.1 s, in the order of the contenders
  std::vector<std::optional<Stamp>> fault_begins;  ///< in the same order; nothing: it waited for a turn
};

/// Drives the scenario, each contender behind a pipeline of its own. Nothing but the results sees the truth: they start
/// from fixes and motion. `on_progress` is told the share done, 0 to 1. Throws what CitySimulator throws.
LocalizerRun run_localizer_experiment(const Scenario& scenario, const std::vector<Contender>& contenders,
                                      const LocalizerExperimentConditions& conditions,
                                      const std::function<void(double)>& on_progress);

/// What a contender made of some drives. NaN where there is nothing to tell.
struct ContenderSummary {
  Summary position_m;          ///< over all samples of all drives
  std::vector<double> rmse_m;  ///< of each drive
  double heading_rmse_rad{std::numeric_limits<double>::quiet_NaN()};
  double nees_mean{std::numeric_limits<double>::quiet_NaN()};  ///< 3 for an honest covariance
  double coverage{std::numeric_limits<double>::quiet_NaN()};   ///< share of the truth with an estimate, 0 to 1
  std::size_t diverged{0};                                     ///< drives with an error beyond kDiverged_m
  /// s, the longest that an error beyond kGoodFix_m remained after an outage's first good fix; infinite where it
  /// remained for kReacquisitionWindow_s.
  double reacquisition_s{std::numeric_limits<double>::quiet_NaN()};
};

/// s after an outage's first good fix for which the error is watched.
inline constexpr double kReacquisitionWindow_s = 20.0;

/// Requires runs with as many estimates as `contender` needs.
ContenderSummary summarize_contender(const std::vector<LocalizerRun>& runs, std::size_t contender);

}  // namespace urban_gnss
