#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/pipeline/pipeline_event.hpp"
#include "urban_gnss_localization/pipeline/stamp_monitor.hpp"

namespace urban_gnss {

/// What the stamps of the messages tell.
struct StampParameters {
  double odometry_gap{2.0};
  double time_jump{1.0};
  bool reset_on_time_jump{true};

  void visit(ParameterVisitor& v) {
    v("odometry_gap", odometry_gap, positive(), "s",
      "time without odometry after which the robot's position is unknown and localizer and bias filter restart");
    v("time_jump", time_jump, positive(), "s",
      "difference by which a stamp must be older than the last for its clock to count as set back");
    v("reset_on_time_jump", reset_on_time_jump,
      "whether to restart when a clock is set back, e.g. in a bag played in a loop");
  }
};

enum class InputStream { kOdometry, kFixes, kImu, kVelocities, kEstimates };
/// As an event names it.
const char* to_string(InputStream stream);

/// The clocks of a pipeline's inputs, one a stream. Stamps ascend in each.
///
/// A message with an odd stamp is held back. If its stream goes on from there, its clock was set, and the messages that
/// were held back are given again; if not, they are forgotten, and an event says so. All clocks count as set back where
/// the odometry goes on in the past, or the odometry and another stream are both in the past; then everything starts
/// anew. Of another stream alone only that one starts anew.
class InputClocks {
 public:
  /// What the pipeline does where clocks were set.
  struct Actions {
    std::function<void(const std::string& why)> reset;  ///< everything starts anew
    std::function<void(InputStream)> restart;           ///< one stream does
  };
  using Again = std::function<void()>;
  using Refuse = std::function<void(const std::string& why)>;

  /// Requires parameters without faults.
  InputClocks(const StampParameters& parameters, Actions actions);

  /// Whether a message with this stamp is to be used now. `again` gives the same message again. Calls an action before,
  /// and gives again what was held back, where clocks were set.
  bool accept(InputStream stream, Stamp stamp, const Again& again, std::vector<PipelineEvent>& events);
  /// The same, as a verdict: kNew, kNotNewer, or kOdd. Where the message is left out for good, `refuse` is told, or
  /// there is an event.
  StampVerdict judge(InputStream stream, Stamp stamp, const Again& again, std::vector<PipelineEvent>& events,
                     const Refuse& refuse = {});

  /// Of all streams since the start: messages that were left out for an odd stamp.
  std::size_t odd_count() const { return odd_count_; }
  void reset();

 private:
  struct Held {
    InputStream stream;
    Stamp stamp;
    Again again;
    Refuse refuse;
  };
  StampMonitor& monitor(InputStream stream) { return monitors_[static_cast<std::size_t>(stream)]; }
  /// Against which the stream's stamps are judged.
  std::optional<Stamp> reference_of(InputStream stream);
  /// Whether, with a stamp of the past in stream `now`, all clocks count as set back.
  bool all_went_back(InputStream now) const;
  void hold(Held message, std::vector<PipelineEvent>& events);
  /// Takes out what is held back of the stream.
  std::vector<Held> release(InputStream stream);
  void leave_out(const std::vector<Held>& odd, Stamp last, std::vector<PipelineEvent>& events);
  static void give_again(const std::vector<Held>& held);

  StampParameters parameters_;
  Actions actions_;
  std::vector<StampMonitor> monitors_;
  std::vector<Held> held_;  ///< in the order in which they came
  std::size_t odd_count_{0};
};

}  // namespace urban_gnss
