#pragma once

#include <deque>
#include <optional>
#include <string>

#include "urban_gnss_localization/common/stamp.hpp"

namespace urban_gnss {

/// Notices that a stream comes at another rate than before, by its stamps: the rate of a second source adds to that of
/// the first. A stream with some gaps keeps its rate.
class RateMonitor {
 public:
  /// Takes the stamp of the next message, newer than the last. Returns "2 Hz, 1 Hz before" where the rate is another
  /// one from here on; empty elsewhere.
  std::string add(Stamp stamp);
  void reset() { *this = RateMonitor(); }

 private:
  std::deque<Stamp> stamps_;
  std::optional<double> interval_s_;  ///< as it was found last
};

}  // namespace urban_gnss
