#pragma once

#include <algorithm>
#include <cmath>

namespace urban_gnss {

/// Factor k on a declared covariance of two dimensions, such that half of the measurements have a normalised innovation
/// below the median of the chi-squared distribution (2 ln 2): each raises or lowers ln k by a rate (stochastic
/// approximation of a quantile, Robbins and Monro 1951). Outliers, however far, have no more influence than others, and
/// the worst half of the measurements may have any size.
class LearntScale {
 public:
  /// Median of the chi-squared distribution of 2 degrees of freedom.
  static constexpr double kMedianNis = 1.3862943611198906;

  /// `rate`: of a measurement, 0 to 1; `limit` >= 1: factor by which declared standard deviations may be wrong;
  /// `first`: what it is before anything is learnt, within the limit.
  LearntScale(double rate, double limit, double first = 1.0)
      : rate_(rate),
        log_limit_(2.0 * std::log(limit)),
        log_first_(std::clamp(std::log(first), -log_limit_, log_limit_)),
        log_scale_(log_first_) {}

  double value() const { return std::exp(log_scale_); }
  /// One measurement, with a share `exceeding` (0 to 1) of its NIS, at k times the declared covariance, beyond
  /// kMedianNis. `share` (0 to 1) of the innovation's covariance is the measurement's: as much says it of k, and for
  /// the rest k returns to what it was at first.
  void learn(double exceeding, double share = 1.0) {
    const double returns = std::clamp(log_first_ - log_scale_, -1.0, 1.0);
    const double step = share * (2.0 * exceeding - 1.0) + (1.0 - share) * returns;
    log_scale_ = std::clamp(log_scale_ + rate_ * step, -log_limit_, log_limit_);
  }

 private:
  double rate_;
  double log_limit_;
  double log_first_;
  double log_scale_;
};

}  // namespace urban_gnss
