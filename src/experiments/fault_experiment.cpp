#include "urban_gnss_localization/experiments/fault_experiment.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The estimate at a stamp of the truth.
struct Moment {
  Stamp stamp{0};
  double error_m{kNan};  ///< NaN: there is no estimate
  bool healthy{false};
  bool is_inside_95{false};
};

/// What the last status said.
bool is_healthy(const std::vector<HealthSample>& health, Stamp stamp) {
  const auto next = std::upper_bound(health.begin(), health.end(), stamp,
                                     [](Stamp value, const HealthSample& sample) { return value < sample.stamp; });
  return next != health.begin() && std::prev(next)->healthy;
}

std::vector<Moment> moments_since(Stamp onset, const Trajectory& truth, const Trajectory& estimate,
                                  const std::vector<HealthSample>& health) {
  const std::vector<ErrorSample> errors = errors_at_truth(truth, estimate).samples;
  auto error = errors.begin();
  std::vector<Moment> moments;
  for (const TimedPose& pose : truth) {
    const bool has_estimate = error != errors.end() && error->stamp == pose.stamp;
    if (pose.stamp >= onset) {
      Moment& moment = moments.emplace_back();
      moment.stamp = pose.stamp;
      moment.healthy = is_healthy(health, pose.stamp);
      if (has_estimate) moment.error_m = error->position_error_m;
      if (has_estimate) moment.is_inside_95 = is_inside_95(*error);
    }
    if (has_estimate) ++error;
  }
  return moments;
}

double recovery_s(const std::vector<Moment>& moments, Stamp end, double good_m) {
  const auto is_good = [&](const Moment& moment) { return moment.healthy && moment.error_m < good_m; };
  const auto since = std::find_if(moments.begin(), moments.end(), [&](const auto& each) { return each.stamp >= end; });
  // A wrong heading needs time to become a wrong position: what was good at first may turn bad.
  const auto bad = std::find_if_not(since, moments.end(), is_good);
  const bool turns_bad = bad != moments.end() && to_seconds(bad->stamp - end) <= kAftermath_s;
  std::optional<Stamp> good_since;
  for (auto moment = turns_bad ? bad : since; moment != moments.end(); ++moment) {
    if (!is_good(*moment)) {
      good_since.reset();
      continue;
    }
    if (!good_since) good_since = moment->stamp;
    if (to_seconds(moment->stamp - *good_since) >= kRecovered_s) return to_seconds(*good_since - end);
  }
  return kInfinity;
}

FaultWindow window_of(const InputFault& fault, Stamp begin, Stamp onset) {
  FaultWindow window;
  window.onset = std::max(begin, onset);
  if (std::isfinite(fault.duration_s)) window.end = begin + from_seconds(fault.duration_s);
  return window;
}

}  // namespace

FaultScore score_fault(const Trajectory& truth, const Trajectory& estimate, const std::vector<HealthSample>& health,
                       const FaultWindow& window) {
  FaultScore score;
  const std::vector<Moment> moments = moments_since(window.onset, truth, estimate, health);
  if (moments.empty()) return score;
  score.unhealthy_after_s = kInfinity;
  double inside = 0.0;
  for (const Moment& moment : moments) {
    if (!moment.healthy) {
      score.unhealthy_after_s = std::min(score.unhealthy_after_s, to_seconds(moment.stamp - window.onset));
    } else {
      score.worst_while_healthy_m = std::fmax(score.worst_while_healthy_m, moment.error_m);
    }
    score.worst_m = std::fmax(score.worst_m, moment.error_m);
    if (moment.is_inside_95) inside += 1.0;
  }
  score.inside_95 = inside / static_cast<double>(moments.size());
  if (window.end) score.recovery_s = recovery_s(moments, *window.end, window.good_m);
  return score;
}

FaultScore worst_of(const std::vector<FaultScore>& drives) {
  FaultScore worst;
  double inside = 0.0;
  double count = 0.0;
  for (const FaultScore& drive : drives) {
    worst.unhealthy_after_s = std::fmax(worst.unhealthy_after_s, drive.unhealthy_after_s);
    worst.worst_while_healthy_m = std::fmax(worst.worst_while_healthy_m, drive.worst_while_healthy_m);
    worst.recovery_s = std::fmax(worst.recovery_s, drive.recovery_s);
    worst.worst_m = std::fmax(worst.worst_m, drive.worst_m);
    if (std::isnan(drive.inside_95)) continue;
    inside += drive.inside_95;
    count += 1.0;
  }
  if (count > 0.0) worst.inside_95 = inside / count;
  return worst;
}

std::vector<FaultResult> run_fault_experiment(const Scenario& scenario, const std::vector<Contender>& contenders,
                                              const LocalizerExperimentConditions& conditions,
                                              const std::function<void(double)>& on_progress) {
  const std::vector<InputFault> faults = input_faults(scenario);
  std::vector<Contender> faulty;
  for (const InputFault& fault : faults) {
    for (const Contender& contender : contenders) {
      faulty.push_back(contender);
      faulty.back().fault = fault;
    }
  }
  const LocalizerRun run = run_localizer_experiment(scenario, faulty, conditions, on_progress);

  const Stamp onset = scenario.start_time + from_seconds(conditions.fault_onset_s);
  std::vector<double> good_m;
  for (std::size_t c = 0; c < contenders.size(); ++c) {
    const double median_m = errors_at_truth(run.truth, run.estimates[c]).summary.position_m.median;
    good_m.push_back(std::fmax(kGoodFix_m, 2.0 * median_m));
  }
  std::vector<FaultResult> results;
  for (std::size_t i = 0; i < faulty.size(); ++i) {
    const std::size_t c = i % contenders.size();
    if (c == 0) results.push_back({faulty[i].fault.name, {}});
    FaultScore score;
    if (run.fault_begins[i]) {
      FaultWindow window = window_of(faulty[i].fault, *run.fault_begins[i], onset);
      window.good_m = good_m[c];
      score = score_fault(run.truth, run.estimates[i], run.health[i], window);
    }
    results.back().scores.push_back(score);
  }
  return results;
}

}  // namespace urban_gnss
