#pragma once

#include <cstdint>
#include <cstring>

#include "urban_gnss_localization/common/vector_math.hpp"

// How a Quad is passed to a function differs between processors. Here every such function becomes part of its caller.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace urban_gnss {

/// Four numbers side by side, with the compiler's arithmetic and comparisons: an instruction each where the processor
/// has vectors of 256 bits (URBAN_GNSS_VECTORISED), two else. All functions here work on each number for itself. No
/// more than the stack's own alignment is asked for, as GCC 12 does not always give an array of them more (its bug
/// 109780).
using Quad = double __attribute__((vector_size(32), aligned(16)));
/// Bits of four numbers, or the four answers of a comparison.
using QuadBits = std::int64_t __attribute__((vector_size(32), aligned(16)));

URBAN_GNSS_INLINE Quad quad(double x) { return Quad{x, x, x, x}; }
URBAN_GNSS_INLINE Quad load(const double* numbers) {
  Quad x;
  std::memcpy(&x, numbers, sizeof x);
  return x;
}
URBAN_GNSS_INLINE void store(const Quad& x, double* numbers) { std::memcpy(numbers, &x, sizeof x); }
URBAN_GNSS_INLINE double sum_of(const Quad& x) { return (x[0] + x[1]) + (x[2] + x[3]); }

namespace quad_math {

URBAN_GNSS_INLINE QuadBits bits(std::int64_t x) { return QuadBits{x, x, x, x}; }
URBAN_GNSS_INLINE QuadBits to_bits(const Quad& x) {
  QuadBits result;
  std::memcpy(&result, &x, sizeof x);
  return result;
}
URBAN_GNSS_INLINE Quad from_bits(const QuadBits& x) {
  Quad result;
  std::memcpy(&result, &x, sizeof x);
  return result;
}

inline constexpr double kShift = 0x1.8p52;  // where doubles are the integers
inline constexpr std::int64_t kShiftBits = 0x4338000000000000;
inline constexpr int kMantissa = 52;

/// The nearest integer of a number below 2^51.
URBAN_GNSS_INLINE Quad round(const Quad& x) { return (x + kShift) - kShift; }

/// Even and odd powers apart, so that they need not wait for each other.
template <int kCount>
URBAN_GNSS_INLINE Quad polynomial(const Quad& x, const double (&coefficients)[kCount]) {
  const Quad square = x * x;
  Quad highest = quad(coefficients[kCount - 1]);
  Quad next = quad(coefficients[kCount - 2]);
  for (int k = kCount - 3; k >= 0; k -= 2) {
    highest = highest * square + coefficients[k];
    if (k > 0) next = next * square + coefficients[k - 1];
  }
  return kCount % 2 == 0 ? highest * x + next : next * x + highest;
}

/// (sin(x) - x) / x^3 for a square x^2 < 0.62.
URBAN_GNSS_INLINE Quad sine_polynomial(const Quad& square) {
  return polynomial(square, {-1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04,
                             2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10});
}

}  // namespace quad_math

// The polynomials are those of Sun's fdlibm (1993). Errors, which a test bounds: 2e-16 of sine and cosine of up to
// 1e5 rad, 3e-16 of the others.

URBAN_GNSS_INLINE Quad quad_abs(const Quad& x) {
  return quad_math::from_bits(quad_math::to_bits(x) & quad_math::bits(0x7FFFFFFFFFFFFFFF));
}
URBAN_GNSS_INLINE Quad quad_min(const Quad& a, const Quad& b) { return b < a ? b : a; }
URBAN_GNSS_INLINE Quad quad_max(const Quad& a, const Quad& b) { return b > a ? b : a; }

/// e^x; 0 below -708, where normal numbers end, and that of 709 above. NaN of NaN.
URBAN_GNSS_INLINE Quad quad_exp(const Quad& x) {
  using namespace quad_math;
  const Quad inside = quad_max(quad_min(x, quad(709.0)), quad(-708.0));
  const Quad shifted = inside * 1.44269504088896338700e+00 + kShift;
  const Quad n = shifted - kShift;
  const Quad high = inside - n * 6.93147180369123816490e-01;  // minus n ln 2, in two parts
  const Quad low = n * 1.90821492927058770002e-10;
  const Quad r = high - low;
  const Quad square = r * r;
  const Quad c = r - square * polynomial(square, {1.66666666666666019037e-01, -2.77777777770155933842e-03,
                                                  6.61375632143793436117e-05, -1.65339022054652515390e-06,
                                                  4.13813679705723846039e-08});
  const Quad y = 1.0 - ((low - (r * c) / (2.0 - c)) - high);
  const Quad power = from_bits((to_bits(shifted) - kShiftBits + 1023) << kMantissa);
  const Quad result = y * power;
  return x < -708.0 ? Quad{} : result;
}

