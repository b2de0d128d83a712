#include "urban_gnss_localization/pipeline/status_reporter.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "text.hpp"
#include "urban_gnss_localization/geometry/protection_level.hpp"

namespace urban_gnss {
namespace {

constexpr double kLeastClusterMass = 0.5;
constexpr char kInertGate[] = "gate inert: the fixes scatter far less than their covariance says";

LocalizationState state_before_start(const PipelineStatus& status) {
  if (status.is_lost) return LocalizationState::kLost;
  if (!status.last_odometry) return LocalizationState::kWaitingForOdometry;
  if (!status.has_datum) return LocalizationState::kWaitingForDatum;
  if (!status.last_fix) return LocalizationState::kWaitingForFix;
  return LocalizationState::kInitializing;
}

/// Standard deviation along the longest axis of the ellipse.
double largest_sigma(const Eigen::Matrix2d& covariance) {
  return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(covariance).eigenvalues()(1)));
}

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

void StatusReporter::count(const FixOutcome& outcome) {
  counts_.last_fix = outcome;
  if (outcome.decision != FixDecision::kBiasCompensated && std::isfinite(outcome.nis)) gate_.add(outcome.nis);
  if (is_rejected(outcome.decision)) {
    ++counts_.fixes_rejected;
    return;
  }
  ++counts_.fixes_used;
  if (outcome.of_ranges) ++counts_.fixes_with_ranges;
  last_used_ = outcome.stamp;
}

void StatusReporter::note_start_fix(const FixOutcome& outcome, bool is_start) {
  counts_.last_fix = outcome;
  if (is_start) last_used_ = outcome.stamp;
}

void StatusReporter::note_waiting_fix(Stamp stamp) {
  counts_.last_fix = {};
  counts_.last_fix.stamp = stamp;
  counts_.last_fix.reason = "waits for the datum";
}

std::string StatusReporter::last_rejection() const {
  const FixOutcome& last = counts_.last_fix;
  if (!is_rejected(last.decision)) return {};
  return std::string("; the last fix was ") + to_string(last.decision) + ": " + last.reason;
}

LocalizationReport StatusReporter::report(const PipelineStatus& status, const Localizer& localizer) const {
  LocalizationReport report = counts_;
  report.time_to_detect_s = status.time_to_detect_s;
  report.time_to_recover_s = status.time_to_recover_s;
  report.fix_delay_s = status.fix_delay_s;
  report.bias_radius_m = status.bias_radius_m;
  report.receiver_note = status.receiver_note;
  if (status.last_odometry && last_used_) report.fix_age_s = to_seconds(*status.last_odometry - *last_used_);
  if (status.last_odometry && status.last_fix) {
    report.odometry_age_s = std::max(0.0, to_seconds(*status.last_fix - *status.last_odometry));
  }
  if (!status.has_started) {
    report.state = state_before_start(status);
    report.reason = "waiting for " + status.waiting_for;
    return report;
  }
  report.health = localizer.health();
  report.is_gate_inert = is_gate_inert(localizer);
  if (std::isfinite(report.health.bias_radius_m)) report.bias_radius_m = report.health.bias_radius_m;
  report.position_sigma_m =
      largest_sigma(localizer.estimate().covariance.topLeftCorner<2, 2>() + status.contradiction_m2);
  report.protection_level_m = protection_level_m(report.position_sigma_m);
  report.heading_converged = report.health.heading_sigma_rad < parameters_.heading_converged_sigma;
  judge(status, report);
  return report;
}

void StatusReporter::judge(const PipelineStatus& status, LocalizationReport& report) const {
  const bool is_starved = !(report.fix_age_s <= parameters_.fix_timeout);
  report.state = status.is_lost ? LocalizationState::kLost
                 : is_starved   ? LocalizationState::kDeadReckoning
                                : LocalizationState::kTracking;
  report.reason = complaint(status, report);
  report.healthy = report.reason.empty();
  if (!report.healthy) return;
  report.reason = status.receiver_note;
  if (report.reason.empty() && report.is_gate_inert) report.reason = kInertGate;
}

std::string StatusReporter::complaint(const PipelineStatus& status, const LocalizationReport& report) const {
  if (status.is_lost) return "every fix is farther than max_bias_radius";
  if (report.state == LocalizationState::kDeadReckoning) {
    return last_used_ ? "no fix was used for " + seconds_text(report.fix_age_s) : "no fix was used yet";
  }
  if (report.odometry_age_s > odometry_gap_s_) return "no odometry for " + seconds_text(report.odometry_age_s);
  if (!status.complaint.empty()) return status.complaint;
  if (!report.heading_converged) return "heading not known yet";
  if (report.health.cluster_mass < kLeastClusterMass) {
    return "particles disagree: no cluster holds half of the weight";
  }
  return {};
}

}  // namespace urban_gnss
