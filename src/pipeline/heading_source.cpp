#include "urban_gnss_localization/pipeline/heading_source.hpp"

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/geometry/angles.hpp"

namespace urban_gnss {
namespace {

/// Fixes may come that late.
constexpr double kKept_s = 15.0;
/// Between messages that are farther apart, the heading is not known.
constexpr double kGap_s = 0.5;
/// Before the first and after the last message, it is that message's for so long.
constexpr double kHold_s = 0.1;
constexpr double kInterval_s = 1.0;
/// One that is older by more is not late: the stamp of the last was wrong, or the clock was set back.
constexpr double kLate_s = 1.0;

}  // namespace

void HeadingSource::add(const HeadingSample& told) {
  if (!is_used() || !std::isfinite(told.yaw_rad) || !std::isfinite(told.sigma_rad)) return;
  if (!told_.empty() && told.stamp <= told_.back().stamp) {
    if (to_seconds(told_.back().stamp - told.stamp) <= kLate_s) return;
    told_.clear();
  }
  told_.push_back(told);
  while (to_seconds(told.stamp - told_.front().stamp) > kKept_s) told_.pop_front();
}

std::optional<HeadingSample> HeadingSource::told_at(Stamp stamp) const {
  const auto after = std::lower_bound(told_.begin(), told_.end(), stamp,
                                      [](const HeadingSample& sample, Stamp value) { return sample.stamp < value; });
  const bool has_after = after != told_.end();
  const bool has_before = after != told_.begin();
  if (has_before && has_after) {
    const HeadingSample& before = *(after - 1);
    const double gap_s = to_seconds(after->stamp - before.stamp);
    if (gap_s <= kGap_s) {
      const double share = to_seconds(stamp - before.stamp) / gap_s;
      const double turned = share * angle_difference(after->yaw_rad, before.yaw_rad);
      return HeadingSample{stamp, wrap_angle(before.yaw_rad + turned), std::max(before.sigma_rad, after->sigma_rad)};
    }
  }
  if (has_after && to_seconds(after->stamp - stamp) <= kHold_s) return *after;
  if (has_before && to_seconds(stamp - (after - 1)->stamp) <= kHold_s) return *(after - 1);
  return std::nullopt;
}

std::optional<HeadingSample> HeadingSource::calibrated_at(Stamp stamp) const {
  const auto told = told_at(stamp);
  return told ? calibration_.calibrated(*told) : std::nullopt;
}

std::optional<HeadingSample> HeadingSource::take_due(Stamp now) {
  if (last_taken_ && std::abs(to_seconds(now - *last_taken_)) < kInterval_s) return std::nullopt;
  const auto after = std::upper_bound(told_.begin(), told_.end(), now,
                                      [](Stamp value, const HeadingSample& sample) { return value < sample.stamp; });
  if (after == told_.begin() || to_seconds(now - (after - 1)->stamp) > kInterval_s) return std::nullopt;
  const auto calibrated = calibration_.calibrated(*(after - 1));
  if (calibrated) last_taken_ = now;
  return calibrated;
}

void HeadingSource::compare(Stamp stamp, double yaw_rad, double sigma_rad, std::vector<PipelineEvent>& events) {
  const double difference = angle_difference(told_at(stamp)->yaw_rad, yaw_rad);
  if (!calibration_.add(stamp, difference, sigma_rad)) return;
  const bool fits = calibration_.verdict() == ImuHeadingVerdict::kFits;
  events.push_back({fits ? PipelineEvent::Level::kInfo : PipelineEvent::Level::kWarn, calibration_.describe()});
}

}  // namespace urban_gnss
