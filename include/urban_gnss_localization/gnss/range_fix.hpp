#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/nlos_model.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

/// Parameters of the ranges of a fix.
struct RangeFixParameters {
  bool use_ranges{true};
  double range_sigma{4.0};
  double range_sigma_min{0.6};
  double range_sigma_max{8.0};
  NlosParameters nlos;
  double nlos_cn0_drop{14.0};
  double range_height_sigma{30.0};
  double range_bias_odds{0.03};

  void visit(ParameterVisitor& v) {
    v("use_ranges", use_ranges,
      "whether a fix is solved anew from its ranges where gps/satellites has their residuals");
    v("range_sigma", range_sigma, positive(), "m",
      "initial standard deviation of a range in line of sight (noise, multipath, orbits)");
    v("range_sigma_min", range_sigma_min, positive(), "m",
      "least standard deviation that is learnt for a range in line of sight");
    v("range_sigma_max", range_sigma_max, positive(), "m",
      "greatest standard deviation that is learnt for a range in line of sight; larger errors are those of "
      "reflections");
    v.group("nlos", nlos, "Excess range of an NLOS signal.");
    v("nlos_cn0_drop", nlos_cn0_drop, between(0.0, 50.0), "dB",
      "drop of C/N0 below its nominal value at which a signal is as likely NLOS as in line of sight");
    v("range_height_sigma", range_height_sigma, positive(), "m", "standard deviation of the receiver's own height");
    v("range_bias_odds", range_bias_odds, positive(), "",
      "factor on the odds of a bias in a fix whose ranges are known");
  }
  void check(std::vector<std::string>& faults) const {
    if (!(range_sigma_min <= range_sigma && range_sigma <= range_sigma_max)) {
      faults.push_back("range_sigma: must be between range_sigma_min and range_sigma_max");
    }
  }
  /// m, the geometric mean of the least and the most.
  double middle_range_sigma_m() const { return std::sqrt(range_sigma_min * range_sigma_max); }
};

/// A place with what is known of it, relative to a fix.
struct RelativePlace {
  Eigen::Vector2d offset{Eigen::Vector2d::Zero()};          ///< m, east and north of the fix
  Eigen::Matrix2d covariance{Eigen::Matrix2d::Identity()};  ///< m^2
};

/// The likelihood of the antenna's place given the ranges of one fix: the position is solved anew from the ranges. A
/// receiver solves for its position by least squares and reports the residual of each range, so the range is known
/// except for the clock: at a place d from the fix, its residual is r_i - h_i d, with h_i = -(line of sight, ...) and a
/// clock for each constellation.
///
/// A range is either in line of sight, with an error of range_sigma, or NLOS, with an excess range by nlos_range(). Its
/// C/N0 gives the prior odds (nlos_log_odds(), even at nlos_cn0_drop below `nominal_cn0_dbhz`). Then least squares over
/// all ranges, the place `known` before and the height alternate with a judgement of each range by its residual, as in
/// expectation maximization (Dempster, Laird and Rubin 1977), a fixed number of rounds. The judgement takes the
/// residual's variance to be larger by that of the place: softer than the exact step. In the end each range counts as
/// one Gaussian with the moments of both kinds, so that what is left open makes the covariance larger. `known` is not
/// part of the result, which is the likelihood of the ranges alone. Its sigma is at least 100 m where they say nothing.
///
/// Nothing where fewer than 2 satellites share a clock.
std::optional<RelativePlace> range_fix(const std::vector<SatelliteObservation>& satellites, double nominal_cn0_dbhz,
                                       const RelativePlace& known, const RangeFixParameters& parameters);

}  // namespace urban_gnss
