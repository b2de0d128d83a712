#pragma once

#include <cmath>

namespace urban_gnss {

/// The instants k / rate, k = 1, 2, ..., at which a simulated sensor delivers, in seconds since its start.
class SampleClock {
 public:
  /// `rate_hz` >= 0; with 0 it is never due.
  explicit SampleClock(double rate_hz) : rate_hz_(rate_hz) {}

  double period_s() const { return 1.0 / rate_hz_; }
  /// The next instant. Counted, not summed, so that it does not drift.
  double due_s() const { return static_cast<double>(count_ + 1) / rate_hz_; }
  /// Whether the next instant is at or before `time_s`.
  bool is_due(double time_s) const { return due_s() <= time_s + kRounding_s; }
  /// The next instant, or `time_s` where the two differ by rounding only: no sliver of a step is left over.
  double due_within(double time_s) const { return std::abs(due_s() - time_s) <= kRounding_s ? time_s : due_s(); }
  void advance() { ++count_; }
  long count() const { return count_; }

 private:
  static constexpr double kRounding_s = 1e-9;  // of steps that were summed up

  double rate_hz_;
  long count_{0};
};

}  // namespace urban_gnss
