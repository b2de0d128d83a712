#pragma once

#include <Eigen/Core>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/fix.hpp"

namespace urban_gnss {

/// How good a solution's ranges are, by the way in which it was made.
enum class SolutionKind { kStandalone, kDifferential, kRtkFloat, kRtkFixed };

/// A fix's covariance where the receiver tells no more than the dilution of precision.
///
/// HDOP^2 is the trace of the horizontal block of (H'H)^-1, so that an axis has sigma = range_sigma * HDOP / sqrt(2),
/// and the vertical range_sigma * VDOP. HDOP itself is no sigma, and HDOP^2 no variance.
struct DopNoiseParameters {
  double range_sigma{4.0};
  double range_sigma_differential{2.5};
  double range_sigma_rtk_float{1.0};
  double range_sigma_rtk_fixed{0.05};
  double sigma_floor{0.02};

  void visit(ParameterVisitor& v) {
    v("range_sigma", range_sigma, positive(), "m",
      "of a range, where the receiver declares a dilution of precision but no accuracy");
    v("range_sigma_differential", range_sigma_differential, positive(), "m",
      "the same, where it says that it uses corrections (SBAS, DGPS)");
    v("range_sigma_rtk_float", range_sigma_rtk_float, positive(), "m", "the same, with RTK and float ambiguities");
    v("range_sigma_rtk_fixed", range_sigma_rtk_fixed, positive(), "m", "the same, with RTK and fixed ambiguities");
    v("sigma_floor", sigma_floor, positive(), "m per axis",
      "least standard deviation that a receiver's own claim, or this rule, gives a fix");
  }
};

double range_sigma_m(SolutionKind kind, const DopNoiseParameters& parameters);

/// Dilution that a fix without a VDOP has in the vertical, for one in the horizontal.
inline constexpr double kVerticalPerHorizontal = 2.0;

/// Sets the fix's covariance by the rule above; leaves it undeclared where `hdop` is no number that a receiver uses for
/// a fix: not finite, not positive, or 50 and more ("99.99"). `vdop` may be NaN.
void set_covariance_from_dop(double hdop, double vdop, SolutionKind kind, const DopNoiseParameters& parameters,
                             RawFix& fix);

/// Sets the fix's covariance to what the receiver declares (ENU, m^2), each of its axes at least sigma_floor; false,
/// and nothing set, where it is not finite or not positive definite.
bool set_declared_covariance(const Eigen::Matrix3d& covariance, CovarianceType type,
                             const DopNoiseParameters& parameters, RawFix& fix);

}  // namespace urban_gnss
