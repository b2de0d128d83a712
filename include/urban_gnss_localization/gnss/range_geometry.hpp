#pragma once

#include <Eigen/Core>
#include <vector>

#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

/// Columns of RangeGeometry's matrix.
inline constexpr Eigen::Index kHeightColumn = 2;
inline constexpr Eigen::Index kFirstClockColumn = 3;

/// One range of a satellite.
struct RangeDirection {
  Constellation clock;            ///< by clock_of()
  Eigen::Vector3d line_of_sight;  ///< unit vector in east, north, up
};

/// What a range changes by, a row each: -(line of sight) for the antenna's place (m, east, north, up), and 1 for the
/// clock (m) of its constellation. Clocks have columns in the order in which they come first.
Eigen::MatrixXd range_geometry(const std::vector<RangeDirection>& ranges);

}  // namespace urban_gnss
