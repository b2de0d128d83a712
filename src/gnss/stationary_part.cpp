#include "urban_gnss_localization/gnss/stationary_part.hpp"

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/common/median.hpp"

namespace urban_gnss {
namespace {

constexpr double kHalf_s = 5.0;
constexpr double kStill_mps = 0.3;
constexpr double kStill_m = 3.0;
constexpr double kSamePlace_m = 10.0;
constexpr std::size_t kFewestVelocities = 3;

/// The mean of the fixes in [from, to] after the stamp, s; nothing without fixes.
std::optional<Eigen::Vector2d> mean_place(const std::vector<TimedPosition>& fixes, Stamp stamp, double from_s,
                                          double to_s) {
  const auto is_before = [](const TimedPosition& fix, Stamp value) { return fix.stamp < value; };
  auto fix = std::lower_bound(fixes.begin(), fixes.end(), stamp + from_seconds(from_s), is_before);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  int count = 0;
  for (; fix != fixes.end() && fix->stamp <= stamp + from_seconds(to_s); ++fix, ++count) sum += fix->position;
  return count > 0 ? std::optional<Eigen::Vector2d>(sum / count) : std::nullopt;
}

bool moves(const std::vector<TimedPosition>& fixes, const std::vector<RawVelocity>& velocities, Stamp stamp) {
  std::vector<double> speeds;
  const Stamp half = from_seconds(kHalf_s);
  const auto is_before = [](const RawVelocity& each, Stamp value) { return each.stamp < value; };
  auto each = std::lower_bound(velocities.begin(), velocities.end(), stamp - half, is_before);
  for (; each != velocities.end() && each->stamp <= stamp + half; ++each) {
    if (each->velocity.allFinite()) speeds.push_back(each->velocity.norm());
  }
  if (speeds.size() >= kFewestVelocities) return upper_median(std::move(speeds)) > kStill_mps;
  const auto before = mean_place(fixes, stamp, -kHalf_s, 0.0);
  const auto after = mean_place(fixes, stamp, 0.0, kHalf_s);
  return before && after && (*after - *before).norm() > kStill_m;
}

}  // namespace

std::optional<StationaryPart> longest_stationary_part(const std::vector<TimedPosition>& fixes,
                                                      const std::vector<RawVelocity>& velocities) {
  std::optional<StationaryPart> longest;
  std::optional<StationaryPart> part;
  Eigen::Vector2d place = Eigen::Vector2d::Zero();
  for (const TimedPosition& fix : fixes) {
    if (moves(fixes, velocities, fix.stamp)) {
      part.reset();
      continue;
    }
    const Eigen::Vector2d here = *mean_place(fixes, fix.stamp, -kHalf_s, kHalf_s);
    if (!part || (here - place).norm() > kSamePlace_m) {
      part = StationaryPart{fix.stamp, fix.stamp};
      place = here;
    }
    part->end = fix.stamp;
    if (!longest || part->duration_s() > longest->duration_s()) longest = part;
  }
  return longest;
}

}  // namespace urban_gnss
