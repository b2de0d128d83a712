#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "urban_gnss_localization/motion/imu_heading.hpp"
#include "urban_gnss_localization/pipeline/pipeline_event.hpp"

namespace urban_gnss {

/// The IMU's heading for those who ask at a stamp. What it is worth comes from comparisons (HeadingCalibration): while
/// there are none, or they contradict it, it has no say.
class HeadingSource {
 public:
  /// Requires parameters without faults.
  explicit HeadingSource(const ImuHeadingParameters& parameters) : parameters_(parameters), calibration_(parameters) {}

  bool is_used() const { return parameters_.is_used(); }

  /// As the IMU says it. One that is not finite, or late by up to a second, is left out; an older one begins anew.
  void add(const HeadingSample& told);
  /// Of the last seconds, between the two messages about the stamp; nothing where there are none near it.
  std::optional<HeadingSample> told_at(Stamp stamp) const;
  /// The same, for what it is worth.
  std::optional<HeadingSample> calibrated_at(Stamp stamp) const;
  /// The newest one that is not newer than `now` and not older than a second, for what it is worth; one a second.
  std::optional<HeadingSample> take_due(Stamp now);

  /// Whether it should be compared with another heading of this stamp, if there is one.
  bool wants_comparison(Stamp stamp) const { return calibration_.is_due(stamp) && told_at(stamp).has_value(); }
  /// Compares with another heading (rad, finite) that does not depend on it. Requires wants_comparison(). What that
  /// says anew is appended to `events`.
  void compare(Stamp stamp, double yaw_rad, double sigma_rad, std::vector<PipelineEvent>& events);

  void reset() { *this = HeadingSource(parameters_); }

 private:
  ImuHeadingParameters parameters_;
  HeadingCalibration calibration_;
  std::deque<HeadingSample> told_;
  std::optional<Stamp> last_taken_;
};

}  // namespace urban_gnss
