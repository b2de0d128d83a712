#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

/// A pseudorange, linearised at a reference position near the antenna (east, north, up).
struct RangeMeasurement {
  Constellation constellation{Constellation::kGps};  ///< each has a clock unknown of its own
  Eigen::Vector3d line_of_sight{0.0, 0.0, 1.0};      ///< unit, to the satellite
  double range_m{0.0};                               ///< pseudorange minus distance from the reference position
  double sigma_m{1.0};                               ///< > 0, what the receiver believes of it
};

/// A weak belief about the height, which receivers on the ground have.
struct AltitudePrior {
  double altitude_m{0.0};  ///< above the reference position
  double sigma_m{30.0};    ///< > 0
};

struct PositionSolution {
  Eigen::Vector3d position{Eigen::Vector3d::Zero()};  ///< m, from the reference position
  std::vector<bool> used;                             ///< for each measurement
  std::vector<double> residuals_m;                    ///< measured minus predicted; NaN where not used
  int used_count{0};
  int clock_count{0};
  /// Unweighted dilutions of precision of the measurements used, without the prior.
  double hdop{0.0};
  double vdop{0.0};
};

/// Weighted least squares for position and one clock per constellation, as a consumer receiver does it: nothing is
/// tested or left out for its residual. One step, since the curvature of ranges of 20 000 km is 0.1 mm at 50 m.
///
/// A constellation with a single satellite, which could only tell its own clock, is left out. Nothing where fewer than
/// 3 plus the number of clocks remain, or where the geometry is singular (dilution_of_precision()).
std::optional<PositionSolution> solve_position(const std::vector<RangeMeasurement>& measurements,
                                               const std::optional<AltitudePrior>& prior = std::nullopt);

}  // namespace urban_gnss
