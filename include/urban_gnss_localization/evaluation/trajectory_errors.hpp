#pragma once

#include <chrono>
#include <cstddef>
#include <limits>
#include <vector>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/evaluation/statistics.hpp"
#include "urban_gnss_localization/evaluation/trajectory.hpp"

namespace urban_gnss {

/// Square root (m) of the larger eigenvalue of a pose's horizontal covariance (m^2); NaN where there is none.
double position_sigma_m(const Eigen::Matrix3d& covariance);

/// How wrong an estimate is at one instant. Errors are estimate minus truth.
struct ErrorSample {
  Stamp stamp{0};
  double position_error_m{std::numeric_limits<double>::quiet_NaN()};   ///< horizontal distance
  double heading_error_rad{std::numeric_limits<double>::quiet_NaN()};  ///< [-pi, pi); NaN where one has no heading
  Pose2 estimate;
  Pose2 truth;
  double position_sigma_m{std::numeric_limits<double>::quiet_NaN()};  ///< position_sigma_m() of the estimate
  /// Normalised estimation error squared of x, y, yaw (3 degrees of freedom); NaN where the covariance is not positive
  /// definite.
  double nees{std::numeric_limits<double>::quiet_NaN()};
  double position_nees{std::numeric_limits<double>::quiet_NaN()};  ///< the same of x, y (2 degrees of freedom)
};

/// Whether the truth lies inside the 95 % ellipse of the estimate's position; not where that is unknown.
bool is_inside_95(const ErrorSample& sample);

/// Error samples in a few numbers; NaN where there is nothing to average.
struct ErrorSummary {
  std::size_t samples{0};
  /// Share (0 to 1) of the truth's stamps, over its whole span, for which there was an estimate.
  double coverage{std::numeric_limits<double>::quiet_NaN()};
  Summary position_m;
  Summary heading_rad;  ///< of the error's magnitude
  double nees_mean{std::numeric_limits<double>::quiet_NaN()};
  double position_nees_mean{std::numeric_limits<double>::quiet_NaN()};  ///< 2 where the covariance is right
  double inside_95{std::numeric_limits<double>::quiet_NaN()};  ///< share (0 to 1) of the truth within the 95 % ellipse
  double beyond_protection{std::numeric_limits<double>::quiet_NaN()};  ///< share (0 to 1) beyond protection_level_m()
  double share_below_5m{std::numeric_limits<double>::quiet_NaN()};     ///< share (0 to 1) of the samples
  double share_below_10m{std::numeric_limits<double>::quiet_NaN()};    ///< share (0 to 1) of the samples
};

struct TrajectoryErrors {
  std::vector<ErrorSample> samples;
  ErrorSummary summary;
};

/// Errors of an estimate at the truth's stamps, both in the same frame and not aligned. The estimate is interpolated,
/// but not over more than max_gap: a stamp within a gap, or at which the estimate is not finite, lowers the coverage
/// and has no sample. Requires sorted trajectories.
TrajectoryErrors errors_at_truth(const Trajectory& truth, const Trajectory& estimate,
                                 Stamp max_gap = std::chrono::seconds(1));

/// Errors of fixes (poses whose yaw is NaN) at their own stamps: interpolating between fixes would average their noise
/// away. The truth is interpolated, but not over more than max_truth_gap. The coverage is the share of the truth's
/// stamps that have a fix within half a second. Requires sorted trajectories.
TrajectoryErrors errors_at_fixes(const Trajectory& truth, const Trajectory& fixes,
                                 Stamp max_truth_gap = std::chrono::milliseconds(1500));

}  // namespace urban_gnss
