#include "urban_gnss_localization/gnss/fix_sigma.hpp"

namespace urban_gnss {

Eigen::Matrix2d FixSigmaParameters::direct_covariance(const Eigen::Matrix2d& declared) const {
  return use_fix_covariance ? declared : Eigen::Matrix2d(direct_sigma * direct_sigma * Eigen::Matrix2d::Identity());
}

Eigen::Matrix2d FixSigmaParameters::shadow_covariance(const Eigen::Matrix2d& declared) const {
  const double ratio = shadow_sigma / direct_sigma;
  return ratio * ratio * direct_covariance(declared);
}

}  // namespace urban_gnss
