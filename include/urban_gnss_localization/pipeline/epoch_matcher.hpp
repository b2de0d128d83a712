#pragma once

#include <deque>
#include <optional>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/gnss/satellite_epoch.hpp"

namespace urban_gnss {

/// Pairs fixes with satellites by their stamps; satellites may come before or after their fix.
class EpochMatcher {
 public:
  /// Stamps of a fix and of its own satellites differ by no more: some drivers round one of the two. Half the interval
  /// of a receiver with 50 Hz, so that those of its other fixes are farther.
  static constexpr double kSameEpoch_s = 0.01;

  /// Remembers the satellites; of many epochs the oldest are forgotten.
  void add(SatelliteEpoch epoch);

  /// Whether satellites of the fix are still to come: the fix before it had its own, and this one has none yet.
  bool awaits(Stamp fix) const;

  /// The fix's own satellites, as its turn has come; null where there are none.
  const SatelliteEpoch* take(Stamp fix);

  /// The satellites nearest to the stamp, no farther than `max_age_s`; of two that are as near, those that came last.
  /// Null where there are none.
  const SatelliteEpoch* nearest(Stamp stamp, double max_age_s) const;

  void reset() { *this = {}; }

 private:
  std::deque<SatelliteEpoch> epochs_;  ///< in the order in which they came
  std::optional<Stamp> last_fix_;      ///< that was taken
  bool last_had_satellites_{false};
};

}  // namespace urban_gnss
