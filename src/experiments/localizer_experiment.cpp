#include "urban_gnss_localization/experiments/localizer_experiment.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>

#include "urban_gnss_localization/experiments/city_drive.hpp"
#include "urban_gnss_localization/experiments/faulty_participant.hpp"
#include "urban_gnss_localization/geometry/isometry.hpp"
#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/localizers/nishida/particle_filter.hpp"
#include "urban_gnss_localization/pipeline/bias_responder.hpp"

namespace urban_gnss {
namespace {

constexpr Stamp kHealthInterval = std::chrono::milliseconds(100);

/// The bias filter is as printed where the localizer is.
GpsBiasParameters bias_of(GpsBiasParameters bias, const Localizer& localizer) {
  const auto* filter = dynamic_cast<const ParticleFilter*>(&localizer);
  if (filter != nullptr && filter->filter_mode() == ParticleFilterMode::kLiteral) bias.mode = filter->filter_mode();
  return bias;
}

/// A contender's localizer with its pipelines.
class Participant : public LocalizingParticipant {
 public:
  Participant(const Contender& contender, const Scenario& scenario, const LocalizerExperimentConditions& conditions,
              Trajectory& estimate, std::vector<HealthSample>& health)
      : frame_(scenario.datum),
        localization_(conditions.localization, contender.make()),
        bias_responder_(bias_of(conditions.bias, localization_.localizer())),
        antenna_(scenario.vehicle.antenna()),
        estimate_(estimate),
        health_(health) {
    if (contender.uses_occlusion) occlusion_ = std::make_unique<OcclusionPipeline>(conditions.occlusion);
    localization_.set_datum(scenario.datum);
    move_antenna(0.0);
  }

  bool wants_clouds() const override { return occlusion_ != nullptr; }

  void add_imu_yaw_rate(Stamp stamp, double yaw_rate_radps) override {
    localization_.add_imu_yaw_rate(stamp, yaw_rate_radps);
  }

  void add_imu_heading(const HeadingSample& heading) override {
    localization_.add_imu_heading(heading);
    if (occlusion_) occlusion_->add_imu_heading(heading);
  }

  void add_odometry(const OdometrySample& sample) override {
    localization_.add_odometry(sample);
    settle();
    const bool healthy = localization_.report().healthy;
    const bool is_known = !health_.empty() && health_.back().healthy == healthy;
    if (is_known && sample.stamp - health_.back().stamp < kHealthInterval) return;
    health_.push_back({sample.stamp, healthy});
  }

  void add_cloud(Stamp stamp, const PointCloud& cloud, const Eigen::Isometry3d& sensor_in_base,
                 const Pose2& base_in_odom) override {
    occlusion_->add_cloud(stamp, cloud, sensor_in_base, to_isometry(base_in_odom));
  }

  void add_epoch(const DriveEpoch& epoch, const Pose2& base_in_odom) override {
    if (occlusion_) occlusion_->set_satellites(epoch.stamp, epoch.satellites, epoch.angle_resolution_rad);
    localization_.add_satellites(epoch.stamp, epoch.satellites);
    if (!epoch.fix) return;
    RawFix fix;
    fix.stamp = epoch.stamp;
    fix.position = frame_.to_geodetic(epoch.fix->position);
    fix.covariance = epoch.fix->covariance;
    fix.covariance_type = epoch.fix->covariance_type;
    if (occlusion_) {
      std::optional<Eigen::Matrix2d> claimed;
      if (fix.covariance_type != CovarianceType::kUnknown) claimed = fix.covariance.topLeftCorner<2, 2>();
      fix.covariance.topLeftCorner<2, 2>() =
          occlusion_->assess(epoch.stamp, claimed, to_isometry(base_in_odom)).covariance.weighted;
      fix.covariance_type = CovarianceType::kKnown;
    }
    localization_.add_fix(fix);
    if (epoch.fix->velocity_sigma_mps > 0.0) {
      RawVelocity velocity;
      velocity.stamp = epoch.stamp;
      velocity.velocity = epoch.fix->velocity.head<2>();
      velocity.covariance = std::pow(epoch.fix->velocity_sigma_mps, 2) * Eigen::Matrix2d::Identity();
      localization_.add_velocity(velocity);
    }
    settle();
  }

  void set_pose_aside(double left_m) override {
    constexpr double kPositionVariance_m2 = 0.25;
    constexpr double kYawVariance_rad2 = kPi * kPi / 144.0;
    PoseEstimate wrong;
    wrong.pose = compose(localization_.localizer().pose(), {0.0, left_m, 0.0});
    wrong.covariance = Eigen::Vector3d(kPositionVariance_m2, kPositionVariance_m2, kYawVariance_rad2).asDiagonal();
    localization_.set_pose(wrong);
  }

  void move_antenna(double forward_m) override {
    antenna_.x() += forward_m;
    localization_.set_antenna_offset(antenna_.head<2>());
    if (occlusion_) occlusion_->set_antenna(antenna_);
  }

