#pragma once

#include <chrono>
#include <cmath>

namespace urban_gnss {

/// Time of a measurement as nanoseconds since the epoch of its clock. Integral, so that two messages of one instant
/// compare equal and a stamp survives being stored and published again.
using Stamp = std::chrono::nanoseconds;

/// A duration (or a stamp) in seconds.
inline double to_seconds(Stamp duration) { return std::chrono::duration<double>(duration).count(); }

/// Seconds as a duration, rounded to the nearest nanosecond. Requires a finite value of less than 292 years.
inline Stamp from_seconds(double seconds) { return Stamp(std::llround(seconds * 1e9)); }

}  // namespace urban_gnss
