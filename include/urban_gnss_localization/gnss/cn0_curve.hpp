#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

/// The signals of a band of elevations.
struct Cn0Band {
  double from_rad{0.0};
  double to_rad{0.0};
  std::size_t signals{0};
  double median_dbhz{std::numeric_limits<double>::quiet_NaN()};
  double lower_decile_dbhz{std::numeric_limits<double>::quiet_NaN()};
};

/// How strongly a receiver receives signals in line of sight: c = level + rise (sin e - sin 37 deg), with Gaussian
/// scatter; as the NLOS model has it (cn0_gain_db()).
struct Cn0Curve {
  std::size_t signals{0};
  std::size_t satellites{0};
  double level_dbhz{0.0};  ///< at 37 degrees elevation
  double rise_db{0.0};     ///< from horizon to zenith; 0 where the elevations do not tell it
  bool has_rise{false};
  double scatter_db{0.0};      ///< standard deviation, by the median absolute deviation
  std::vector<Cn0Band> bands;  ///< of 10 degrees, those with signals

  /// C/N0 at 37 degrees below which one in a hundred free signals is.
  double weak_dbhz() const { return level_dbhz - kQuantile * scatter_db; }
  /// dB by which a signal must be weaker there for the odds against a free one to grow by a factor of e, where signals
  /// without line of sight are as likely at any C/N0.
  double odds_width_db() const;

 private:
  static constexpr double kQuantile = 2.3263;  ///< of the standard normal distribution, 99 %
};

/// Fits the curve to the satellites of all epochs that are is_received(), with a least sum of absolute deviations, so
/// that some blocked ones do no harm. Throws std::runtime_error where there are fewer than 100 signals of 4 satellites.
Cn0Curve fit_cn0_curve(const std::vector<SatelliteObservation>& signals);

}  // namespace urban_gnss