/// The natural logarithm of a normal positive number; NaN of what is not finite.
URBAN_GNSS_INLINE Quad quad_log(const Quad& x) {
  using namespace quad_math;
  // So that the rest lies between sqrt(1/2) and sqrt(2).
  const QuadBits above = to_bits(x) - 0x3FE6A09E667F3BCD;
  const QuadBits exponent = above >> kMantissa;
  const Quad k = from_bits(exponent + kShiftBits) - kShift;
  const Quad f = from_bits(to_bits(x) - (exponent << kMantissa)) - 1.0;
  const Quad s = f / (2.0 + f);
  const Quad square = s * s;
  const Quad r =
      square * polynomial(square, {6.666666666666735130e-01, 3.999999999940941908e-01, 2.857142874366239149e-01,
                                   2.222219843214978396e-01, 1.818357216161805012e-01, 1.531383769920937332e-01,
                                   1.479819860511658591e-01});
  const Quad half_square = 0.5 * f * f;
  const Quad result =
      k * 6.93147180369123816490e-01 - ((half_square - (s * (half_square + r) + k * 1.90821492927058770002e-10)) - f);
  return result + (x - x);
}

/// log(1 + x) for x >= 0, which keeps the digits of a small one.
URBAN_GNSS_INLINE Quad quad_log1p(const Quad& x) {
  const Quad above = 1.0 + x;
  return quad_log(above) + (x - (above - 1.0)) / above;
}

struct QuadSineCosine {
  Quad sine, cosine;
};

/// Sine and cosine. Beyond 1e5 rad, that of 1e5.
URBAN_GNSS_INLINE QuadSineCosine quad_sincos(const Quad& angle_rad) {
  using namespace quad_math;
  const Quad x = quad_max(quad_min(angle_rad, quad(1e5)), quad(-1e5));
  const Quad shifted = x * 6.36619772367581382433e-01 + kShift;
  const Quad n = shifted - kShift;
  // Minus quarters of pi / 2, in three parts.
  const Quad r =
      ((x - n * 1.57079632673412561417e+00) - n * 6.07710050630396597660e-11) - n * 2.02226624879595063154e-21;
  const Quad square = r * r;
  const Quad s = r + r * square * sine_polynomial(square);
  const Quad half = 0.5 * square;
  const Quad most = 1.0 - half;
  const Quad c = most + (((1.0 - most) - half) +
                         square * square *
                             polynomial(square, {4.16666666666666019037e-02, -1.38888888888741095749e-03,
                                                 2.48015872894767294178e-05, -2.75573143513906633035e-07,
                                                 2.08757232129817482790e-09, -1.13596475577881948265e-11}));
  const QuadBits quarter = to_bits(shifted);
  const QuadBits is_odd = (quarter & 1) != 0;
  const QuadBits sine_sign = (quarter & 2) << 62;
  const QuadBits cosine_sign = ((quarter + 1) & 2) << 62;
  return {from_bits(to_bits(is_odd ? c : s) ^ sine_sign), from_bits(to_bits(is_odd ? s : c) ^ cosine_sign)};
}

/// sin(x) / x for |x| <= pi / 4.
URBAN_GNSS_INLINE Quad quad_sinc(const Quad& angle_rad) {
  const Quad square = angle_rad * angle_rad;
  return 1.0 + square * quad_math::sine_polynomial(square);
}

/// The same angle in [-pi, pi) rad, as wrap_angle(), for angles of up to 1e9 rad.
URBAN_GNSS_INLINE Quad quad_wrap(const Quad& angle_rad) {
  constexpr double kTurn = 6.28318530717958647692;
  const Quad near = angle_rad - kTurn * quad_math::round(angle_rad * (1.0 / kTurn));
  const Quad below = near >= 0.5 * kTurn ? near - kTurn : near;
  return below < -0.5 * kTurn ? below + kTurn : below;
}

}  // namespace urban_gnss
