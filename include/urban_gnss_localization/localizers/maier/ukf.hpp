#pragma once

#include <Eigen/Core>
#include <optional>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/common_error.hpp"
#include "urban_gnss_localization/gnss/fix_noise_model.hpp"
#include "urban_gnss_localization/gnss/reacquisition.hpp"
#include "urban_gnss_localization/localizers/localizer.hpp"
#include "urban_gnss_localization/localizers/maier/unscented.hpp"
#include "urban_gnss_localization/motion/odometry_quality.hpp"

namespace urban_gnss {

/// How closely section III-A of Maier and Kleiner is followed.
enum class UkfMode {
  kStandard,   ///< ours: with the odometry's errors as states, and what is learnt of the fixes
  kAsPrinted,  ///< the pose alone, every fix with the covariance that it declares
};
EnumNames<UkfMode> enum_names(UkfMode);

/// What is done with a fix whose normalised innovation is larger than it should be.
enum class OutlierPolicy {
  kStudentT,  ///< weighed down, the more the farther it is off
  kGate,      ///< rejected beyond the chi-squared quantile
  kNone,      ///< used like any other
};
EnumNames<OutlierPolicy> enum_names(OutlierPolicy);

struct UkfParameters {
  UkfMode mode{UkfMode::kStandard};
  OutlierPolicy outliers{OutlierPolicy::kStudentT};
  double student_dof{1.0};
  double gate_probability{0.99};
  double gate_timeout{5.0};
  FixNoiseModelParameters fix_noise;
  ReacquisitionParameters reacquisition;
  CommonErrorParameters common_error;
  OdometryErrorParameters odometry = middle_quality();
  double ukf_alpha{0.5};
  double ukf_beta{2.0};
  double ukf_kappa{0.0};

  void visit(ParameterVisitor& v) {
    v.basic()("mode", mode,
              "standard: ours; as_printed: the pose alone, and fixes as they declare, as Maier and Kleiner print it");
    v.basic()("outliers", outliers,
              "treatment of outlying fixes; student_t: weighted down; gate: rejected; none: used as they are, also as "
              "printed");
    v("student_dof", student_dof, positive(), "",
      "degrees of freedom of Student's t-distribution (student_t); small: robust; large: Gaussian");
    v("gate_probability", gate_probability, open_between(0.0, 1.0), "",
      "probability that a good fix is not classified as an outlier; 1: no fix is");
    v("gate_timeout", gate_timeout, positive(), "s",
      "time with nothing but rejected fixes after which the filter restarts on the fix (gate)");
    v.group("fix_noise", fix_noise, "Noise of the fixes relative to their declared covariance; not as printed.");
    v.group("reacquisition", reacquisition, "The first fixes after a gap; not as printed.");
    v.group("common_error", common_error,
            "Error that fixes share for a whole drive, which no filter can see; not as printed.");
    v.group("odometry", odometry, "Errors of the odometry, which the filter estimates; not as printed.");
    v("ukf_alpha", ukf_alpha, between(1e-3, 1.0), "", "spread alpha of the sigma points");
    v("ukf_beta", ukf_beta, non_negative(), "",
      "weight beta of the central sigma point in the covariance; 2: for Gaussian errors");
    v("ukf_kappa", ukf_kappa, non_negative(), "", "secondary spread kappa of the sigma points");
  }
};

/// For the paper's own experiment, in the standard mode: fixes are what they declare, with independent errors but for a
/// second, and an odometry that does not wander.
UkfParameters published_ukf();

/// `parameters` without what is ours: neither robust weights nor a gate, fixes are what they declare, with independent
/// errors and none that they share, and all noise of the odometry is the motion model's, as it stands.
UkfParameters as_printed(UkfParameters parameters);

/// The unscented Kalman filter of Maier and Kleiner 2010, section III-A: x_t = g(x_{t-1}, u_{t-1}) + noise, eq. (1),
/// z_t = h(x_t) + noise, eq. (2), with the scaled unscented transform.
///
/// As printed the state is the pose, and that is all. What follows is the standard mode.
///
/// The state is (x, y, yaw, s, b): the pose, the relative error s of the odometry's speed and the error b of its yaw
/// rate, so that the robot's speed is (1 + s) v and its yaw rate w + b for the odometry's v and w. Odometry, or a
/// gyroscope in place of its yaw rate, is the control input u, as in eq. (1). A state with speed and yaw rate, and
/// odometry as a measurement of them, gives the same pose where odometry is much more frequent and exact than fixes,
/// and cannot tell a constant error from motion; s and b are slow random walks.
///
/// Motion: the noise of Nishida et al. (5)-(7) enters as three more dimensions of the transform (move_noisily()).
/// Fix: h is the antenna's position, lever arm included. The innovation's NIS is of the fix's covariance by
/// FixNoiseModel and Reacquisition; for the update, that is multiplied by correlation_inflation(), since errors that
/// last carry less information than independent ones, and divided by the weight of the Student-t distribution,
/// min(1, (dof + 2) / (dof + NIS)). The published covariance holds the error that all fixes share, too.
///
/// Yaws are averaged as differences from the central point that are never wrapped, which is the mean on the circle and
/// has no ambiguity. Its standard deviation is kept at or below that of an unknown yaw, pi / sqrt(3).
///
/// Input that is not finite changes nothing; the covariance is positive definite at all times.
class Ukf : public Localizer {
 public:
  static constexpr int kDimension = 5;
  using State = Eigen::Matrix<double, kDimension, 1>;
  using Covariance = Eigen::Matrix<double, kDimension, kDimension>;

