#pragma once

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/localizers/switching/bias_ekf.hpp"

namespace urban_gnss {

/// A state of the switching bias with any covariance.
inline BiasGaussian random_gaussian(RandomEngine& engine) {
  BiasGaussian state;
  BiasEkfCovariance root;
  for (int i = 0; i < kBiasStates; ++i) {
    state.mean[i] = 0.3 * draw_normal(engine);
    for (int j = 0; j < kBiasStates; ++j) root(i, j) = draw_normal(engine);
  }
  state.covariance = root * root.transpose();
  return state;
}

}  // namespace urban_gnss
