#include "urban_gnss_localization/receivers/solution_matcher.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace urban_gnss {
namespace {

constexpr std::size_t kMaxFixes = 64;
constexpr std::size_t kMaxWaiting = 16;
constexpr double kMaxReach_s = 0.5;
constexpr double kSurelySame = 0.25;  ///< of the interval between fixes

}  // namespace

void SolutionMatcher::add_fix(Stamp stamp) {
  if (!fixes_.empty() && stamp <= fixes_.back()) {
    if (stamp == fixes_.back()) return;
    fixes_.clear();  // the clock was set back
  }
  if (!fixes_.empty()) interval_s_ = to_seconds(stamp - fixes_.back());
  fixes_.push_back(stamp);
  if (fixes_.size() > kMaxFixes) fixes_.pop_front();
  settle();
}

void SolutionMatcher::add_satellites(SatelliteEpoch epoch) {
  waiting_.push_back(std::move(epoch));
  if (waiting_.size() > kMaxWaiting) {
    decide(std::move(waiting_.front()));
    waiting_.pop_front();
  }
  settle();
}

double SolutionMatcher::reach_s() const { return std::min(0.5 * interval_s_, kMaxReach_s); }

bool SolutionMatcher::is_decided(const SatelliteEpoch& epoch) const {
  if (fixes_.empty()) return false;
  return to_seconds(epoch.stamp - fixes_.back()) <= std::min(kSurelySame * interval_s_, reach_s());
}

void SolutionMatcher::settle() {
  while (!waiting_.empty() && is_decided(waiting_.front())) {
    decide(std::move(waiting_.front()));
    waiting_.pop_front();
  }
}

void SolutionMatcher::decide(SatelliteEpoch epoch) {
  const auto distance_s = [&](Stamp fix) { return std::abs(to_seconds(fix - epoch.stamp)); };
  const auto nearest =
      std::min_element(fixes_.begin(), fixes_.end(), [&](Stamp a, Stamp b) { return distance_s(a) < distance_s(b); });
  if (nearest != fixes_.end() && distance_s(*nearest) <= reach_s()) {
    epoch.stamp = *nearest;
  } else {
    for (SatelliteObservation& satellite : epoch.satellites) satellite.residual_m = SatelliteObservation::kUnknown;
  }
  done_.push_back(std::move(epoch));
}

void SolutionMatcher::finish() {
  for (SatelliteEpoch& epoch : std::exchange(waiting_, {})) decide(std::move(epoch));
}

std::vector<SatelliteEpoch> SolutionMatcher::take() { return std::exchange(done_, {}); }

}  // namespace urban_gnss
