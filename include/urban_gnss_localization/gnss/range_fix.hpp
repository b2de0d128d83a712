#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

/// What the ranges of a fix are worth, one by one.
struct RangeFixParameters {
  bool use_ranges{true};
  double range_sigma{5.0};
  double range_sigma_min{0.6};
  double range_sigma_max{8.0};
  double reflected_range{18.0};
  double reflected_range_sigma{15.0};
  double reflected_elevation_exponent{0.7};
  double weak_cn0_drop{14.0};
  double weak_cn0_width{2.5};
  double antenna_cn0_rise{10.0};
  double range_height_sigma{30.0};
  double range_correlation_time{6.0};
  double range_bias_odds{0.03};

  void visit(ParameterVisitor& v) {
    v("use_ranges", use_ranges, "the ranges of a fix in place of the fix, where gps/satellites has their residuals");
    v("range_sigma", range_sigma, positive(), "m",
      "of a range in line of sight, before anything is learnt: noise, multipath, orbits");
    v("range_sigma_min", range_sigma_min, positive(), "m", "the least that it can be learnt to be");
    v("range_sigma_max", range_sigma_max, positive(), "m", "and the most: larger errors are those of reflections");
    v("reflected_range", reflected_range, non_negative(), "m",
      "mean by which a range is too long that is not in line of sight, at 37 degrees");
    v("reflected_range_sigma", reflected_range_sigma, positive(), "m", "about that mean");
    v("reflected_elevation_exponent", reflected_elevation_exponent, between(0.0, 5.0), "",
      "both grow with this power of 1 / sin(elevation)");
    v("weak_cn0_drop", weak_cn0_drop, between(0.0, 50.0), "",
      "dB below a free signal at which one is as likely reflected as direct");
    v("weak_cn0_width", weak_cn0_width, positive(), "dB", "that change these odds by e");
    v("antenna_cn0_rise", antenna_cn0_rise, between(-30.0, 30.0), "dB",
      "of a free signal's C/N0 from the horizon to the zenith");
    v("range_height_sigma", range_height_sigma, positive(), "m", "of the receiver's own height");
    v("range_correlation_time", range_correlation_time, non_negative(), "s",
      "over which the error of ranges stays the same; 0: independent errors");
    v("range_bias_odds", range_bias_odds, positive(), "",
      "factor on the odds of a bias of a fix whose ranges are known");
  }
  void check(std::vector<std::string>& faults) const {
    if (!(range_sigma_min <= range_sigma && range_sigma <= range_sigma_max)) {
      faults.push_back("range_sigma: must be between range_sigma_min and range_sigma_max");
    }
  }
  /// m, the geometric mean of the least and the most.
  double middle_range_sigma_m() const { return std::sqrt(range_sigma_min * range_sigma_max); }
};

/// How strong a receiver's free signals are: the upper decile of all C/N0 so far, as at an elevation of 37 degrees. It
/// depends on antenna and receiver by tens of dB.
class FreeSignalLevel {
 public:
  /// Leaves out satellites without C/N0, or without an elevation above the horizon.
  void add(const std::vector<SatelliteObservation>& satellites, const RangeFixParameters& parameters);
  /// dB-Hz; nothing before the first signal.
  std::optional<double> cn0_dbhz() const;
  void reset() { *this = {}; }

 private:
  static constexpr std::size_t kBins = 80;
  std::array<std::uint32_t, kBins> counts_{};  ///< of signals, by dB-Hz
  std::uint32_t total_{0};
};

/// A place with what is known of it, relative to a fix.
struct RelativePlace {
  Eigen::Vector2d offset{Eigen::Vector2d::Zero()};          ///< m, east and north of the fix
  Eigen::Matrix2d covariance{Eigen::Matrix2d::Identity()};  ///< m^2
};

/// What the ranges of one fix say of the antenna's place, but for what was known before: the fix's own solution, taken
/// apart and put together anew. A receiver solves for its position by least squares and reports the residual of each
/// range, so the range is known but for the clock: at a place d from the fix, its residual is r_i - h_i d, with
/// h_i = -(line of sight, ...) and a clock for each constellation.
///
/// A range is either in line of sight, with an error of range_sigma, or reflected: too long, by a Gaussian of
/// reflected_range. Before it is compared with the others, its C/N0 says which (log-odds by weak_cn0_drop and
/// weak_cn0_width, against `free_cn0_dbhz`). Then least squares over all ranges, the place `known` before and the
/// height alternate with a judgement of each range by its residual, as in expectation maximization (Dempster, Laird and
/// Rubin 1977), a fixed number of rounds. The judgement takes the residual's variance to be larger by that of the
/// place: softer than the exact step. In the end each range counts as one Gaussian with the moments of both kinds, so
/// that what is left open makes the covariance larger. `known` is not part of the result: that is the likelihood of the
/// ranges, with at least 100 m where they say nothing.
///
/// Nothing where fewer than 2 satellites share a clock.
std::optional<RelativePlace> range_fix(const std::vector<SatelliteObservation>& satellites, double free_cn0_dbhz,
                                       const RelativePlace& known, const RangeFixParameters& parameters);

}  // namespace urban_gnss
