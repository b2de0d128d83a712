#include "urban_gnss_localization/gnss/correlated_errors.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {

double markov_inflation(double interval_s, double correlation_time_s) {
  constexpr double kMostInflation = 1e6;
  if (correlation_time_s <= 0.0) return 1.0;
  const double ratio = std::max(interval_s, 0.0) / correlation_time_s;
  return std::min(1.0 / std::tanh(0.5 * ratio), kMostInflation);
}

}  // namespace urban_gnss
