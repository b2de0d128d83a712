#pragma once

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/gnss/fix_validation.hpp"
#include "urban_gnss_localization/localizers/nishida/bias_kalman_filter.hpp"
#include "urban_gnss_localization/motion/odometry_history.hpp"
#include "urban_gnss_localization/pipeline/stamp_monitor.hpp"

namespace urban_gnss {

struct BiasPipelineParameters {
  std::vector<double> antenna_offset{0.0, 0.0};
  double estimate_timeout{0.2};
  double odometry_gap{2.0};
  double time_jump{1.0};
  bool reset_on_time_jump{true};
  FixValidationParameters fix;
  GpsBiasParameters bias;

  void visit(ParameterVisitor& v) {
    v("antenna_offset", antenna_offset, "m", "x and y of the antenna in base_link_frame; the same as the localizer's");
    v("estimate_timeout", estimate_timeout, non_negative(), "s",
      "after a fix at which odometry alone carries the last estimate to it");
    v("odometry_gap", odometry_gap, positive(), "s",
      "without odometry after which nothing is known of the bias any more");
    v("time_jump", time_jump, positive(), "s",
      "a stamp older than the last by more than this is a clock that was set back");
    v("reset_on_time_jump", reset_on_time_jump, "start anew where a clock was set back");
    v.include(fix);
    v.include(bias);
  }
  void check(std::vector<std::string>& faults) const;
};

/// Everything between the messages and the bias filter: the fix is compared with the localizer's estimate, carried to
/// the fix's stamp by the odometry.
class BiasPipeline {
 public:
  /// Requires parameters without faults.
  explicit BiasPipeline(const BiasPipelineParameters& parameters);

  void set_datum(const GeodeticPosition& datum);
  /// Sets the antenna's place in the base frame (m), e.g. as tf says it. Requires finite numbers.
  void set_antenna_offset(const Eigen::Vector2d& offset) { parameters_.antenna_offset = {offset.x(), offset.y()}; }
  void add_odometry(const OdometrySample& sample);
  /// The localizer's estimate of the base in the map frame.
  void add_estimate(Stamp stamp, const Pose2& pose);
  void add_fix(const RawFix& fix);
  void reset(const std::string& why);

  /// One estimate a fix, rejected fixes included.
  std::vector<BiasEstimate> take_estimates();
  std::vector<PipelineEvent> take_events();
  /// What is missing, for people; empty where nothing is.
  std::string waiting_for() const;

 private:
  bool process_next_fix();
  std::optional<Pose2> pose_at(Stamp stamp) const;
  bool is_new(StampMonitor& monitor, Stamp stamp, const char* stream);
  void reject(const FixVerdict& verdict);

  BiasPipelineParameters parameters_;
  BiasTracker tracker_;
  std::optional<LocalFrame> frame_;
  OdometryHistory history_;
  StampMonitor odometry_stamps_;
  StampMonitor estimate_stamps_;
  StampMonitor fix_stamps_;
  std::deque<std::pair<Stamp, Pose2>> poses_;
  std::deque<ValidatedFix> pending_;
  std::optional<Stamp> last_fix_stamp_;
  std::vector<BiasEstimate> estimates_;
  std::vector<PipelineEvent> events_;
};

}  // namespace urban_gnss
