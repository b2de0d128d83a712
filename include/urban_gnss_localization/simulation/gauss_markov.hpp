#pragma once

#include <cmath>

#include "urban_gnss_localization/common/random.hpp"

namespace urban_gnss {

/// A step of a stationary first-order Gauss-Markov process of variance 1 with the correlation time `time_s` > 0.
inline void step_gauss_markov(double& value, double interval_s, double time_s, RandomEngine& engine) {
  const double kept = std::exp(-interval_s / time_s);
  value = kept * value + std::sqrt(1.0 - kept * kept) * draw_normal(engine);
}

}  // namespace urban_gnss
