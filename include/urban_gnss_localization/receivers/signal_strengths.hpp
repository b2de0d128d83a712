#pragma once

#include <cmath>
#include <map>

#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

/// C/N0 of the signals of one satellite. That of the first signal counts, the one about L1 that every receiver has and
/// that models of C/N0 are of: its neighbours in other bands are some dB stronger or weaker. Where it is not tracked,
/// the strongest of the others counts.
class SignalStrengths {
 public:
  /// `rank`: 0 for the first signal. NaN where the signal is not tracked. Of two reports the stronger counts.
  void add(int rank, double cn0_dbhz) {
    const auto [place, is_new] = by_rank_.emplace(rank, cn0_dbhz);
    if (!is_new) place->second = std::fmax(place->second, cn0_dbhz);
  }
  void add(const SignalStrengths& other) {
    for (const auto& [rank, cn0_dbhz] : other.by_rank_) add(rank, cn0_dbhz);
  }

  /// NaN where no signal is tracked.
  double cn0_dbhz() const {
    if (by_rank_.empty()) return SatelliteObservation::kUnknown;
    double chosen = by_rank_.begin()->second;
    if (std::isfinite(chosen)) return chosen;
    for (const auto& [rank, cn0_dbhz] : by_rank_) chosen = std::fmax(chosen, cn0_dbhz);
    return chosen;
  }

 private:
  std::map<int, double> by_rank_;
};

/// A satellite with all of its signals.
struct SatelliteSignals {
  SatelliteObservation satellite;  ///< its C/N0 is that of `signals`
  SignalStrengths signals;

  void add_signal(int rank, double cn0_dbhz) {
    signals.add(rank, cn0_dbhz);
    update();
  }
  void add_signals(const SignalStrengths& others) {
    signals.add(others);
    update();
  }

 private:
  void update() {
    satellite.cn0_dbhz = signals.cn0_dbhz();
    satellite.tracked = has_cn0(satellite);
  }
};

}  // namespace urban_gnss
