#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <deque>
#include <optional>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/correlated_errors.hpp"
#include "urban_gnss_localization/gnss/learnt_scale.hpp"
#include "urban_gnss_localization/motion/standstill.hpp"

namespace urban_gnss {

/// How a receiver's declared covariance is related to the errors of its fixes.
struct FixNoiseModelParameters {
  double fix_scale_rate{0.03};
  double first_fix_scale{2.0};
  double fix_covariance_weight{0.5};
  double fix_scale_limit{15.0};
  ErrorCorrelation errors{kFixErrors};
  double fix_scale_lag{15.0};
  double fix_scale_distance{30.0};

  void visit(ParameterVisitor& v) {
    v("fix_scale_rate", fix_scale_rate, between(0.0, 1.0), "",
      "learning rate, per fix, of the logarithm of the factor on declared covariances; 0: they are right");
    v("first_fix_scale", first_fix_scale, positive(), "",
      "initial factor on declared covariances (variances), before anything is learnt");
    v("fix_covariance_weight", fix_covariance_weight, between(0.0, 1.0), "",
      "weight of the fluctuations of declared covariances about their recent mean; 1: taken as declared");
    v("fix_scale_limit", fix_scale_limit, at_least(1.0), "",
      "greatest factor by which declared standard deviations may be too small or too large");
    v.include(errors);
    v("fix_scale_lag", fix_scale_lag, non_negative(), "s",
      "time between the fixes that are compared by means of the odometry between them; 0: no comparison");
    v("fix_scale_distance", fix_scale_distance, non_negative(), "m",
      "way between the fixes that are compared by means of the odometry between them");
  }
};

/// A fix beside what was dead-reckoned.
struct DeadReckonedFix {
  Eigen::Vector2d misfit;      ///< m, fix minus the dead-reckoned place of the antenna, from any origin
  Eigen::Matrix2d covariance;  ///< m^2, as declared
  Eigen::Vector2d place;       ///< m, the dead-reckoned place
  double walk_m2{0.0};         ///< m^2 per axis, variance of the dead reckoning but for what heading_sigma_rad makes
  double heading_sigma_rad{0.0};
  double time_s{0.0};
  double way_m{0.0};  ///< since the start
};

/// The odometry alone since the start, beside a filter whose position measurements move.
class DeadReckonedTrack {
 public:
  void move(const Twist2& twist, double duration_s) { travel_.add(twist, duration_s); }
  /// A measurement has moved the filter's position (m).
  void correct(const Eigen::Vector2d& before, const Eigen::Vector2d& after) { corrections_ += after - before; }
  /// A fix at `time_s` with `position` (m) and the declared `covariance` (m^2) beside the odometry; before the filter
  /// takes it, which predicts the antenna at `antenna` (m). `position_walk`: m/sqrt(s).
  DeadReckonedFix beside(const Eigen::Vector2d& position, const Eigen::Matrix2d& covariance,
                         const Eigen::Vector2d& antenna, double heading_sigma_rad, double position_walk,
                         double time_s) const;
  const Travel& travel() const { return travel_; }

 private:
  Travel travel_;
  Eigen::Vector2d corrections_{Eigen::Vector2d::Zero()};  ///< m, what measurements have moved the position by
};

/// The effective noise of a fix. The covariance that its receiver declares rises and falls with its errors, but is too
/// small or too large by a factor, which is learnt (LearntScale). Errors are correlated in time.
///
/// A receiver that smooths pulls a filter with it: the innovations stay small, and the factor learnt from them falls
/// without end. Two fixes that are farther apart than their errors last, and the odometry between them, still tell its
/// errors, as far as the odometry is better than they are.
///
/// ErrorCorrelation accounts for the correlation of errors.
class FixNoiseModel {
 public:
  /// Requires parameters without faults.
  explicit FixNoiseModel(const FixNoiseModelParameters& parameters) : parameters_(parameters), scale_(fresh_scale()) {}

  /// Forgets everything, the factor too: a filter that starts anew gives the same again.
  void reset();
  /// Odometry since the last fix: whether the robot stands.
  void move(const Twist2& twist, double duration_s);

  double scale() const { return lagged_scale_ ? std::max(scale_.value(), lagged_scale_->value()) : scale_.value(); }
  /// The next fix declares `declared` (m^2, positive definite): as far as its ups and downs are believed. Its size is
  /// drawn towards the geometric mean of those declared lately, by the power 1 - fix_covariance_weight, at most by a
  /// factor of 4.
  Eigen::Matrix2d effective_covariance(const Eigen::Matrix2d& declared);
  /// Factor on the covariance of a fix at `time_s`, since correlated fixes carry less information; at least 1.
  double correlation_inflation(double time_s) const;

  /// The fix at `time_s` was used, with a share `exceeding` of its NIS beyond the median: LearntScale::learn().
  void learn(double time_s, double exceeding);
  /// Compares the fix with that of the lag before: learns a second factor, from differences of which a filter that
  /// follows its fixes knows nothing. The larger of the two counts.
  void compare(const DeadReckonedFix& fix);

 private:
  FixNoiseModelParameters parameters_;
  /// Where nothing is learnt, receivers are right.
  LearntScale fresh_scale() const {
    return {parameters_.fix_scale_rate, parameters_.fix_scale_limit,
            parameters_.fix_scale_rate > 0.0 ? parameters_.first_fix_scale : 1.0};
  }

  std::optional<double> log_mean_variance_;  ///< of what fixes declare, per axis
  LearntScale scale_;
  std::optional<LearntScale> lagged_scale_;
  std::deque<DeadReckonedFix> fixes_;
  std::optional<double> last_s_;
  Travel since_fix_;
};

}  // namespace urban_gnss
