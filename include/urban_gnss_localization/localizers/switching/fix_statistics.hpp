#pragma once

#include <Eigen/Core>
#include <optional>

#include "urban_gnss_localization/gnss/correlated_errors.hpp"
#include "urban_gnss_localization/gnss/fix_noise_model.hpp"
#include "urban_gnss_localization/gnss/learnt_scale.hpp"
#include "urban_gnss_localization/gnss/nominal_cn0.hpp"
#include "urban_gnss_localization/localizers/switching/bias_ekf.hpp"
#include "urban_gnss_localization/motion/standstill.hpp"

namespace urban_gnss {

/// Statistics of a receiver's fixes and velocities that the filters learn beside the state: scale of their covariances,
/// nominal C/N0, standard deviation of ranges, error that all fixes share.
class FixStatistics {
 public:
  /// Requires parameters without faults.
  explicit FixStatistics(const SwitchingModelParameters& parameters);

  /// Forgets everything.
  void reset();
  void move(const Twist2& twist, double duration_s);

  /// s >= 0 since the last fix; since the start where there was none.
  double elapsed_s(double time_s) const;
  /// The fix that a filter takes: the position by its ranges (range_fix(), beside the estimate `before` it) where it
  /// has them, else the declared one with FixNoiseModel::effective_covariance(). Once a fix, before the others of this
  /// class.
  FixMeasurement effective_fix(const FixMeasurement& fix, const PoseEstimate& before);
  /// Whether the last fix was what its ranges say.
  bool of_ranges() const { return of_ranges_; }
  /// m, of a range in line of sight, as learnt.
  double range_sigma_m() const;
  FixNoise fix_noise(double time_s) const {
    const double added_m2 = reacquisition_.variance_m2(time_s);
    if (of_ranges_) return {1.0, range_noise_.correlation_inflation(time_s), added_m2, true};
    return {noise_.scale(), noise_.correlation_inflation(time_s), added_m2, false};
  }
  /// Prior odds of a bias of the fix, against those of the parameters: bias_odds of mode_transition().
  double bias_odds() const { return of_ranges_ ? parameters_.ranges.range_bias_odds : 1.0; }
  /// A fix was taken, with a share `exceeding` of its NIS beyond the median.
  void learn_fix(double time_s, double exceeding);
  /// Lets the noise model see the fix beside the odometry alone; `before` and `after` it, all modes together.
  void compare_with_odometry(const FixMeasurement& fix, const PoseEstimate& before, const Pose2& after);

  double velocity_scale() const { return velocity_scale_.value(); }
  double velocity_inflation(double time_s) const {
    return last_velocity_s_
               ? markov_inflation(time_s - *last_velocity_s_, parameters_.velocity.velocity_correlation_time)
               : 1.0;
  }
  /// A velocity was taken; `before` and `after` it, all modes together.
  void learn_velocity(double time_s, double exceeding, const Pose2& before, const Pose2& after);

  /// m^2 per axis, of the error that all fixes share.
  double common_variance_m2() const { return common_variance_m2_; }

 private:
  /// By the fix's ranges; nothing where they do not tell.
  std::optional<RelativePlace> place_by_ranges(const FixMeasurement& fix, const PoseEstimate& before);

  SwitchingModelParameters parameters_;
  FixNoiseModel noise_;
  FixNoiseModel range_noise_;
  Reacquisition reacquisition_;
  NominalCn0 nominal_cn0_;
  bool of_ranges_{false};  ///< the last fix
  LearntScale velocity_scale_;
  std::optional<double> last_fix_s_;
  std::optional<double> last_velocity_s_;
  DeadReckonedTrack track_;  ///< since the start
  double common_variance_m2_{0.0};
};

}  // namespace urban_gnss
