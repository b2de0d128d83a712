#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

/// A fix of a receiver that stands still, with the satellites of its epoch.
struct StationaryFix {
  Stamp stamp{0};
  Eigen::Vector2d position{Eigen::Vector2d::Zero()};  ///< m, east and north of any origin
  std::vector<SatelliteObservation> satellites;
};

struct UreCalibrationSettings {
  double max_hdop{2.0};
  /// Of the antenna (m, as the fixes), where it is known; otherwise their mean, and what they share is not seen.
  std::optional<Eigen::Vector2d> place;
};

/// The standard deviation of a range in line of sight, and how well it is known.
struct UreCalibration {
  std::size_t fixes{0};               ///< that were used
  std::size_t without_satellites{0};  ///< fixes that had too few satellites for a position
  std::size_t above_max_hdop{0};      ///< fixes of a poor geometry
  double duration_s{0.0};
  double median_hdop{0.0};
  double sigma_m{0.0};             ///< by the fixes
  double error_lasts_s{0.0};       ///< time constant of the fixes' errors
  double independent_errors{0.0};  ///< as how many the fixes count
  double relative_error{0.0};      ///< standard deviation of sigma_m, of sigma_m
  std::size_t residuals{0};
  std::optional<double> residual_sigma_m;  ///< by the residuals of the ranges, where there are any
};

/// sigma_URE as Maier and Kleiner found theirs (2010, section IV.B): "from collecting stationary measurements with good
/// satellite constellation (low HDOP values) and free of multipath effects".
///
/// The error e of a fix has the covariance sigma^2 M of eq. (4), so sigma^2 is the mean of e^T M^-1 e / 2. The errors
/// last: the fixes count as duration / (2 time constant) independent ones, of which the mean takes one. M is of the
/// satellites with a residual where there are residuals, else of all that are tracked. Residuals r of an epoch give
/// sigma^2 = sum r^2 / (their number - 3 - clocks).
///
/// Throws std::runtime_error, which says what is missing: satellites, a good geometry, at least 30 fixes, or a scatter.
UreCalibration calibrate_ure(const std::vector<StationaryFix>& fixes, const UreCalibrationSettings& settings);

}  // namespace urban_gnss
