#include "urban_gnss_localization/experiments/bias_experiment.hpp"

#include <cmath>
#include <memory>

#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/simulation/city_simulator.hpp"
#include "urban_gnss_localization/simulation/polygon.hpp"

namespace urban_gnss {
namespace {

Polygon hull_of(const World& world) {
  std::vector<Eigen::Vector2d> corners;
  for (const Building& building : world.buildings) {
    corners.insert(corners.end(), building.footprint.begin(), building.footprint.end());
  }
  return convex_hull(corners);
}

/// A pipeline with its filter.
class Contestant {
 public:
  Contestant(const BiasContestant& contestant, const Scenario& scenario, BiasExperimentConditions conditions,
             BiasContestantRun& run)
      : is_withheld_(contestant.is_withheld), run_(run) {
    conditions.filter.mode = contestant.mode;
    conditions.filter.adapt_every_mode = contestant.is_adapted;
    auto filter = std::make_unique<ComplementaryEkf>(conditions.filter);
    filter_ = filter.get();
    pipeline_ = std::make_unique<LocalizationPipeline>(conditions.localization, std::move(filter));
    pipeline_->set_antenna_offset(scenario.vehicle.antenna().head<2>());
    pipeline_->set_datum(scenario.datum);
  }

  bool is_withheld() const { return is_withheld_; }

  void add_odometry(const OdometrySample& sample) {
    pipeline_->add_odometry(sample);
    take_outputs();
  }

  void add_fix(const RawFix& fix) {
    pipeline_->add_fix(fix);
    take_outputs();
  }

 private:
  void take_outputs() {
    for (const LocalizationOutput& output : pipeline_->take_outputs()) {
      run_.estimate.push_back({output.stamp, output.estimate.pose, output.estimate.covariance});
    }
    for (BiasEstimate& bias : filter_->take_bias_estimates()) run_.biases.push_back(std::move(bias));
    pipeline_->take_events();
    pipeline_->take_verdicts();
  }

  bool is_withheld_;
  BiasContestantRun& run_;
  ComplementaryEkf* filter_;  ///< owned by the pipeline
  std::unique_ptr<LocalizationPipeline> pipeline_;
};

class Experiment {
 public:
  Experiment(const Scenario& scenario, const BiasExperimentConditions& conditions, BiasRun& run)
      : frame_(scenario.datum), hull_(hull_of(scenario.world)), run_(run) {
    for (std::size_t i = 0; i < kBiasContestants.size(); ++i) {
      contestants_.push_back(
          std::make_unique<Contestant>(kBiasContestants[i], scenario, conditions, run.contestants[i]));
    }
  }

  void handle(const SimulationEvent& event) {
    stamp_ = event.stamp;
    std::visit([this](const auto& content) { add(content); }, event.content);
  }

 private:
  template <class Other>
  void add(const Other&) {}
  void add(const TruthEvent& truth) {
    run_.truth.push_back({stamp_, truth.pose});
    if (!contains(hull_, truth.pose.position())) return;
    if (!run_.between) run_.between = std::make_pair(stamp_, stamp_);
    run_.between->second = stamp_;
  }
  void add(const OdometryEvent& odometry) {
    for (const auto& contestant : contestants_) contestant->add_odometry({stamp_, odometry.pose, odometry.twist});
  }
  void add(const FixEvent& event) {
    if (event.published.has_fix) fix_ = event.published.fix;
    if (!event.published.has_fix || event.published.publisher != 0 || !fix_.position.allFinite()) return;
    RawFix raw;
    raw.stamp = stamp_;
    raw.position = frame_.to_geodetic(fix_.position);
    raw.covariance = fix_.covariance;
    raw.covariance_type = CovarianceType::kApproximated;
    for (const auto& contestant : contestants_) {
      if (!contestant->is_withheld()) contestant->add_fix(raw);
    }
    waiting_ = raw;
  }
  /// Comes right after its fix.
  void add(const FixTruthEvent& truth) {
    const Eigen::Vector2d error = truth.error.head<2>();
    run_.fix_errors.emplace_back(stamp_, error);
    const bool is_between = contains(hull_, (fix_.position - truth.error).head<2>());
    const bool is_after = run_.between.has_value() && !is_between;
    is_recovered_ = !is_between && (!is_after || is_recovered_ || error.norm() < kRecovered_m);
    if (!is_recovered_) return;
    for (const auto& contestant : contestants_) {
      if (contestant->is_withheld()) contestant->add_fix(waiting_);
    }
  }

  LocalFrame frame_;
  Polygon hull_;
  BiasRun& run_;
  std::vector<std::unique_ptr<Contestant>> contestants_;
  Stamp stamp_{0};  ///< of the event at hand
  ReceiverFix fix_;
  RawFix waiting_;
  bool is_recovered_{true};
};

}  // namespace

std::size_t phase_of(const BiasRun& run, Stamp stamp) {
  if (!run.between || stamp < run.between->first) return 0;
  return stamp <= run.between->second ? 1 : 2;
}

std::optional<double> settling_time_s(const BiasRun& run, const std::vector<BiasEstimate>& biases) {
  if (!run.between || biases.empty()) return std::nullopt;
  const Stamp left = run.between->second;
  Stamp since = left;
  for (const BiasEstimate& bias : biases) {
    if (bias.stamp < left) continue;
    if (bias.stamp - since >= kSettled) return to_seconds(since - left);
    if (bias.in_shadow) since = bias.stamp;
  }
  return std::nullopt;
}

BiasRun run_bias_experiment(const Scenario& scenario, const BiasExperimentConditions& conditions) {
  BiasRun run;
  CitySimulator simulator(scenario);
  Experiment experiment(scenario, conditions, run);
  std::vector<SimulationEvent> events;
  while (!simulator.is_finished()) {
    events.clear();
    simulator.step(std::nullopt, events);
    for (const SimulationEvent& event : events) experiment.handle(event);
  }
  return run;
}

}  // namespace urban_gnss
