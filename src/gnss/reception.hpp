#pragma once

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

inline constexpr double kReferenceSine = 0.6;  ///< of the elevation, 37 degrees
inline constexpr double kMaxLogOdds = 30.0;

inline double log_odds(double probability) { return std::log(probability / (1.0 - probability)); }

inline double probability_of(double log_odds) {
  return 1.0 / (1.0 + std::exp(-std::clamp(log_odds, -kMaxLogOdds, kMaxLogOdds)));
}

inline bool has_cn0(const SatelliteObservation& satellite) {
  return std::isfinite(satellite.cn0_dbhz) && satellite.cn0_dbhz > 0.0;  // receivers say 0 where they do not know
}

}  // namespace urban_gnss
