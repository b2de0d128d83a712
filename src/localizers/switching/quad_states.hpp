#pragma once

#include <cstddef>
#include <utility>

#include "urban_gnss_localization/common/quad.hpp"
#include "urban_gnss_localization/localizers/switching/bias_quad.hpp"

// How the functions of bias_quad.hpp read and write the numbers of four states at once.

namespace urban_gnss {

/// Places of the states.
inline constexpr int kYaw = 2;
inline constexpr int kSpeedScale = 3;
inline constexpr int kYawRateBias = 4;
inline constexpr int kYawRateScale = kErrorStates;
inline constexpr int kBias = kMotionStates;

template <class F, int... kIndices>
URBAN_GNSS_INLINE void for_each_state(const F& f, std::integer_sequence<int, kIndices...>) {
  (f(kIndices), ...);
}
/// f(0), f(1), … of the first `kStates` states, without a loop, so that the compiler knows each index.
template <int kStates = kBiasStates, class F>
URBAN_GNSS_INLINE void for_each_state(const F& f) {
  for_each_state(f, std::make_integer_sequence<int, kStates>());
}
/// f(i, j) of the upper triangle.
template <int kStates = kBiasStates, class F>
URBAN_GNSS_INLINE void for_each_pair(const F& f) {
  for_each_state<kStates>([&](int i) URBAN_GNSS_INLINE_LAMBDA {
    for_each_state<kStates>([&](int j) URBAN_GNSS_INLINE_LAMBDA {
      if (i <= j) f(i, j);
    });
  });
}

URBAN_GNSS_INLINE Quad mean(const BiasQuad& q, int i) { return load(q.mean[static_cast<std::size_t>(i)].data()); }
URBAN_GNSS_INLINE Quad covariance(const BiasQuad& q, int i, int j) {
  return load(q.covariance[BiasQuad::pair(i, j)].data());
}
URBAN_GNSS_INLINE void set_mean(BiasQuad& q, int i, const Quad& value) {
  store(value, q.mean[static_cast<std::size_t>(i)].data());
}
URBAN_GNSS_INLINE void set_covariance(BiasQuad& q, int i, int j, const Quad& value) {
  store(value, q.covariance[BiasQuad::pair(i, j)].data());
}
URBAN_GNSS_INLINE void add_covariance(BiasQuad& q, int i, int j, const Quad& value) {
  set_covariance(q, i, j, covariance(q, i, j) + value);
}
URBAN_GNSS_INLINE Quad difference_of(int i, const Quad& a, const Quad& b) {
  return i == kYaw ? quad_wrap(a - b) : a - b;
}

}  // namespace urban_gnss
