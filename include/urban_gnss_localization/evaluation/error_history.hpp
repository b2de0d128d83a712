#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "urban_gnss_localization/evaluation/trajectory_errors.hpp"

namespace urban_gnss {

/// The errors of several estimates of one truth as they come, over the last while. A clock that is set back starts it
/// anew.
class ErrorHistory {
 public:
  /// Keeps poses of `window`, at least `interval` apart. Requires positive durations.
  ErrorHistory(std::size_t estimate_count, Stamp window, Stamp interval);

  /// Poses that are not finite are left out, as are those that are not newer than the last of theirs.
  void add_truth(const TimedPose& truth) { add(0, truth); }
  /// Requires which < estimate_count.
  void add_estimate(std::size_t which, const TimedPose& estimate) { add(which + 1, estimate); }

  bool has_truth() const { return !streams_.front().empty(); }
  /// Of the newest pose; nothing before the first.
  std::optional<Stamp> latest() const { return latest_; }
  /// Of one estimate, at the truth's stamps within the window. Requires which < estimate_count.
  TrajectoryErrors errors(std::size_t which) const { return errors_at_truth(streams_.front(), streams_[which + 1]); }

 private:
  void add(std::size_t stream, const TimedPose& pose);

  Stamp window_;
  Stamp interval_;
  std::optional<Stamp> latest_;
  std::vector<Trajectory> streams_;  ///< the truth, then the estimates
};

}  // namespace urban_gnss
