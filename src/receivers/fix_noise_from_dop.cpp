#include "urban_gnss_localization/receivers/fix_noise_from_dop.hpp"

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/common/positive_definite.hpp"

namespace urban_gnss {
namespace {

constexpr double kMostDop = 50.0;  // receivers write 99.99 where they have none

bool is_dop(double dop) { return std::isfinite(dop) && dop > 0.0 && dop < kMostDop; }

}  // namespace

double range_sigma_m(SolutionKind kind, const DopNoiseParameters& parameters) {
  switch (kind) {
    case SolutionKind::kStandalone: break;
    case SolutionKind::kDifferential: return parameters.range_sigma_differential;
    case SolutionKind::kRtkFloat: return parameters.range_sigma_rtk_float;
    case SolutionKind::kRtkFixed: return parameters.range_sigma_rtk_fixed;
  }
  return parameters.range_sigma;
}

void set_covariance_from_dop(double hdop, double vdop, SolutionKind kind, const DopNoiseParameters& parameters,
                             RawFix& fix) {
  if (!is_dop(hdop)) return;
  const double range_sigma = range_sigma_m(kind, parameters);
  const double horizontal = std::max(range_sigma * hdop / std::sqrt(2.0), parameters.sigma_floor);
  const double vertical =
      std::max(range_sigma * (is_dop(vdop) ? vdop : kVerticalPerHorizontal * hdop), parameters.sigma_floor);
  fix.covariance = Eigen::Vector3d(horizontal, horizontal, vertical).cwiseAbs2().asDiagonal();
  fix.covariance_type = CovarianceType::kApproximated;
}

bool set_declared_covariance(const Eigen::Matrix3d& covariance, CovarianceType type,
                             const DopNoiseParameters& parameters, RawFix& fix) {
  if (!is_positive_definite<3>(covariance)) return false;
  // The whole ellipsoid grows where one of its axes is shorter than the floor.
  const double shortest = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvalues().x();
  const double missing = std::max(parameters.sigma_floor * parameters.sigma_floor - shortest, 0.0);
  fix.covariance = covariance + missing * Eigen::Matrix3d::Identity();
  fix.covariance_type = type;
  return true;
}

}  // namespace urban_gnss
