#include "urban_gnss_localization/pipeline/epoch_matcher.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace urban_gnss {
namespace {

constexpr std::size_t kMaxEpochs = 100;

double distance_s(Stamp a, Stamp b) { return std::abs(to_seconds(a - b)); }

}  // namespace

void EpochMatcher::add(SatelliteEpoch epoch) {
  if (last_fix_ && distance_s(epoch.stamp, *last_fix_) <= kSameEpoch_s) last_had_satellites_ = true;  // they came late
  epochs_.push_back(std::move(epoch));
  if (epochs_.size() > kMaxEpochs) epochs_.pop_front();
}

bool EpochMatcher::awaits(Stamp fix) const { return last_had_satellites_ && nearest(fix, kSameEpoch_s) == nullptr; }

const SatelliteEpoch* EpochMatcher::take(Stamp fix) {
  const SatelliteEpoch* own = nearest(fix, kSameEpoch_s);
  last_fix_ = fix;
  last_had_satellites_ = own != nullptr;
  return own;
}

const SatelliteEpoch* EpochMatcher::nearest(Stamp stamp, double max_age_s) const {
  const auto found = std::min_element(epochs_.rbegin(), epochs_.rend(), [&](const auto& a, const auto& b) {
    return distance_s(a.stamp, stamp) < distance_s(b.stamp, stamp);
  });
  return found != epochs_.rend() && distance_s(found->stamp, stamp) <= max_age_s ? &*found : nullptr;
}

}  // namespace urban_gnss
