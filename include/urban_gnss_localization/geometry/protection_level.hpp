#pragma once

namespace urban_gnss {

/// Radius (m) of the circle about the estimate that holds the truth with 99.9 %, where the error is Gaussian with
/// `largest_sigma_m` (m) along the longest axis of its ellipse: sqrt(-2 ln 0.001) sigma. Exact for a circle, larger
/// than needed for an ellipse.
inline double protection_level_m(double largest_sigma_m) {
  constexpr double kFactor = 3.7169221888498383;
  return kFactor * largest_sigma_m;
}

}  // namespace urban_gnss