 private:
  void settle() {
    bias_responder_.answer(localization_);
    for (const LocalizationOutput& output : localization_.take_outputs()) {
      estimate_.push_back({output.stamp, output.estimate.pose, output.estimate.covariance});
      if (!occlusion_) continue;
      occlusion_->set_alignment(
          {output.stamp, map_to_odometry(output), std::sqrt(std::max(0.0, output.estimate.covariance(2, 2)))});
    }
    localization_.take_events();
    localization_.take_outcomes();
  }

  LocalFrame frame_;
  LocalizationPipeline localization_;
  BiasResponder bias_responder_;
  std::unique_ptr<OcclusionPipeline> occlusion_;
  Eigen::Vector3d antenna_;  ///< m, in the base frame, as it is told
  Trajectory& estimate_;
  std::vector<HealthSample>& health_;
};

/// Looks for times without fixes.
class OutageWatch : public DriveParticipant {
 public:
  explicit OutageWatch(std::vector<FixOutage>& outages) : outages_(outages) {}

  bool wants_clouds() const override { return false; }
  void add_odometry(const OdometrySample&) override {}
  void add_cloud(Stamp, const PointCloud&, const Eigen::Isometry3d&, const Pose2&) override {}
  void add_epoch(const DriveEpoch& epoch, const Pose2&) override {
    if (!epoch.fix) return;
    if (last_fix_ && to_seconds(epoch.stamp - *last_fix_) > kOutage_s) since_ = last_fix_;
    last_fix_ = epoch.stamp;
    if (!since_ || epoch.error_m.norm() > kGoodFix_m) return;
    outages_.push_back({*since_, epoch.stamp});
    since_.reset();
  }

 private:
  std::vector<FixOutage>& outages_;
  std::optional<Stamp> last_fix_;
  std::optional<Stamp> since_;  ///< of an outage after which no good fix came yet
};

/// s for which an error beyond kGoodFix_m remained after `good_fix`.
double reacquisition_s(const std::vector<ErrorSample>& samples, Stamp good_fix) {
  double last_bad_s = 0.0;
  double seen_s = 0.0;
  for (const ErrorSample& sample : samples) {
    const double after_s = to_seconds(sample.stamp - good_fix);
    if (after_s < 0.0 || after_s > kReacquisitionWindow_s) continue;
    seen_s = after_s;
    if (sample.position_error_m > kGoodFix_m) last_bad_s = after_s;
  }
  return last_bad_s < seen_s ? last_bad_s : std::numeric_limits<double>::infinity();
}

}  // namespace

LocalizerRun run_localizer_experiment(const Scenario& scenario, const std::vector<Contender>& contenders,
                                      const LocalizerExperimentConditions& conditions,
                                      const std::function<void(double)>& on_progress) {
  LocalizerRun run;
  run.estimates.resize(contenders.size());
  run.health.resize(contenders.size());
  const Stamp fault_onset = scenario.start_time + from_seconds(conditions.fault_onset_s);
  std::deque<Participant> participants;
  std::deque<FaultyParticipant> faulty;
  OutageWatch outage_watch(run.outages);
  std::vector<DriveParticipant*> all{&outage_watch};
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    Participant& told = participants.emplace_back(contenders[i], scenario, conditions, run.estimates[i], run.health[i]);
    all.push_back(&faulty.emplace_back(contenders[i].fault, fault_onset, told));
  }
  run.truth = drive_city(scenario, conditions.cloud_every, all, on_progress).truth;
  for (const FaultyParticipant& each : faulty) run.fault_begins.push_back(each.begin());
  return run;
}

ContenderSummary summarize_contender(const std::vector<LocalizerRun>& runs, std::size_t contender) {
  ContenderSummary summary;
  std::vector<double> position;
  std::vector<double> heading;
  double nees_sum = 0.0;
  double nees_count = 0.0;
  double truths = 0.0;
  for (const LocalizerRun& run : runs) {
    const TrajectoryErrors errors = errors_at_truth(run.truth, run.estimates[contender]);
    truths += static_cast<double>(run.truth.size());
    for (const ErrorSample& sample : errors.samples) {
      position.push_back(sample.position_error_m);
      heading.push_back(sample.heading_error_rad);
      if (std::isnan(sample.nees)) continue;
      nees_sum += sample.nees;
      nees_count += 1.0;
    }
    summary.rmse_m.push_back(errors.summary.position_m.rmse);
    if (errors.summary.position_m.max > kDiverged_m) ++summary.diverged;
    for (const FixOutage& outage : run.outages) {
      summary.reacquisition_s = std::fmax(summary.reacquisition_s, reacquisition_s(errors.samples, outage.good_fix));
    }
  }
  if (nees_count > 0.0) summary.nees_mean = nees_sum / nees_count;
  if (truths > 0.0) summary.coverage = static_cast<double>(position.size()) / truths;
  summary.heading_rmse_rad = summarize(std::move(heading)).rmse;
  summary.position_m = summarize(std::move(position));
  return summary;
}

}  // namespace urban_gnss
