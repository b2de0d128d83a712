#pragma once

#include <cstdint>
#include <cstring>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace urban_gnss {

/// Four numbers that are computed with together. The compiler's vectors: SSE2 or NEON, which every processor of the
/// kind has; each lane rounds as a single number does.
using Float4 = float __attribute__((vector_size(16)));
using Mask4 =
    std::int32_t __attribute__((vector_size(16)));  ///< what comparing Float4 gives: all bits of a lane or none

inline Float4 load4(const float* from) {
  Float4 four;
  std::memcpy(&four, from, sizeof four);
  return four;
}
inline void store4(float* to, Float4 four) { std::memcpy(to, &four, sizeof four); }
inline Float4 all4(float value) { return Float4{value, value, value, value}; }

/// A bit for each lane.
inline std::uint32_t bits_of(Mask4 mask) {
#ifdef __SSE2__
  __m128 lanes;
  std::memcpy(&lanes, &mask, sizeof lanes);
  return static_cast<std::uint32_t>(_mm_movemask_ps(lanes));
#else
  const Mask4 bits = mask & Mask4{1, 2, 4, 8};
  return static_cast<std::uint32_t>(bits[0] | bits[1] | bits[2] | bits[3]);
#endif
}

/// Four columns of four numbers as rows.
inline void transpose4(Float4& a, Float4& b, Float4& c, Float4& d) {
#ifdef __clang__
  const Float4 ab_low = __builtin_shufflevector(a, b, 0, 4, 1, 5);
  const Float4 ab_high = __builtin_shufflevector(a, b, 2, 6, 3, 7);
  const Float4 cd_low = __builtin_shufflevector(c, d, 0, 4, 1, 5);
  const Float4 cd_high = __builtin_shufflevector(c, d, 2, 6, 3, 7);
  a = __builtin_shufflevector(ab_low, cd_low, 0, 1, 4, 5);
  b = __builtin_shufflevector(ab_low, cd_low, 2, 3, 6, 7);
  c = __builtin_shufflevector(ab_high, cd_high, 0, 1, 4, 5);
  d = __builtin_shufflevector(ab_high, cd_high, 2, 3, 6, 7);
#else
  const Float4 ab_low = __builtin_shuffle(a, b, Mask4{0, 4, 1, 5});
  const Float4 ab_high = __builtin_shuffle(a, b, Mask4{2, 6, 3, 7});
  const Float4 cd_low = __builtin_shuffle(c, d, Mask4{0, 4, 1, 5});
  const Float4 cd_high = __builtin_shuffle(c, d, Mask4{2, 6, 3, 7});
  a = __builtin_shuffle(ab_low, cd_low, Mask4{0, 1, 4, 5});
  b = __builtin_shuffle(ab_low, cd_low, Mask4{2, 3, 6, 7});
  c = __builtin_shuffle(ab_high, cd_high, Mask4{0, 1, 4, 5});
  d = __builtin_shuffle(ab_high, cd_high, Mask4{2, 3, 6, 7});
#endif
}

}  // namespace urban_gnss
