#include "urban_gnss_localization/evaluation/error_history.hpp"

#include <algorithm>

namespace urban_gnss {
namespace {

constexpr Stamp kSetBack = std::chrono::seconds(5);  // more than streams lag behind one another

}  // namespace

ErrorHistory::ErrorHistory(std::size_t estimate_count, Stamp window, Stamp interval)
    : window_(window), interval_(interval), streams_(estimate_count + 1) {}

void ErrorHistory::add(std::size_t stream, const TimedPose& pose) {
  if (!is_finite(pose.pose)) return;
  if (latest_ && pose.stamp < *latest_ - kSetBack) {
    for (Trajectory& each : streams_) each.clear();
    latest_.reset();
  }
  latest_ = std::max(latest_.value_or(pose.stamp), pose.stamp);
  Trajectory& poses = streams_[stream];
  if (!poses.empty() && pose.stamp < poses.back().stamp + interval_) return;
  poses.push_back(pose);
  // In one go: a move of all for each new one would take longer than all else.
  const Stamp oldest = *latest_ - window_;
  if (poses.front().stamp >= oldest - window_ / 8) return;
  poses.erase(poses.begin(),
              std::find_if(poses.begin(), poses.end(), [&](const TimedPose& each) { return each.stamp >= oldest; }));
}

}  // namespace urban_gnss
