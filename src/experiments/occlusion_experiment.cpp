#include "urban_gnss_localization/experiments/occlusion_experiment.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <memory>
#include <optional>
#include <utility>

#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/simulation/city_simulator.hpp"

namespace urban_gnss {
namespace {

constexpr Stamp kOdometryGap = std::chrono::seconds(1);

Eigen::Isometry3d to_isometry(const Pose2& pose) {
  Eigen::Isometry3d isometry = Eigen::Isometry3d::Identity();
  isometry.translate(Eigen::Vector3d(pose.x, pose.y, 0.0));
  isometry.rotate(Eigen::AngleAxisd(pose.yaw, Eigen::Vector3d::UnitZ()));
  return isometry;
}

PointCloud to_point_cloud(const LidarScan& scan) {
  PointCloud cloud;
  cloud.reserve(scan.size());
  for (std::size_t i = 0; i < scan.size(); ++i) cloud.emplace_back(scan.x[i], scan.y[i], scan.z[i]);
  return cloud;
}

std::vector<SatelliteObservation> to_observations(const std::vector<SatelliteReport>& reports) {
  std::vector<SatelliteObservation> observations;
  for (const SatelliteReport& report : reports) {
    SatelliteObservation observation;
    observation.id = report.id;
    observation.look = report.look;
    observation.cn0_dbhz = report.cn0_dbhz;
    observation.tracked = report.is_tracked;
    observations.push_back(observation);
  }
  return observations;
}

/// Everything of one epoch of the receiver; it may wait for odometry.
struct Epoch {
  Stamp stamp{0};
  std::optional<ReceiverFix> fix;
  Eigen::Vector2d error_m{Eigen::Vector2d::Zero()};
  std::vector<SatelliteObservation> satellites;
  double angle_resolution_rad{0.0};
  std::vector<bool> has_line_of_sight;  ///< truth, of each satellite
};

/// A covariance model with the filters that use its covariances.
class Contestant {
 public:
  Contestant(CovarianceModel model, const Scenario& scenario, const OcclusionExperimentConditions& conditions,
             OcclusionModelRun& run)
      : frame_(scenario.datum), covariance_(with_model(conditions.occlusion.covariance, model)), run_(run) {
    UkfParameters robust = conditions.ukf;
    robust.outliers = OutlierPolicy::kStudentT;
    filters_ = {make_filter(scenario, conditions, conditions.ukf), make_filter(scenario, conditions, robust)};
  }

  void add_odometry(const OdometrySample& sample) {
    for (const auto& filter : filters_) filter->add_odometry(sample);
    take_outputs();
  }

  void add_yaw_rate(Stamp stamp, double yaw_rate_radps) {
    for (const auto& filter : filters_) filter->add_imu_yaw_rate(stamp, yaw_rate_radps);
  }

  /// A fix of an epoch, and its satellites as the map sees them.
  void add_fix(const Epoch& epoch, const std::vector<SatelliteObservation>& satellites, bool has_map) {
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
  static GnssCovarianceParameters with_model(GnssCovarianceParameters parameters, CovarianceModel model) {
    parameters.model = model;
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
      filters_[i]->take_verdicts();
    }
  }

  LocalFrame frame_;
  GnssCovarianceModel covariance_;
  OcclusionModelRun& run_;
  std::array<std::unique_ptr<LocalizationPipeline>, 2> filters_;  ///< as in the conditions, and the robust one
  std::optional<WorldAlignment> alignment_;
};

/// Sorts the simulator's events, and holds back clouds and epochs until odometry has reached them.
class Experiment {
 public:
  Experiment(const Scenario& scenario, const OcclusionExperimentConditions& conditions, OcclusionRun& run)
      : sensor_in_base_(Eigen::Isometry3d(Eigen::Translation3d(scenario.lidar.mount()))),
        cloud_every_(scenario.lidar.type == LidarType::kSpinning ? std::max(1, conditions.cloud_every) : 1),
        blocked_threshold_(conditions.occlusion.covariance.blocked_threshold),
        run_(run),
        occlusion_(conditions.occlusion) {
    occlusion_.set_antenna(scenario.vehicle.antenna());
    for (std::size_t i = 0; i < kComparedModels.size(); ++i) {
      contestants_.push_back(std::make_unique<Contestant>(kComparedModels[i], scenario, conditions, run.models[i]));
    }
  }

  void handle(const std::vector<SimulationEvent>& events) {
    for (const SimulationEvent& event : events) {
      stamp_ = event.stamp;
      std::visit([this](const auto& content) { add(content); }, event.content);
    }
    work();
  }

