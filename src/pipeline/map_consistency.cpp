#include "urban_gnss_localization/pipeline/map_consistency.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {

void MapConsistency::add(Stamp stamp, const std::vector<SatelliteObservation>& satellites) {
  const double since_s = last_ ? std::max(0.0, to_seconds(stamp - *last_)) : 0.0;
  last_ = stamp;
  const double kept = std::exp(-since_s / parameters_.consistency_time);
  blocked_s_ *= kept;
  strong_s_ *= kept;
  const double interval_s = std::min(since_s, kLongestInterval_s);
  for (const SatelliteObservation& satellite : satellites) {
    if (!(satellite.blocked_fraction >= kBlocked)) continue;
    blocked_s_ += interval_s;
    if (satellite.tracked && satellite.cn0_dbhz >= parameters_.strong_cn0) strong_s_ += interval_s;
  }
}

double MapConsistency::strong_share() const {
  return blocked_s_ >= kEnough_s ? strong_s_ / blocked_s_ : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace urban_gnss
