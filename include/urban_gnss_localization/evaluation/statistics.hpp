#pragma once

#include <cstddef>
#include <limits>
#include <vector>

namespace urban_gnss {

/// A sample in a few numbers, in the sample's own unit. All but the count are NaN for an empty sample.
struct Summary {
  std::size_t count{0};
  double mean{std::numeric_limits<double>::quiet_NaN()};
  double sigma{std::numeric_limits<double>::quiet_NaN()};  ///< sample standard deviation (n - 1); NaN for one value
  double rmse{std::numeric_limits<double>::quiet_NaN()};   ///< root of the mean square, about zero
  double median{std::numeric_limits<double>::quiet_NaN()};
  double p95{std::numeric_limits<double>::quiet_NaN()};  ///< 95th percentile
  double max{std::numeric_limits<double>::quiet_NaN()};
};

/// The value below which `percent` (0 to 100) of the sample lies, by linear interpolation between the order statistics
/// (numpy's default, type 7 of Hyndman and Fan). NaN for an empty sample. Requires values that are not NaN, ascending.
double percentile(const std::vector<double>& ascending, double percent);

/// Requires values that are not NaN.
Summary summarize(std::vector<double> sample);

}  // namespace urban_gnss
