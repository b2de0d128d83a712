#pragma once

#include <deque>
#include <vector>

#include "urban_gnss_localization/gnss/satellite_epoch.hpp"

namespace urban_gnss {

/// Pairs satellites with the fix that they belong to, where a driver stamps the two apart: each epoch gets the stamp of
/// the nearest fix, if that is nearer than half the interval between fixes, and keeps its residuals then. An epoch that
/// belongs to no fix keeps its own stamp and loses its residuals.
class SolutionMatcher {
 public:
  /// The stamps of fixes must ascend.
  void add_fix(Stamp stamp) { add_fix(stamp, stamp); }
  /// The same where the stamps that are compared are not those that are given: `told` by the clock that stamps the
  /// satellites.
  void add_fix(Stamp told, Stamp given);
  /// `epoch.stamp`: as its own message has it.
  void add_satellites(SatelliteEpoch epoch);
  /// Nothing more comes.
  void finish();
  /// Those whose fix is known.
  std::vector<SatelliteEpoch> take();

 private:
  /// Half the interval between fixes, and no more than 0.5 s.
  double reach_s() const;
  /// Whether a later fix cannot be nearer to the epoch.
  bool is_decided(const SatelliteEpoch& epoch) const;
  void decide(SatelliteEpoch epoch);
  void settle();

  struct Fix {
    Stamp told;
    Stamp given;
  };
  std::deque<Fix> fixes_;
  double interval_s_{1.0};
  std::deque<SatelliteEpoch> waiting_;
  std::vector<SatelliteEpoch> done_;
};

}  // namespace urban_gnss
