#include "urban_gnss_localization/experiments/occlusion_experiment.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>

#include "urban_gnss_localization/experiments/city_drive.hpp"
#include "urban_gnss_localization/geometry/isometry.hpp"
#include "urban_gnss_localization/geometry/local_frame.hpp"

namespace urban_gnss {
namespace {

/// Odometry that is missing for longer is not bridged.
constexpr Stamp kOdometryGap = std::chrono::seconds(1);

/// A covariance model with the filters that use its covariances.
class Contestant {
 public:
  Contestant(const ComparedModel& compared, const Scenario& scenario, const OcclusionExperimentConditions& conditions,
             OcclusionModelRun& run)
      : frame_(scenario.datum), covariance_(parameters_of(compared, conditions)), run_(run) {
    if (compared.is_as_printed) {
      filters_.push_back(make_filter(scenario, conditions, as_printed(conditions.ukf)));
      return;
    }
    UkfParameters robust = conditions.ukf;
    robust.outliers = OutlierPolicy::kStudentT;
    filters_.push_back(make_filter(scenario, conditions, conditions.ukf));
    filters_.push_back(make_filter(scenario, conditions, robust));
  }

  void add_odometry(const OdometrySample& sample) {
    for (const auto& filter : filters_) filter->add_odometry(sample);
    take_outputs();
  }

  void add_yaw_rate(Stamp stamp, double yaw_rate_radps) {
    for (const auto& filter : filters_) filter->add_imu_yaw_rate(stamp, yaw_rate_radps);
  }

  void add_heading(const HeadingSample& heading) {
    for (const auto& filter : filters_) filter->add_imu_heading(heading);
  }

  /// A fix of an epoch, and its satellites as the map sees them.
  void add_fix(const DriveEpoch& epoch, const std::vector<SatelliteObservation>& satellites, bool has_map) {
    const Eigen::Matrix2d claimed = epoch.fix->covariance.topLeftCorner<2, 2>();
    const GnssCovariance covariance = covariance_.process(epoch.stamp, satellites, std::nullopt, claimed);
    run_.fixes.push_back({epoch.stamp, epoch.fix->position.head<2>(), epoch.error_m, claimed, covariance.weighted,
                          covariance.is_good, has_map});
    RawFix fix;
    fix.stamp = epoch.stamp;
    fix.position = frame_.to_geodetic(epoch.fix->position);
    fix.covariance = epoch.fix->covariance;
    fix.covariance.topLeftCorner<2, 2>() = covariance.weighted;
    fix.covariance_type = CovarianceType::kKnown;
    for (const auto& filter : filters_) filter->add_fix(fix);
    take_outputs();
  }

  /// map -> odom of the last estimate.
  const std::optional<WorldAlignment>& alignment() const { return alignment_; }

 private:
  static GnssCovarianceParameters parameters_of(const ComparedModel& compared,
                                                const OcclusionExperimentConditions& conditions) {
    GnssCovarianceParameters parameters =
        compared.is_as_printed ? as_printed(conditions.as_printed).covariance : conditions.occlusion.covariance;
    parameters.model = compared.model;
    return parameters;
  }

  static std::unique_ptr<LocalizationPipeline> make_filter(const Scenario& scenario,
                                                           const OcclusionExperimentConditions& conditions,
                                                           const UkfParameters& ukf) {
    auto filter =
        std::make_unique<LocalizationPipeline>(conditions.localization, std::make_unique<Ukf>(ukf, conditions.motion));
    filter->set_antenna_offset(scenario.vehicle.antenna().head<2>());
    filter->set_datum(scenario.datum);
    return filter;
  }

  void take_outputs() {
    const std::array<Trajectory*, 2> trajectories{&run_.estimate, &run_.robust_estimate};
    for (std::size_t i = 0; i < filters_.size(); ++i) {
      for (const LocalizationOutput& output : filters_[i]->take_outputs()) {
        trajectories[i]->push_back({output.stamp, output.estimate.pose, output.estimate.covariance});
        if (i > 0) continue;
        alignment_ = {output.stamp, map_to_odometry(output),
                      std::sqrt(std::max(0.0, output.estimate.covariance(2, 2)))};
      }
      filters_[i]->take_events();
      filters_[i]->take_outcomes();
    }
  }

