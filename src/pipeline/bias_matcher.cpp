#include "urban_gnss_localization/pipeline/bias_matcher.hpp"

#include <algorithm>

#include "limits.hpp"

namespace urban_gnss {

void BiasMatcher::add(const BiasEstimate& bias) { push_bounded(biases_, bias); }

bool BiasMatcher::awaits(Stamp fix, double waited_s) const {
  return waited_s < parameters_.bias_timeout && find(fix) == nullptr;
}

std::optional<BiasEstimate> BiasMatcher::take(Stamp fix) {
  const BiasEstimate* found = find(fix);
  if (found == nullptr) return std::nullopt;
  const BiasEstimate bias = *found;
  radius_m_ = bias.radius_m;
  while (!biases_.empty() && biases_.front().stamp < fix) biases_.pop_front();
  return bias;
}

const BiasEstimate* BiasMatcher::find(Stamp fix) const {
  // All are looked at: one of before the clock was set back, published late, may stand in front for good.
  const auto found =
      std::find_if(biases_.rbegin(), biases_.rend(), [&](const BiasEstimate& bias) { return bias.stamp == fix; });
  return found != biases_.rend() ? &*found : nullptr;
}

}  // namespace urban_gnss
