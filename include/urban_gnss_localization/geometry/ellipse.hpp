#pragma once

namespace urban_gnss {

/// Squared error of a position over its covariance that is not exceeded with 95 %: the quantile of the chi-squared
/// distribution of 2 degrees of freedom. Its root times the standard deviations along the axes are the radii of the
/// 95 % ellipse.
inline constexpr double kEllipse95 = 5.991464547107979;

}  // namespace urban_gnss
