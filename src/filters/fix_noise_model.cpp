#include "urban_gnss_localization/filters/fix_noise_model.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {
namespace {

/// Slower than this on average since the last fix, the robot stands.
constexpr double kParked_mps = 0.05;
constexpr double kMostInflation = 1e6;

}  // namespace

void FixNoiseModel::reset() {
  scale_ = 1.0;
  last_s_.reset();
  moved_m_ = 0.0;
  elapsed_s_ = 0.0;
}

void FixNoiseModel::move(const Twist2& twist, double duration_s) {
  moved_m_ += std::abs(twist.speed_mps) * duration_s;
  elapsed_s_ += duration_s;
}

double FixNoiseModel::correlation_inflation(double time_s) const {
  const bool is_parked = elapsed_s_ > 0.0 && moved_m_ < kParked_mps * elapsed_s_;
  const double correlation_s = is_parked ? parameters_.parked_correlation_time : parameters_.fix_correlation_time;
  if (!last_s_ || correlation_s <= 0.0) return 1.0;
  const double ratio = std::max(time_s - *last_s_, 0.0) / correlation_s;
  return std::min(1.0 / std::tanh(0.5 * ratio), kMostInflation);  // (1 + a) / (1 - a)
}

void FixNoiseModel::learn(double time_s, double exceeding) {
  const double limit = 2.0 * std::log(parameters_.fix_scale_limit);
  const double step = parameters_.fix_scale_rate * (2.0 * exceeding - 1.0);
  scale_ = std::exp(std::clamp(std::log(scale_) + step, -limit, limit));
  last_s_ = time_s;
  moved_m_ = 0.0;
  elapsed_s_ = 0.0;
}

}  // namespace urban_gnss
