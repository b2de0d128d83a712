#include "urban_gnss_localization/filters/fix_noise_monitor.hpp"

#include <Eigen/Dense>
#include <algorithm>

namespace urban_gnss {
namespace {

/// One pair that differs by more than three declared sigmas counts as one that differs by three: spikes are the gate's
/// business.
constexpr double kMostOfOnePair = 9.0;
/// Pairs that the average needs before it is believed.
constexpr double kLeastPairs = 10.0;
/// A receiver that repeats itself is not exact.
constexpr double kLeastWhite = 0.003;
/// Fixes farther apart than this (s) are no neighbours.
constexpr double kMostApart_s = 10.0;

}  // namespace

void FixNoiseMonitor::reset() {
  last_.reset();
  near_ = 1.0;
  count_ = 0.0;
}

void FixNoiseMonitor::add(const Eigen::Vector2d& position, const Eigen::Matrix2d& covariance,
                          const Eigen::Vector2d& dead_reckoned, double dead_reckoned_variance_m2, double distance_share,
                          double time_s, bool is_doubted) {
  const Fix fix{position - dead_reckoned, dead_reckoned, covariance, dead_reckoned_variance_m2, time_s};
  if (last_ && !is_doubted && time_s - last_->time_s < kMostApart_s) {
    const double distance = (fix.place - last_->place).norm() * distance_share;
    const Eigen::Matrix2d expected =
        last_->covariance + fix.covariance +
        (std::max(0.0, fix.variance_m2 - last_->variance_m2) + distance * distance) * Eigen::Matrix2d::Identity();
    const Eigen::Vector2d difference = fix.residual - last_->residual;
    const double ratio = std::min(kMostOfOnePair, 0.5 * difference.dot(expected.ldlt().solve(difference)));
    count_ = std::min(count_ + 1.0, parameters_.fix_noise_memory);
    near_ += (ratio - near_) / count_;
  }
  last_ = fix;
}

FixNoise FixNoiseMonitor::noise() const {
  if (!parameters_.adapt_fix_noise) return {};
  if (count_ < kLeastPairs) return {1.0, 1.0};
  const double white = std::max(near_, kLeastWhite);
  return {white, std::max(0.0, 1.0 - white)};
}

}  // namespace urban_gnss