  LocalFrame frame_;
  GnssCovarianceModel covariance_;
  OcclusionModelRun& run_;
  std::vector<std::unique_ptr<LocalizationPipeline>> filters_;  ///< as in the conditions, and the robust one
  std::optional<WorldAlignment> alignment_;
};

/// A setting: the map and the sky, which its contestants share.
class Setting : public DriveParticipant {
 public:
  Setting(bool is_as_printed, const Scenario& scenario, const OcclusionExperimentConditions& conditions,
          OcclusionRun& run)
      : tally_(run.satellites[is_as_printed ? 1 : 0]),
        occlusion_(is_as_printed ? as_printed(conditions.as_printed) : conditions.occlusion) {
    occlusion_.set_antenna(scenario.vehicle.antenna());
    for (std::size_t i = 0; i < kComparedModels.size(); ++i) {
      if (kComparedModels[i].is_as_printed != is_as_printed) continue;
      contestants_.push_back(std::make_unique<Contestant>(kComparedModels[i], scenario, conditions, run.models[i]));
    }
  }

  bool wants_clouds() const override { return true; }

  void add_imu_yaw_rate(Stamp stamp, double yaw_rate_radps) override {
    for (const auto& contestant : contestants_) contestant->add_yaw_rate(stamp, yaw_rate_radps);
  }

  void add_imu_heading(const HeadingSample& heading) override {
    occlusion_.add_imu_heading(heading);
    for (const auto& contestant : contestants_) contestant->add_heading(heading);
  }

  void add_odometry(const OdometrySample& sample) override {
    for (const auto& contestant : contestants_) contestant->add_odometry(sample);
    take_heading();
  }

  void add_cloud(Stamp stamp, const PointCloud& cloud, const Eigen::Isometry3d& sensor_in_base,
                 const Pose2& base_in_odom) override {
    occlusion_.add_cloud(stamp, cloud, sensor_in_base, to_isometry(base_in_odom));
  }

  void add_epoch(const DriveEpoch& epoch, const Pose2& base_in_odom) override {
    occlusion_.set_satellites(epoch.stamp, epoch.satellites, epoch.angle_resolution_rad);
    if (!epoch.fix) return;
    const FixAssessment assessment = occlusion_.assess(epoch.stamp, std::nullopt, to_isometry(base_in_odom));
    if (assessment.has_map) tally(assessment, epoch.has_line_of_sight);
    for (const auto& contestant : contestants_) contestant->add_fix(epoch, assessment.satellites, assessment.has_map);
    take_heading();
  }

 private:
  void take_heading() {
    if (contestants_.back()->alignment()) occlusion_.set_alignment(*contestants_.back()->alignment());
  }

  void tally(const FixAssessment& assessment, const std::vector<bool>& has_line_of_sight) {
    for (std::size_t i = 0; i < assessment.satellites.size() && i < has_line_of_sight.size(); ++i) {
      const SatelliteObservation& satellite = assessment.satellites[i];
      if (!assessment.covariance.satellites[i].is_used || !std::isfinite(satellite.blocked_fraction)) continue;
      const std::size_t truth = has_line_of_sight[i] ? 1 : 0;
      const double threshold = occlusion_.parameters().covariance.blocked_threshold;
      ++tally_.counts[truth][satellite.blocked_fraction < threshold ? 1 : 0];
      tally_.known_sum[truth] += satellite.known_fraction;
    }
  }

  LineOfSightTally& tally_;
  OcclusionPipeline occlusion_;
  std::vector<std::unique_ptr<Contestant>> contestants_;
};

/// Odometry alone in the map frame, from the true pose at `start` on.
Trajectory odometry_from(Stamp start, const DriveRecord& record) {
  Trajectory placed;
  const auto truth = interpolate(record.truth, start, kOdometryGap);
  const auto odometry = interpolate(record.odometry, start, kOdometryGap);
  if (!truth || !odometry) return placed;
  const Pose2 odom_in_map = compose(truth->pose, inverse(odometry->pose));
  for (const TimedPose& pose : record.odometry) {
    if (pose.stamp >= start) placed.push_back({pose.stamp, compose(odom_in_map, pose.pose)});
  }
  return placed;
}

}  // namespace

OcclusionRun run_occlusion_experiment(const Scenario& scenario, const OcclusionExperimentConditions& conditions,
                                      const std::function<void(double)>& on_progress) {
  OcclusionRun run;
  Setting ours(false, scenario, conditions, run);
  Setting printed(true, scenario, conditions, run);
  const DriveRecord record = drive_city(scenario, conditions.cloud_every, {&ours, &printed}, on_progress);
  run.truth = record.truth;
  const Trajectory& conventional = run.models.front().estimate;
  if (!conventional.empty()) run.odometry = odometry_from(conventional.front().stamp, record);
  return run;
}

}  // namespace urban_gnss
