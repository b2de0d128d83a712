#include "urban_gnss_localization/experiments/occlusion_experiment.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "urban_gnss_localization/experiments/city_drive.hpp"
#include "urban_gnss_localization/geometry/local_frame.hpp"

namespace urban_gnss {
namespace {

/// A model's pipeline with the filter that uses its covariances.
class Contestant : public DriveParticipant {
 public:
  Contestant(CovarianceModel model, const Scenario& scenario, OcclusionExperimentConditions conditions,
             OcclusionModelRun& run)
      : frame_(scenario.datum),
        blocked_threshold_(conditions.occlusion.covariance.blocked_threshold),
        wants_clouds_(model != CovarianceModel::kConventional),
        run_(run) {
    conditions.occlusion.covariance.model = model;
    occlusion_ = std::make_unique<OcclusionPipeline>(conditions.occlusion);
    const Eigen::Vector3d antenna = scenario.vehicle.antenna();
    occlusion_->set_antenna(antenna);
    localization_ = std::make_unique<LocalizationPipeline>(conditions.localization,
                                                           std::make_unique<Ukf>(conditions.ukf, conditions.motion));
    localization_->set_antenna_offset(antenna.head<2>());
    localization_->set_datum(scenario.datum);
  }

  /// The first map -> odom of the filter.
  const std::optional<TimedPose>& start() const { return start_; }

  bool wants_clouds() const override { return wants_clouds_; }

  void add_odometry(const OdometrySample& sample) override {
    localization_->add_odometry(sample);
    take_outputs();
  }

  void add_cloud(Stamp stamp, const PointCloud& cloud, const Eigen::Isometry3d& sensor_in_base,
                 const Pose2& base_in_odom) override {
    occlusion_->add_cloud(stamp, cloud, sensor_in_base, to_isometry(base_in_odom));
  }

  void add_epoch(const DriveEpoch& epoch, const Pose2& base_in_odom) override {
    occlusion_->set_satellites(epoch.stamp, epoch.satellites, epoch.angle_resolution_rad);
    if (!epoch.fix) return;
    const Eigen::Matrix2d claimed = epoch.fix->covariance.topLeftCorner<2, 2>();
    const FixAssessment assessment = occlusion_->assess(epoch.stamp, claimed, to_isometry(base_in_odom));
    const GnssCovariance& covariance = assessment.covariance;
    run_.fixes.push_back(
        {epoch.stamp, epoch.error_m, claimed, covariance.weighted, covariance.is_good, assessment.has_map});
    if (assessment.has_map) tally(assessment, epoch.has_line_of_sight);

    RawFix fix;
    fix.stamp = epoch.stamp;
    fix.position = frame_.to_geodetic(epoch.fix->position);
    fix.covariance = epoch.fix->covariance;
    fix.covariance.topLeftCorner<2, 2>() = covariance.weighted;
    fix.covariance_type = CovarianceType::kKnown;
    localization_->add_fix(fix);
    take_outputs();
  }

 private:
  void take_outputs() {
    for (const LocalizationOutput& output : localization_->take_outputs()) {
      const Pose2 odom_in_map = map_to_odometry(output);
      if (!start_) start_ = TimedPose{output.stamp, odom_in_map};
      run_.estimate.push_back({output.stamp, output.estimate.pose, output.estimate.covariance});
      occlusion_->set_alignment(
          {output.stamp, odom_in_map, std::sqrt(std::max(0.0, output.estimate.covariance(2, 2)))});
    }
    localization_->take_events();
    localization_->take_verdicts();
  }

  void tally(const FixAssessment& assessment, const std::vector<bool>& has_line_of_sight) {
    for (std::size_t i = 0; i < assessment.satellites.size() && i < has_line_of_sight.size(); ++i) {
      const SatelliteObservation& satellite = assessment.satellites[i];
      if (!assessment.covariance.satellites[i].is_used || !std::isfinite(satellite.blocked_fraction)) continue;
      const std::size_t truth = has_line_of_sight[i] ? 1 : 0;
      ++run_.satellites.counts[truth][satellite.blocked_fraction < blocked_threshold_ ? 1 : 0];
      run_.satellites.known_sum[truth] += satellite.known_fraction;
    }
  }

  LocalFrame frame_;
  double blocked_threshold_;
  bool wants_clouds_;
  OcclusionModelRun& run_;
  std::unique_ptr<OcclusionPipeline> occlusion_;
  std::unique_ptr<LocalizationPipeline> localization_;
  std::optional<TimedPose> start_;
};

}  // namespace

OcclusionRun run_occlusion_experiment(const Scenario& scenario, const OcclusionExperimentConditions& conditions,
                                      const std::function<void(double)>& on_progress) {
  OcclusionRun run;
  std::vector<std::unique_ptr<Contestant>> contestants;
  std::vector<DriveParticipant*> participants;
  for (std::size_t i = 0; i < kComparedModels.size(); ++i) {
    contestants.push_back(std::make_unique<Contestant>(kComparedModels[i], scenario, conditions, run.models[i]));
    participants.push_back(contestants.back().get());
  }
  DriveRecord record = drive_city(scenario, conditions.cloud_every, participants, on_progress);
  run.truth = std::move(record.truth);
  if (const auto& start = contestants.front()->start()) {
    for (const TimedPose& pose : record.odometry) {
      if (pose.stamp >= start->stamp) run.odometry.push_back({pose.stamp, compose(start->pose, pose.pose)});
    }
  }
  return run;
}

}  // namespace urban_gnss
