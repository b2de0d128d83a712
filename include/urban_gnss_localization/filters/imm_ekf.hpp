#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "urban_gnss_localization/filters/bias_modes.hpp"
#include "urban_gnss_localization/filters/dead_reckoning.hpp"
#include "urban_gnss_localization/filters/fix_noise_model.hpp"
#include "urban_gnss_localization/filters/localizer.hpp"
#include "urban_gnss_localization/filters/velocity_noise.hpp"

namespace urban_gnss {

struct ImmEkfParameters {
  FixSigmaParameters fix;
  FixNoiseModelParameters noise;
  VelocityNoiseParameters velocity;
  BiasModeParameters modes;
  OdometryErrorParameters odometry;
  double yaw_rate_scale_sigma{0.005};  ///< standard deviation of the odometry's relative yaw-rate error, a constant
  double fix_scale_lag{15.0};          ///< s apart at which fixes are compared with the odometry between them; 0: never
  /// m per axis, of the error that fixes share for long (orbits, atmosphere), as far as they declare as much. No filter
  /// sees it: it is added to the covariance of the estimate
  double common_error_sigma{0.7};

  template <class V>
  void visit(V& v) {
    fix.visit(v);
    noise.visit(v);
    velocity.visit(v);
    modes.visit(v);
    odometry.visit(v);
    v("yaw_rate_scale_sigma", yaw_rate_scale_sigma, non_negative());
    v("fix_scale_lag", fix_scale_lag, non_negative());
    v("common_error_sigma", common_error_sigma, non_negative());
  }
  void check(std::vector<std::string>&) const {}
};

/// The switching bias as an interacting multiple model (Blom and Bar-Shalom 1988): one extended Kalman filter for each
/// mode of a fix, mixed by matching moments at each fix.
///
/// Each filter's state is (x, y, yaw, s, w, a, b_x, b_y): pose, relative error of the odometry's speed, constant and
/// relative error of its yaw rate, bias of the fixes. In the direct mode the bias is 0. At a fix, the modes before it
/// are mixed into those that can go on from them (mode_transition(), predict_bias()); each takes the fix with its own
/// noise; its probability is multiplied by the fix's likelihood. A fix is an outlier with outlier_share: then it is
/// anywhere, and says nothing. Each mode weighs that in, and a jump is a slow bias once the fix is taken.
///
/// Input that is not finite changes nothing.
class ImmEkf : public Localizer {
 public:
  static constexpr int kMotionStates = kErrorStates + 1;
  static constexpr int kDimension = kMotionStates + 2;
  using State = Eigen::Matrix<double, kDimension, 1>;
  using Covariance = Eigen::Matrix<double, kDimension, kDimension>;

  /// A Gaussian of the state; the yaw is in [-pi, pi).
  struct Gaussian {
    State mean{State::Zero()};
    Covariance covariance{Covariance::Zero()};
  };

  /// Requires parameters without faults.
  ImmEkf(const ImmEkfParameters& parameters, const MotionParameters& motion);

  const char* name() const override { return "imm_ekf"; }
  std::string mode() const override { return "switching"; }
  bool wants_bias() const override { return false; }
  /// Throws std::invalid_argument where pose or covariance is not finite.
  void initialize(const PoseEstimate& start) override;
  /// Leaves out a step that is not finite or not positive in duration.
  void move(const Twist2& twist, double duration_s) override;
  /// kRejectedNonFinite for a fix that is not finite or has no positive definite covariance.
  FixVerdict correct(const FixMeasurement& fix) override;
  bool takes_velocity() const override { return true; }
  /// Leaves out a velocity that cannot be used.
  void correct_velocity(const VelocityMeasurement& velocity) override;
  Pose2 pose() const override;
  PoseEstimate estimate() const override;
  LocalizerHealth health() const override;

  /// Prior odds of a bias for the next fixes, against those of the parameters: bias_odds of mode_transition().
  void set_bias_odds(double odds) { bias_odds_ = odds; }

  const ModeProbabilities& mode_probabilities() const { return probability_; }
  /// The state given the mode at the last fix.
  const Gaussian& given(BiasMode mode) const { return filters_[index_of(lasting(mode))]; }
  /// All modes together.
  Gaussian mixture() const;

 private:
  /// A mode at this fix.
  struct Continuation {
    double prior{0.0};
    Gaussian state;
    double log_weight{0.0};  ///< of the fix, without the prior
  };
  Gaussian mixed_into(BiasMode to, const ModeTransition& transition, double elapsed_s) const;
  /// Lets the noise model see the fix beside the odometry alone; `before` is the mixture before the fix.
  void compare_with_odometry(const FixMeasurement& fix, const Gaussian& before);
  /// Takes the fix; returns its NIS. `outlier` becomes the posterior probability that it is one.
  double update(BiasMode mode, const FixMeasurement& fix, Continuation& continuation, double& outlier,
                double& white_nis) const;

  ImmEkfParameters parameters_;
  MotionParameters motion_;
  double nis_threshold_;
  FixNoiseModel noise_;
  LearntScale velocity_scale_;
  std::array<Gaussian, kLastingModes> filters_;
  ModeProbabilities probability_{ModeProbabilities::Zero()};
  double bias_odds_{1.0};
  std::optional<double> last_fix_s_;
  double moved_s_{0.0};                                   ///< of odometry since the start
  Eigen::Vector2d corrections_{Eigen::Vector2d::Zero()};  ///< m, what fixes have moved the position by since the start
  double common_variance_m2_{0.0};
};

}  // namespace urban_gnss