  void finish() {
    const Trajectory& conventional = run_.models.front().estimate;
    if (conventional.empty()) return;
    const Stamp start = conventional.front().stamp;
    const auto truth = interpolate(run_.truth, start, kOdometryGap);
    const auto odometry = interpolate(odometry_, start, kOdometryGap);
    if (!truth || !odometry) return;
    const Pose2 odom_in_map = compose(truth->pose, inverse(odometry->pose));
    for (const TimedPose& pose : odometry_) {
      if (pose.stamp >= start) run_.odometry.push_back({pose.stamp, compose(odom_in_map, pose.pose)});
    }
  }

 private:
  void add(const TruthEvent& truth) { run_.truth.push_back({stamp_, truth.pose}); }
  void add(const OdometryEvent& odometry) {
    odometry_.push_back({stamp_, odometry.pose});
    for (const auto& contestant : contestants_) contestant->add_odometry({stamp_, odometry.pose, odometry.twist});
    take_heading();
  }
  void add(const ImuMessage& imu) {
    for (const auto& contestant : contestants_) contestant->add_yaw_rate(stamp_, imu.angular_velocity_radps.z());
  }
  void add(const LidarScan& scan) {
    if (scans_++ % cloud_every_ == 0) clouds_.emplace_back(stamp_, to_point_cloud(scan));
  }
  void add(const FixEvent& event) {
    if (event.published.publisher != 0) return;
    Epoch& epoch = epoch_at_stamp();
    if (event.published.has_fix && event.published.fix.position.allFinite()) epoch.fix = event.published.fix;
  }
  void add(const FixTruthEvent& truth) { epoch_at_stamp().error_m = truth.error.head<2>(); }
  void add(const SatellitesEvent& event) {
    Epoch& epoch = epoch_at_stamp();
    epoch.satellites = to_observations(event.satellites);
    epoch.angle_resolution_rad = event.angle_resolution_rad;
  }
  void add(const SignalsEvent& event) {
    Epoch& epoch = epoch_at_stamp();
    for (const SignalTruth& signal : event.signals) epoch.has_line_of_sight.push_back(signal.has_line_of_sight);
  }

  Epoch& epoch_at_stamp() {
    if (epochs_.empty() || epochs_.back().stamp != stamp_) {
      epochs_.emplace_back();
      epochs_.back().stamp = stamp_;
    }
    return epochs_.back();
  }

  void work() {
    if (odometry_.empty()) return;
    const Stamp reached = odometry_.back().stamp;
    for (; !clouds_.empty() && clouds_.front().first <= reached; clouds_.pop_front()) {
      const auto& [stamp, cloud] = clouds_.front();
      const auto base = interpolate(odometry_, stamp, kOdometryGap);
      if (!base) continue;
      occlusion_.add_cloud(stamp, cloud, sensor_in_base_, to_isometry(base->pose));
    }
    for (; !epochs_.empty() && epochs_.front().stamp <= reached; epochs_.pop_front()) {
      const auto base = interpolate(odometry_, epochs_.front().stamp, kOdometryGap);
      if (!base) continue;
      weigh(epochs_.front(), to_isometry(base->pose));
    }
  }

  void weigh(const Epoch& epoch, const Eigen::Isometry3d& base_in_odom) {
    occlusion_.set_satellites(epoch.stamp, epoch.satellites, epoch.angle_resolution_rad);
    if (!epoch.fix) return;
    const FixAssessment assessment = occlusion_.assess(epoch.stamp, std::nullopt, base_in_odom);
    if (assessment.has_map) tally(assessment, epoch.has_line_of_sight);
    for (const auto& contestant : contestants_) contestant->add_fix(epoch, assessment.satellites, assessment.has_map);
    take_heading();
  }

  void take_heading() {
    static_assert(kComparedModels.back() == CovarianceModel::kSoft);
    if (contestants_.back()->alignment()) occlusion_.set_alignment(*contestants_.back()->alignment());
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

  Eigen::Isometry3d sensor_in_base_;
  int cloud_every_;
  double blocked_threshold_;
  OcclusionRun& run_;
  OcclusionPipeline occlusion_;
  std::vector<std::unique_ptr<Contestant>> contestants_;
  Stamp stamp_{0};  ///< of the event at hand
  int scans_{0};
  Trajectory odometry_;  ///< in the odometry frame
  std::deque<std::pair<Stamp, PointCloud>> clouds_;
  std::deque<Epoch> epochs_;
};

}  // namespace

OcclusionRun run_occlusion_experiment(const Scenario& scenario, const OcclusionExperimentConditions& conditions,
                                      const std::function<void(double)>& on_progress) {
  OcclusionRun run;
  CitySimulator simulator(scenario);
  Experiment experiment(scenario, conditions, run);
  std::vector<SimulationEvent> events;
  while (!simulator.is_finished()) {
    events.clear();
    simulator.step(std::nullopt, events);
    experiment.handle(events);
    on_progress(simulator.progress());
  }
  experiment.finish();
  return run;
}

}  // namespace urban_gnss
