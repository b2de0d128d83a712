#include "urban_gnss_localization/localizers/kim/fix_noise_monitor.hpp"

#include <Eigen/Dense>
#include <algorithm>

namespace urban_gnss {
namespace {

/// One pair that differs by more than three declared sigmas counts as one that differs by three: spikes are the gate's
/// business.
constexpr double kMostOfOnePair = 9.0;
/// Pairs that an average needs before it is believed.
constexpr double kLeastPairs = 10.0;
/// Below this the receiver repeats itself; guards the division.
constexpr double kLeastNear = 1e-4;

}  // namespace

void FixNoiseMonitor::Average::add(double value, double memory) {
  count = std::min(count + 1.0, memory);
  mean += (value - mean) / count;
}

void FixNoiseMonitor::reset() {
  fixes_.clear();
  near_ = {};
  far_ = {};
}

double FixNoiseMonitor::ratio(const Fix& a, const Fix& b, double distance_share) {
  const double distance = (b.place - a.place).norm() * distance_share;
  const Eigen::Matrix2d covariance =
      a.covariance + b.covariance +
      (std::max(0.0, b.variance_m2 - a.variance_m2) + distance * distance) * Eigen::Matrix2d::Identity();
  const Eigen::Vector2d difference = b.residual - a.residual;
  return std::min(kMostOfOnePair, 0.5 * difference.dot(covariance.ldlt().solve(difference)));
}

void FixNoiseMonitor::add(const Eigen::Vector2d& position, const Eigen::Matrix2d& covariance,
                          const Eigen::Vector2d& dead_reckoned, double dead_reckoned_variance_m2, double distance_share,
                          double time_s) {
  const Fix fix{position - dead_reckoned, dead_reckoned, covariance, dead_reckoned_variance_m2, time_s};
  // A pair of neighbours across an outage is no pair of neighbours.
  if (!fixes_.empty() && time_s - fixes_.back().time_s < 0.5 * parameters_.fix_noise_horizon) {
    near_.add(ratio(fixes_.back(), fix, distance_share), parameters_.fix_noise_memory);
  }
  while (fixes_.size() > 1 && time_s - fixes_[1].time_s >= parameters_.fix_noise_horizon) fixes_.pop_front();
  if (!fixes_.empty()) {
    const double apart = time_s - fixes_.front().time_s;
    if (apart >= parameters_.fix_noise_horizon && apart < 2.0 * parameters_.fix_noise_horizon) {
      far_.add(ratio(fixes_.front(), fix, distance_share), parameters_.fix_noise_memory);
    }
  }
  fixes_.push_back(fix);
}

bool FixNoiseMonitor::is_ready() const {
  return parameters_.adapt_fix_noise && near_.count >= kLeastPairs && far_.count >= kLeastPairs;
}

double FixNoiseMonitor::size() const { return is_ready() ? far_.mean : 1.0; }

double FixNoiseMonitor::inflation() const {
  if (!is_ready()) return 1.0;
  const double near = std::max(near_.mean, kLeastNear);
  const double factor = far_.mean * std::max(1.0, (2.0 * far_.mean - near) / near);
  return std::clamp(factor, 1.0, parameters_.fix_noise_max_inflation);
}

}  // namespace urban_gnss
