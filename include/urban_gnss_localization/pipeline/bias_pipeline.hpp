#pragma once

#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/localizers/nishida/bias_kalman_filter.hpp"
#include "urban_gnss_localization/motion/odometry_history.hpp"
#include "urban_gnss_localization/pipeline/fix_queue.hpp"
#include "urban_gnss_localization/pipeline/input_clocks.hpp"
#include "urban_gnss_localization/pipeline/input_parameters.hpp"
#include "urban_gnss_localization/pipeline/odometry_source.hpp"
#include "urban_gnss_localization/pipeline/pipeline_event.hpp"

namespace urban_gnss {

struct BiasPipelineParameters {
  InputParameters input;
  double estimate_timeout{0.2};
  GpsBiasParameters bias;

  void visit(ParameterVisitor& v) {
    v.include(input);
    v("estimate_timeout", estimate_timeout, non_negative(), "s",
      "time, by the odometry's stamps, that a fix waits for an estimate; then odometry alone carries the last one on "
      "to it");
    v.group("bias_filter", bias, "Kalman filter of the bias, Nishida et al. eq. (14) to (21).");
  }
};

/// Everything between the messages and the bias filter: the fix is compared with the localizer's estimate, carried to
/// the fix's stamp by the odometry.
class BiasPipeline {
 public:
  /// Requires parameters without faults.
  explicit BiasPipeline(const BiasPipelineParameters& parameters);
  BiasPipeline(const BiasPipeline&) = delete;  // its clocks refer to it
  BiasPipeline& operator=(const BiasPipeline&) = delete;

  void set_datum(const GeodeticPosition& datum);
  /// Sets the antenna's place in the base frame (m), e.g. as tf says it. Requires finite numbers.
  void set_antenna_offset(const Eigen::Vector2d& offset) { antenna_ = offset; }
  void add_odometry(const OdometrySample& told);
  /// The localizer's estimate of the base in the map frame.
  void add_estimate(Stamp stamp, const Pose2& pose);
  void add_fix(const RawFix& fix);
  /// A fix that nothing can be said of but why it is not used.
  void refuse_fix(Stamp stamp, const std::string& reason);
  void reset(const std::string& why);

  /// One estimate a fix, rejected fixes included.
  std::vector<BiasEstimate> take_estimates();
  std::vector<PipelineEvent> take_events();
  /// What is missing, for people; empty where nothing is.
  std::string waiting_for() const;

 private:
  void process_fixes();
  bool process_next_fix();
  std::optional<Pose2> pose_at(Stamp stamp) const;
  /// The clock of this stream alone was set back.
  void restart(InputStream stream);
  void pass_on(const FixOutcome& outcome);

  BiasPipelineParameters parameters_;
  Eigen::Vector2d antenna_;  ///< m, in the base frame
  BiasTracker tracker_;
  InputClocks clocks_;
  std::optional<LocalFrame> frame_;
  OdometrySource odometry_;
  OdometryHistory history_;
  std::deque<std::pair<Stamp, Pose2>> poses_;  ///< the localizer's estimates
  FixQueue fixes_;
  std::vector<BiasEstimate> estimates_;
  std::vector<PipelineEvent> events_;
};

}  // namespace urban_gnss
