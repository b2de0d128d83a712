#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/fix_decision.hpp"
#include "urban_gnss_localization/gnss/inert_gate.hpp"
#include "urban_gnss_localization/localizers/localizer.hpp"

namespace urban_gnss {

/// Without a fix, a status is published this often.
constexpr double kStatusPeriod_s = 1.0;

/// When a localizer is said to be well.
struct StatusParameters {
  double fix_timeout{10.0};
  double heading_converged_sigma{0.3};
  InertGateParameters gate;

  void visit(ParameterVisitor& v) {
    v("fix_timeout", fix_timeout, positive(), "s", "time without a used fix after which the status is dead reckoning");
    v("heading_converged_sigma", heading_converged_sigma, positive(), "rad",
      "standard deviation of the heading below which it counts as known (~status, healthy)");
    v.include(gate);
  }
};

/// The states of LocalizationStatus.msg.
enum class LocalizationState : std::uint8_t {
  kWaitingForOdometry = 0,
  kWaitingForFix = 1,
  kWaitingForDatum = 2,
  kInitializing = 3,
  kTracking = 4,
  kDeadReckoning = 5,
  kLost = 6,
};
const char* to_string(LocalizationState state);

/// What LocalizationStatus.msg says.
struct LocalizationReport {
  LocalizationState state{LocalizationState::kWaitingForOdometry};
  bool healthy{false};
  std::string reason;         ///< why not healthy; where healthy, the receiver's note
  std::string receiver_note;  ///< what is wrong with its covariances, but was allowed for; empty where nothing is
  FixOutcome last_fix;
  std::uint64_t fixes_used{0};
  std::uint64_t fixes_rejected{0};
  std::uint64_t fixes_with_ranges{0};  ///< of those used, with FixOutcome::of_ranges
  std::uint64_t velocities_used{0};    ///< of the receiver
  double fix_age_s{std::numeric_limits<double>::quiet_NaN()};
  double odometry_age_s{0.0};
  double position_sigma_m{std::numeric_limits<double>::quiet_NaN()};
  double protection_level_m{std::numeric_limits<double>::quiet_NaN()};
  double time_to_detect_s{std::numeric_limits<double>::quiet_NaN()};   ///< IntegrityMonitor
  double time_to_recover_s{std::numeric_limits<double>::quiet_NaN()};  ///< IntegrityMonitor
  double fix_delay_s{0.0};                                             ///< FixDelayEstimator
  bool heading_converged{false};
  bool is_gate_inert{false};  ///< the fixes scatter far less than they declare, so that the gate finds nothing
  double bias_radius_m{std::numeric_limits<double>::quiet_NaN()};
  LocalizerHealth health;
};

/// How a pipeline stands.
struct PipelineStatus {
  std::optional<Stamp> last_odometry;
  std::optional<Stamp> last_fix;  ///< that was validated
  bool has_datum{false};
  bool has_started{false};
  bool is_lost{false};
  std::string waiting_for;                                         ///< empty where it waits for nothing
  double bias_radius_m{std::numeric_limits<double>::quiet_NaN()};  ///< of the last gps/bias
  std::string complaint;  ///< of sources that contradict each other; empty where they do not
  Eigen::Matrix2d contradiction_m2{
      Eigen::Matrix2d::Zero()};  ///< that the published covariance has beside the localizer's
  double time_to_detect_s{std::numeric_limits<double>::quiet_NaN()};
  double time_to_recover_s{std::numeric_limits<double>::quiet_NaN()};
  double fix_delay_s{0.0};
  std::string receiver_note;  ///< what is wrong with the receiver's covariances; empty where nothing is
};

/// Counts what was decided, and says how a pipeline and its localizer are.
class StatusReporter {
 public:
  /// `odometry_gap_s`: without odometry for longer than this, the localizer is not well. Requires parameters without
  /// faults.
  StatusReporter(const StatusParameters& parameters, double odometry_gap_s)
      : parameters_(parameters), odometry_gap_s_(odometry_gap_s), gate_(parameters.gate) {}

  /// A fix was used or rejected.
  void count(const FixOutcome& outcome);
  /// Whether a gate, if the localizer has one, finds nothing (InertGate).
  bool is_gate_inert(const Localizer& localizer) const { return localizer.gates() && gate_.is_inert(); }
  /// A fix was not examined, as it went into the start; `is_start`: the localizer started with it.
  void note_start_fix(const FixOutcome& outcome, bool is_start);
  /// A fix waits for the datum.
  void note_waiting_fix(Stamp stamp);
  /// Why the last fix was rejected, as the rest of a sentence on what is waited for; empty where it was not.
  std::string last_rejection() const;
  void count_velocity() { ++counts_.velocities_used; }

  LocalizationReport report(const PipelineStatus& status, const Localizer& localizer) const;

  void reset() { *this = StatusReporter(parameters_, odometry_gap_s_); }

 private:
  void judge(const PipelineStatus& status, LocalizationReport& report) const;
  /// Why the localizer is not well; empty where it is.
  std::string complaint(const PipelineStatus& status, const LocalizationReport& report) const;

  StatusParameters parameters_;
  double odometry_gap_s_;
  LocalizationReport counts_;  ///< of which the last fix and the counts are used
  std::optional<Stamp> last_used_;
  InertGate gate_;
};

}  // namespace urban_gnss
