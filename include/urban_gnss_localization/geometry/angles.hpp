#pragma once

#include <cmath>

namespace urban_gnss {

inline constexpr double kPi = 3.14159265358979323846;

/// The same angle in [-pi, pi) rad; NaN and infinities give NaN.
inline double wrap_angle(double angle_rad) {
  const double wrapped = angle_rad - 2.0 * kPi * std::floor((angle_rad + kPi) / (2.0 * kPi));
  return wrapped >= kPi ? wrapped - 2.0 * kPi : wrapped;
}

/// The smallest rotation from `from_rad` to `to_rad`, in [-pi, pi) rad: the paper's circled minus, to (-) from.
inline double angle_difference(double to_rad, double from_rad) { return wrap_angle(to_rad - from_rad); }

inline constexpr double degrees_to_radians(double degrees) { return degrees * (kPi / 180.0); }
inline constexpr double radians_to_degrees(double radians) { return radians * (180.0 / kPi); }

}  // namespace urban_gnss
