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

void SolutionMatcher::add_fix(Stamp told, Stamp given) {
  if (!fixes_.empty() && told <= fixes_.back().told) {
    if (told == fixes_.back().told) return;
    fixes_.clear();  // the clock was set back
  }
  if (!fixes_.empty()) interval_s_ = to_seconds(told - fixes_.back().told);
  fixes_.push_back({told, given});
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
  return to_seconds(epoch.stamp - fixes_.back().told) <= std::min(kSurelySame * interval_s_, reach_s());
}

void SolutionMatcher::settle() {
  while (!waiting_.empty() && is_decided(waiting_.front())) {
    decide(std::move(waiting_.front()));
    waiting_.pop_front();
  }
}

void SolutionMatcher::decide(SatelliteEpoch epoch) {
  const auto distance_s = [&](const Fix& fix) { return std::abs(to_seconds(fix.told - epoch.stamp)); };
  const auto nearest = std::min_element(fixes_.begin(), fixes_.end(),
                                        [&](const Fix& a, const Fix& b) { return distance_s(a) < distance_s(b); });
  if (nearest != fixes_.end() && distance_s(*nearest) <= reach_s()) {
    epoch.stamp = nearest->given;
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
