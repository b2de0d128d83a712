#include "urban_gnss_localization/evaluation/trajectory.hpp"

#include <algorithm>
#include <iterator>

#include "urban_gnss_localization/geometry/angles.hpp"

namespace urban_gnss {

void sort_by_stamp(Trajectory& trajectory) {
  const auto is_earlier = [](const TimedPose& a, const TimedPose& b) { return a.stamp < b.stamp; };
  if (std::is_sorted(trajectory.begin(), trajectory.end(), is_earlier)) return;
  std::stable_sort(trajectory.begin(), trajectory.end(), is_earlier);
}

std::optional<TimedPose> interpolate(const Trajectory& trajectory, Stamp stamp, Stamp max_gap) {
  const auto after = std::upper_bound(trajectory.begin(), trajectory.end(), stamp,
                                      [](Stamp value, const TimedPose& pose) { return value < pose.stamp; });
  if (after == trajectory.begin()) return std::nullopt;
  const auto before = std::prev(after);
  if (before->stamp == stamp) return *before;
  if (after == trajectory.end() || after->stamp - before->stamp > max_gap) return std::nullopt;

  const double share = to_seconds(stamp - before->stamp) / to_seconds(after->stamp - before->stamp);
  TimedPose result;
  result.stamp = stamp;
  result.pose.x = before->pose.x + share * (after->pose.x - before->pose.x);
  result.pose.y = before->pose.y + share * (after->pose.y - before->pose.y);
  result.pose.yaw = wrap_angle(before->pose.yaw + share * angle_difference(after->pose.yaw, before->pose.yaw));
  result.covariance = (1.0 - share) * before->covariance + share * after->covariance;
  return result;
}

}  // namespace urban_gnss
