#pragma once

#include <functional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
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

/// The clocks of a pipeline's inputs, one a stream. Stamps ascend in each. If one clock was set back, all count as set
/// back.
class InputClocks {
 public:
  /// Requires parameters without faults.
  explicit InputClocks(const StampParameters& parameters);

  /// Whether a message with this stamp is to be used: it is newer than the last of its stream, or the first after its
  /// clock was set back. In the latter case `reset` is called before, with the reason.
  bool accept(InputStream stream, Stamp stamp, const std::function<void(const std::string& why)>& reset);

  void reset();

 private:
  bool reset_on_time_jump_;
  std::vector<StampMonitor> monitors_;
};

}  // namespace urban_gnss
