#include "urban_gnss_localization/gnss/covariance_filter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace urban_gnss {
namespace {

/// 0.2 times 15 must not become a little more than 3.
constexpr double kRounding = 1e-9;

}  // namespace

void CovarianceFilterParameters::check(std::vector<std::string>& faults) const {
  if (!(sigma_threshold < sigma_infinite)) {
    faults.push_back("sigma_threshold = " + std::to_string(sigma_threshold) +
                     ": must be less than sigma_infinite = " + std::to_string(sigma_infinite));
  }
}

double position_sigma(const Eigen::Matrix2d& covariance) {
  const bool is_usable = covariance.allFinite() && covariance(0, 0) > 0.0 && covariance(1, 1) > 0.0;
  return is_usable ? std::sqrt(covariance.trace()) : std::numeric_limits<double>::infinity();
}

CovarianceFilter::Result CovarianceFilter::add(const std::optional<Eigen::Matrix2d>& covariance) {
  const double sigma = covariance ? position_sigma(*covariance) : std::numeric_limits<double>::infinity();
  if (sigma > parameters_.sigma_smooth) {
    ++run_length_;
  } else if (run_length_ > 0) {
    const double length =
        std::min(static_cast<double>(run_length_) * parameters_.smooth_length_scale, parameters_.smooth_length_max);
    recovery_ = std::max(recovery_, static_cast<long>(std::ceil(length - kRounding)));
    run_length_ = 0;
  }
  const bool is_recovering = recovery_ > 0;
  recovery_ = std::max(recovery_ - 1, 0L);
  const bool is_good = !is_recovering && sigma <= parameters_.sigma_threshold;
  return {is_good ? *covariance : parameters_.infinite(), is_good, is_recovering};
}

void CovarianceFilter::reset() {
  run_length_ = 0;
  recovery_ = 0;
}

}  // namespace urban_gnss
