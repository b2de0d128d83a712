#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/gnss/gnss_covariance.hpp"

namespace urban_gnss {

struct MapConsistencyParameters {
  double strong_cn0{40.0};
  double consistency_time{60.0};
  double doubtful_share{0.3};

  void visit(ParameterVisitor& v) {
    v("strong_cn0", strong_cn0, between(0.0, 70.0), "dB-Hz",
      "C/N0 from which on a signal is taken to have a line of sight");
    v("consistency_time", consistency_time, positive(), "s",
      "time after which the weight of an observation has fallen to 1/e");
    v("doubtful_share", doubtful_share, between(0.01, 1.0), "",
      "share of the blocked satellites received strongly at which heading or map is taken to be wrong");
  }
};

/// Whether what the map says agrees with what is received. Behind a building a signal is weak or not there at all. If
/// the heading is far off or the map is wrong, the satellites that the map blocks are received strongly as often as the
/// others. In a street that looks the same both ways this test does not find a heading that is off by 180 degrees.
class MapConsistency {
 public:
  /// Requires parameters without faults.
  explicit MapConsistency(const MapConsistencyParameters& parameters) : parameters_(parameters) {}

  /// The satellites of one fix with their blocked fractions; those of which the map says nothing do not count.
  void add(Stamp stamp, const std::vector<SatelliteObservation>& satellites);

  /// Share of the blocked satellites that are received strongly, lately; NaN before there is enough to tell.
  double strong_share() const;
  bool is_doubtful() const { return strong_share() >= parameters_.doubtful_share; }
  void reset() { *this = MapConsistency(parameters_); }

 private:
  static constexpr double kBlocked = 0.8;            ///< of a satellite's rays: surely blocked
  static constexpr double kEnough_s = 30.0;          ///< satellites times seconds
  static constexpr double kLongestInterval_s = 1.0;  ///< for which the satellites of one fix stand

  MapConsistencyParameters parameters_;
  std::optional<Stamp> last_;
  double blocked_s_{0.0};
  double strong_s_{0.0};
};

}  // namespace urban_gnss
