#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/experiments/localizer_experiment.hpp"

namespace urban_gnss {

/// What a localizer made of a fault. NaN where there is nothing to tell.
struct FaultScore {
  /// s from the fault's onset until the status was not healthy; infinite: never.
  double unhealthy_after_s{std::numeric_limits<double>::quiet_NaN()};
  double worst_while_healthy_m{std::numeric_limits<double>::quiet_NaN()};  ///< largest error, status healthy
  /// s from the fault's end until the estimate was good and healthy for kRecovered_s, also where it turned bad only
  /// within kAftermath_s; infinite: never; NaN: the fault does not end.
  double recovery_s{std::numeric_limits<double>::quiet_NaN()};
  /// Share (0 to 1) of the truth that lies inside the published 95 % ellipse; without an estimate it does not.
  double inside_95{std::numeric_limits<double>::quiet_NaN()};
  double worst_m{std::numeric_limits<double>::quiet_NaN()};  ///< largest error
};

/// An estimate has recovered where it is good and healthy for this long.
inline constexpr double kRecovered_s = 10.0;
/// s after a fault's end in which an estimate that turns bad does so because of the fault.
inline constexpr double kAftermath_s = 30.0;

/// What a score is about.
struct FaultWindow {
  Stamp onset{0};            ///< what was before it is left out
  std::optional<Stamp> end;  ///< nothing: the fault does not end
  double good_m{0.0};        ///< an error below this is good
};

/// Requires health in the order of its stamps.
FaultScore score_fault(const Trajectory& truth, const Trajectory& estimate, const std::vector<HealthSample>& health,
                       const FaultWindow& window);

/// The worst of some drives, of the share inside the ellipse the mean. NaN is left out.
FaultScore worst_of(const std::vector<FaultScore>& drives);

/// What all contenders made of a fault on one drive.
struct FaultResult {
  std::string fault;
  std::vector<FaultScore> scores;  ///< in the order of the contenders
};

/// Drives the scenario once, each contender with each of input_faults(). Requires contenders without faults. An
/// estimate is good where its error is below kGoodFix_m or below twice the median of the same contender without a
/// fault. Throws what CitySimulator throws.
std::vector<FaultResult> run_fault_experiment(const Scenario& scenario, const std::vector<Contender>& contenders,
                                              const LocalizerExperimentConditions& conditions,
                                              const std::function<void(double)>& on_progress);

}  // namespace urban_gnss