  /// Requires parameters without faults.
  Ukf(const UkfParameters& parameters, const MotionParameters& motion);

  const char* name() const override { return "ukf"; }
  /// "as_printed", or what is done with outliers.
  std::string mode() const override {
    return is_as_printed() ? enum_name(parameters_.mode) : enum_name(parameters_.outliers);
  }
  bool is_as_printed() const override { return parameters_.mode == UkfMode::kAsPrinted; }
  bool wants_bias() const override { return false; }
  bool gates() const override { return !is_as_printed() && parameters_.outliers != OutlierPolicy::kNone; }
  /// Throws std::invalid_argument where pose or covariance is not finite. A covariance that is not positive definite is
  /// replaced by one close to it.
  void initialize(const PoseEstimate& start) override;
  /// Leaves out a step that is not finite or not positive in duration.
  void move(const Twist2& twist, double duration_s) override;
  void doubt(const MotionDoubt& doubt) override;
  /// kRejectedNonFinite for a fix that is not finite or has no positive definite covariance.
  FixOutcome correct(const FixMeasurement& fix) override;
  bool takes_heading() const override { return true; }
  /// The IMU's bearing. Its errors last, so it makes the yaw no surer than it is itself: a yaw that is surer stays as
  /// it is, any other gets the bearing's standard deviation. One that is not finite, or beyond 3 standard deviations,
  /// is left out.
  void correct_heading(const HeadingMeasurement& heading) override;
  Pose2 pose() const override { return {state_[0], state_[1], state_[2]}; }
  PoseEstimate estimate() const override;
  LocalizerHealth health() const override;

  double speed_scale() const { return state_[3]; }
  double yaw_rate_bias_radps() const { return state_[4]; }
  /// x, y, yaw, speed scale, yaw-rate bias; m, m, rad, 1, rad/s. As printed the last two are 0, and so is their
  /// covariance.
  const State& state() const { return state_; }
  const Covariance& covariance() const { return covariance_; }

 private:
  /// How many of the states there are: the pose alone, or all.
  int states() const { return parameters_.mode == UkfMode::kAsPrinted ? 3 : kDimension; }
  /// A lower root of the covariance of these states; 0 elsewhere.
  Covariance root() const;
  /// Makes the covariance of these states positive definite, and that of others 0. Whether it succeeded.
  bool repair(Covariance& covariance) const;
  /// The fix predicted from the state.
  struct Prediction {
    Eigen::Vector2d position;
    Eigen::Matrix2d covariance;                       ///< without the fix's own
    Eigen::Matrix<double, kDimension, 2> with_state;  ///< cross-covariance
  };
  Prediction predict(const Eigen::Vector2d& antenna_in_body) const;
  /// Whether the gate rejected the fix, or restarted on it.
  bool is_settled_by_gate(const FixMeasurement& fix, const Eigen::Vector2d& innovation, FixOutcome& outcome);
  /// Lets the noise model see a fix of the declared covariance (m^2) that was taken; `antenna` (m) and `before` it.
  void learn(const FixMeasurement& declared, double nis, const Eigen::Vector2d& antenna, const State& before);
  /// Takes over a new state; refuses one that is not finite.
  bool accept(State state, Covariance covariance);

  UkfParameters parameters_;
  MotionParameters motion_;
  UnscentedWeights motion_weights_;
  UnscentedWeights fix_weights_;
  double nis_threshold_;
  State state_{State::Zero()};
  Covariance covariance_{Covariance::Identity()};
  FixNoiseModel noise_;
  DeadReckonedTrack track_;
  Reacquisition reacquisition_;
  double common_variance_m2_{0.0};  ///< per axis
  std::optional<double> rejected_since_s_;
};

}  // namespace urban_gnss
