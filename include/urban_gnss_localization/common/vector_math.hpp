#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

/// A function with loops over many numbers: built for several widths of the processor's vectors, of which the widest
/// that it has is chosen at run time. The versions round alike, so every processor gives the same numbers: such a
/// source file is built without fused multiplication and addition (vector_sources in CMakeLists.txt).
/// Not with sanitizers, which are not ready yet when it is chosen.
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define URBAN_GNSS_VECTORISED __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define URBAN_GNSS_VECTORISED
#endif
/// A function that becomes a part of such a loop.
#define URBAN_GNSS_INLINE inline __attribute__((always_inline))
#define URBAN_GNSS_INLINE_LAMBDA __attribute__((always_inline))

namespace urban_gnss {

inline constexpr float kPiF = 3.14159265F;

namespace vector_math {

URBAN_GNSS_INLINE float from_bits(std::uint32_t bits) {
  float number;
  std::memcpy(&number, &bits, sizeof number);
  return number;
}

URBAN_GNSS_INLINE std::uint32_t to_bits(float number) {
  std::uint32_t bits;
  std::memcpy(&bits, &number, sizeof bits);
  return bits;
}

/// The nearest integer of a number below 2^22, as a float, and in the lowest bits of an integer.
struct Rounded {
  float value;
  std::uint32_t bits;
};
URBAN_GNSS_INLINE Rounded round(float x) {
  constexpr float kShift = 0x1.8p23F;  // where floats are the integers
  const float shifted = x + kShift;
  return {shifted - kShift, to_bits(shifted)};
}

URBAN_GNSS_INLINE float clamp(float x, float lowest, float highest) {
  x = x < lowest ? lowest : x;
  return x > highest ? highest : x;
}

}  // namespace vector_math

// Exponential, logarithm, sine and cosine in plain arithmetic, for loops that the compiler vectorises. The polynomials
// are those of Moshier's Cephes library (1992). Errors, which a test bounds: 2e-7 of the exponential, 2e-7 of a
// logarithm, or 1e-7 in it where it is small, and 1e-7 in sine and cosine of up to 100 rad.

/// e^x; 0 below -87, where floats end, and that of 88 above. NaN of NaN.
URBAN_GNSS_INLINE float vector_exp(float x) {
  using namespace vector_math;
  const float inside = clamp(x, -87.0F, 88.0F);
  const Rounded n = round(inside * 1.44269504F);
  const float r = (inside - n.value * 0.693359375F) + n.value * 2.12194440e-4F;  // minus n ln 2, in two parts
  float y = 1.9875691500e-4F;
  for (const float c : {1.3981999507e-3F, 8.3334519073e-3F, 4.1665795894e-2F, 1.6666665459e-1F, 5.0000001201e-1F}) {
    y = y * r + c;
  }
  y = (y * r * r + r) + 1.0F;
  const float power = from_bits((n.bits + 127U) << 23U);
  return x < -87.0F ? 0.0F : y * power;
}

/// The natural logarithm of a normal positive number.
URBAN_GNSS_INLINE float vector_log(float x) {
  using namespace vector_math;
  // So that the rest lies between sqrt(1/2) and sqrt(2).
  const std::int32_t exponent = static_cast<std::int32_t>(to_bits(x) - 0x3F3504F3U) >> 23;
  const float m = from_bits(to_bits(x) - (static_cast<std::uint32_t>(exponent) << 23U)) - 1.0F;
  const float e = static_cast<float>(exponent);
  float y = 7.0376836292e-2F;
  for (const float c : {-1.1514610310e-1F, 1.1676998740e-1F, -1.2420140846e-1F, 1.4249322787e-1F, -1.6668057665e-1F,
                        2.0000714765e-1F, -2.4999993993e-1F, 3.3333331174e-1F}) {
    y = y * m + c;
  }
  const float square = m * m;
  y = (y * m * square - e * 2.12194440e-4F) - 0.5F * square;
  return (m + y) + e * 0.693359375F;
}

struct SineCosine {
  float sine, cosine;
};

/// Sine and cosine. Beyond 1e5 rad, where floats know no angle, that of 1e5.
URBAN_GNSS_INLINE SineCosine vector_sincos(float x) {
  using namespace vector_math;
  x = clamp(x, -1e5F, 1e5F);
  const Rounded quarter = round(x * 0.636619772F);
  const float r = ((x - quarter.value * 1.5703125F) - quarter.value * 4.837512969970703125e-4F) -
                  quarter.value * 7.54978995489188e-8F;  // minus quarters of pi / 2, in three parts
  const float square = r * r;
  const float s = ((-1.9515295891e-4F * square + 8.3321608736e-3F) * square - 1.6666654611e-1F) * square * r + r;
  const float c =
      ((2.443315711809948e-5F * square - 1.388731625493765e-3F) * square + 4.166664568298827e-2F) * square * square -
      0.5F * square + 1.0F;
  const bool is_odd = (quarter.bits & 1U) != 0;
  const std::uint32_t sine_sign = (quarter.bits & 2U) << 30U;
  const std::uint32_t cosine_sign = ((quarter.bits + 1U) & 2U) << 30U;
  return {from_bits(to_bits(is_odd ? c : s) ^ sine_sign), from_bits(to_bits(is_odd ? s : c) ^ cosine_sign)};
}

/// The same angle in [-pi, pi] rad, within rounding.
URBAN_GNSS_INLINE float vector_wrap(float angle_rad) {
  using namespace vector_math;
  const float turns = round(clamp(angle_rad, -1e5F, 1e5F) * 0.159154943F).value;
  return ((angle_rad - turns * 6.28125F) - turns * 1.93500519e-3F) - turns * 3.0199159e-7F;
}

/// Sums of `kSums` terms over the numbers below `count`, in double: `term(i)` gives an array of the terms of i. The
/// terms are dealt to lanes that are summed in the end, so that the sum is the same for every width of vectors.
template <std::size_t kSums, class Term>
URBAN_GNSS_INLINE std::array<double, kSums> vector_sums(std::size_t count, const Term& term) {
  constexpr std::size_t kLanes = 16;
  double lanes[kSums][kLanes] = {};
  const std::size_t whole = count - count % kLanes;
  for (std::size_t first = 0; first < whole; first += kLanes) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const std::array<double, kSums> terms = term(first + lane);
      for (std::size_t k = 0; k < kSums; ++k) lanes[k][lane] += terms[k];
    }
  }
  for (std::size_t i = whole; i < count; ++i) {
    const std::array<double, kSums> terms = term(i);
    for (std::size_t k = 0; k < kSums; ++k) lanes[k][i - whole] += terms[k];
  }
  std::array<double, kSums> sums{};
  for (std::size_t k = 0; k < kSums; ++k) {
    for (const double lane : lanes[k]) sums[k] += lane;
  }
  return sums;
}

}  // namespace urban_gnss
