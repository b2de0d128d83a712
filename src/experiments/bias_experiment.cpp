#include "urban_gnss_localization/experiments/bias_experiment.hpp"

#include <cmath>
#include <memory>

#include "urban_gnss_localization/experiments/city_drive.hpp"
#include "urban_gnss_localization/geometry/local_frame.hpp"
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
    pipeline_ = std::make_unique<LocalizationPipeline>(conditions.localization,
                                                       std::make_unique<ComplementaryEkf>(conditions.filter));
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
    for (BiasEstimate& bias : pipeline_->take_bias_estimates()) run_.biases.push_back(std::move(bias));
    pipeline_->take_events();
    pipeline_->take_outcomes();
  }

  bool is_withheld_;
  BiasContestantRun& run_;
  std::unique_ptr<LocalizationPipeline> pipeline_;
};

class Experiment : public DriveParticipant {
 public:
  Experiment(const Scenario& scenario, const BiasExperimentConditions& conditions, BiasRun& run)
      : frame_(scenario.datum), hull_(hull_of(scenario.world)), run_(run) {
    for (std::size_t i = 0; i < kBiasContestants.size(); ++i) {
      contestants_.push_back(
          std::make_unique<Contestant>(kBiasContestants[i], scenario, conditions, run.contestants[i]));
    }
  }

  bool wants_clouds() const override { return false; }
  void add_cloud(Stamp, const PointCloud&, const Eigen::Isometry3d&, const Pose2&) override {}

  void add_odometry(const OdometrySample& sample) override {
    for (const auto& contestant : contestants_) contestant->add_odometry(sample);
  }

  void add_epoch(const DriveEpoch& epoch, const Pose2&) override {
    if (!epoch.fix) return;
    run_.fix_errors.emplace_back(epoch.stamp, epoch.error_m);
    RawFix fix;
    fix.stamp = epoch.stamp;
    fix.position = frame_.to_geodetic(epoch.fix->position);
    fix.covariance = epoch.fix->covariance;
    fix.covariance_type = epoch.fix->covariance_type;

    const bool is_between = contains(hull_, epoch.fix->position.head<2>() - epoch.error_m);
    was_between_ = was_between_ || is_between;
    is_recovered_ = !is_between && (!was_between_ || is_recovered_ || epoch.error_m.norm() < kRecovered_m);
    for (const auto& contestant : contestants_) {
      if (is_recovered_ || !contestant->is_withheld()) contestant->add_fix(fix);
    }
  }

  /// The first and last moment between the buildings.
  std::optional<std::pair<Stamp, Stamp>> between(const Trajectory& truth) const {
    std::optional<std::pair<Stamp, Stamp>> between;
    for (const TimedPose& pose : truth) {
      if (!contains(hull_, pose.pose.position())) continue;
      if (!between) between = std::make_pair(pose.stamp, pose.stamp);
      between->second = pose.stamp;
    }
    return between;
  }

 private:
  LocalFrame frame_;
  Polygon hull_;
  BiasRun& run_;
  std::vector<std::unique_ptr<Contestant>> contestants_;
  bool was_between_{false};
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
  Experiment experiment(scenario, conditions, run);
  run.truth = drive_city(scenario, 1, {&experiment}, [](double) {}).truth;
  run.between = experiment.between(run.truth);
  return run;
}

}  // namespace urban_gnss
