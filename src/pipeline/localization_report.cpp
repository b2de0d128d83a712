// What the pipeline says of itself.

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "text.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"

namespace urban_gnss {
namespace {

constexpr double kLeastClusterMass = 0.5;

}  // namespace

const char* to_string(LocalizationState state) {
  switch (state) {
    case LocalizationState::kWaitingForOdometry: return "waiting for odometry";
    case LocalizationState::kWaitingForFix: return "waiting for a fix";
    case LocalizationState::kWaitingForDatum: return "waiting for the datum";
    case LocalizationState::kInitializing: return "initializing";
    case LocalizationState::kTracking: return "tracking";
    case LocalizationState::kDeadReckoning: return "dead reckoning";
    case LocalizationState::kLost: return "lost";
  }
  return "?";
}

std::string LocalizationPipeline::waiting_for() const {
  if (initialized_) return {};
  if (!last_odometry_) return "odometry";
  if (!frame_) return "the datum: " + datum_initializer_.waiting_for();
  if (!last_fix_stamp_) return "a usable fix";
  return "the start: " + heading_initializer_.waiting_for();
}

LocalizationReport LocalizationPipeline::report() const {
  LocalizationReport report;
  report.last_fix = last_verdict_;
  report.fixes_used = fixes_used_;
  report.fixes_rejected = fixes_rejected_;
  report.fixes_with_ranges = fixes_with_ranges_;
  report.velocities_used = velocities_used_;
  report.bias_radius_m = last_radius_m_;
  if (last_odometry_ && last_used_) report.fix_age_s = to_seconds(last_odometry_->stamp - *last_used_);
  if (last_odometry_ && last_fix_stamp_) {
    report.odometry_age_s = std::max(0.0, to_seconds(*last_fix_stamp_ - last_odometry_->stamp));
  }
  if (!initialized_) {
    report.state = lost_                        ? LocalizationState::kLost
                   : !last_odometry_            ? LocalizationState::kWaitingForOdometry
                   : !last_fix_stamp_ && frame_ ? LocalizationState::kWaitingForFix
                   : !frame_                    ? LocalizationState::kWaitingForDatum
                                                : LocalizationState::kInitializing;
    report.reason = "waiting for " + waiting_for();
    return report;
  }
  const PoseEstimate estimate = localizer_->estimate();
  report.health = localizer_->health();
  if (std::isfinite(report.health.bias_radius_m)) report.bias_radius_m = report.health.bias_radius_m;
  const Eigen::Matrix2d position = estimate.covariance.topLeftCorner<2, 2>();
  report.position_sigma_m =
      std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(position).eigenvalues()(1)));
  report.heading_converged = report.health.heading_sigma_rad < parameters_.heading_converged_sigma;
  const bool is_starved = !(report.fix_age_s <= parameters_.fix_timeout);
  report.state = lost_        ? LocalizationState::kLost
                 : is_starved ? LocalizationState::kDeadReckoning
                              : LocalizationState::kTracking;
  if (lost_) {
    report.reason = "every fix is farther than max_bias_radius";
  } else if (is_starved) {
    report.reason = last_used_ ? "no fix was used for " + seconds_text(report.fix_age_s) : "no fix was used yet";
  } else if (report.odometry_age_s > parameters_.odometry_gap) {
    report.reason = "no odometry for " + seconds_text(report.odometry_age_s);
  } else if (!report.heading_converged) {
    report.reason = "heading not known yet";
  } else if (report.health.cluster_mass < kLeastClusterMass) {
    report.reason = "particles disagree: no cluster holds half of the weight";
  } else {
    report.healthy = true;
  }
  return report;
}

}  // namespace urban_gnss
