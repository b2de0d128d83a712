#pragma once

namespace urban_gnss {

/// Radius (m) of the circle about the estimate that holds the truth with 99.9 %, where `largest_sigma_m` (m) is the
/// standard deviation along the longest axis of its ellipse. Errors among buildings have heavier tails than a Gaussian:
/// Student's t of 6 degrees of freedom in two dimensions, with that standard deviation, exceeds
/// sqrt((6 - 2) (0.001^(-2/6) - 1)) = 6 of them once in a thousand times (a Gaussian 3.7). Exact for a circle, larger
/// than needed for an ellipse. docs/results/recordings.md has the largest ratios that were seen.
inline double protection_level_m(double largest_sigma_m) {
  constexpr double kFactor = 6.0;
  return kFactor * largest_sigma_m;
}

}  // namespace urban_gnss
