#include "urban_gnss_localization/motion/rate_lag.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {
namespace {

/// Rates of one second are about one observation.
constexpr double kPerSecond = 10.0;
constexpr double kEvidence = 8.0;
constexpr double kLeastCorrelation = 0.6;  ///< squared
constexpr double kLeastLead_s = 0.25;
constexpr double kTurning_radps = 0.02;

}  // namespace

bool RateLagSearch::add(Stamp stamp, double odometry_radps, const RateAt& imu_at) {
  if (last_ && to_seconds(stamp - *last_) < kStep_s) return false;
  last_ = stamp;
  waiting_.push_back({stamp, odometry_radps});
  // So long that the rates of an IMU that is behind by that much have come, too.
  const double reach_s = 2.0 * kMostSteps * kStep_s;
  const int count_before = count_;
  while (!waiting_.empty() && to_seconds(stamp - waiting_.front().stamp) > reach_s) {
    const Rate then = waiting_.front();
    waiting_.pop_front();
    if (std::abs(then.radps) < kTurning_radps) continue;
    std::array<double, kLags> rates;
    bool is_complete = true;
    for (std::size_t i = 0; i < kLags && is_complete; ++i) {
      const auto rate = imu_at(then.stamp + from_seconds(kStep_s * (static_cast<double>(i) - kMostSteps)));
      is_complete = rate.has_value();
      if (rate) rates[i] = *rate;
    }
    if (!is_complete) continue;
    ++count_;
    odometry_square_ += then.radps * then.radps;
    for (std::size_t i = 0; i < kLags; ++i) {
      imu_square_[i] += rates[i] * rates[i];
      product_[i] += then.radps * rates[i];
    }
  }
  return count_ > count_before;
}

std::optional<double> RateLagSearch::lead_s() const {
  if (!has_turned_enough() || !(odometry_square_ > 0.0)) return std::nullopt;
  const auto correlation = [this](std::size_t i) {
    return imu_square_[i] > 0.0 ? product_[i] * product_[i] / (imu_square_[i] * odometry_square_) : 0.0;
  };
  std::size_t best = kMostSteps;
  for (std::size_t i = 0; i < kLags; ++i) {
    if (correlation(i) > correlation(best)) best = i;
  }
  const double lead_s = kStep_s * (static_cast<double>(best) - kMostSteps);
  const double left = std::max(1.0 - correlation(best), 1e-6);
  const double evidence = 0.5 * count_ / kPerSecond * std::log((1.0 - correlation(kMostSteps)) / left);
  if (std::abs(lead_s) < kLeastLead_s || correlation(best) < kLeastCorrelation || evidence < kEvidence) {
    return std::nullopt;
  }
  return lead_s;
}

}  // namespace urban_gnss
