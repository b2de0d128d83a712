#pragma once

#include <Eigen/Core>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/gnss/fix_decision.hpp"
#include "urban_gnss_localization/localizers/bias_estimate.hpp"
#include "urban_gnss_localization/localizers/nishida/particle_filter_mode.hpp"

namespace urban_gnss {

/// Nishida et al. eq. (14)-(20): a Kalman filter of a position that moves with slowly changing velocity. State
/// (x, v_x, y, v_y) in m and m/s.
struct BiasKalmanFilter {
  using State = Eigen::Vector4d;
  using Covariance = Eigen::Matrix4d;

  State state{State::Zero()};
  Covariance covariance{Covariance::Identity()};

  /// Eq. (16), (17), with the process noise of a white acceleration of spectral density `acceleration_density`^2
  /// (m/s^2/sqrt(Hz)). With 0, as printed, the gain decays and a bias that changes is no longer followed.
  void predict(double duration_s, double acceleration_density);

  struct Innovation {
    Eigen::Vector2d value;       ///< m
    Eigen::Matrix2d covariance;  ///< m^2
    double nis() const;
  };
  /// Measurement minus prediction, before any correction.
  Innovation innovation(const Eigen::Vector2d& measurement, const Eigen::Matrix2d& noise) const;

  /// Eq. (18)-(20), the covariance in Joseph form.
  void correct(const Innovation& innovation, const Eigen::Matrix2d& noise);

  Eigen::Vector2d position() const { return {state(0), state(2)}; }
  Eigen::Vector2d velocity() const { return {state(1), state(3)}; }
  Eigen::Matrix2d position_covariance() const;
};

/// What the Kalman filter is run on.
enum class BiasInput {
  kResidual,  ///< fix minus predicted position, so that (21) is the length of the bias: the reading that works
  kPosition,  ///< the fix itself, as printed: (21) is then the distance from the origin
};
EnumNames<BiasInput> enum_names(BiasInput);

struct GpsBiasParameters {
  ParticleFilterMode mode{ParticleFilterMode::kPaper};
  BiasInput bias_input{BiasInput::kResidual};
  double shadow_sigma{3.0};
  double bias_acceleration_density{0.3};
  double bias_rate_sigma{3.0};
  double gate_probability{0.99};
  double gate_timeout{5.0};
  double shadow_probability{0.99};

  void visit(ParameterVisitor& v) {
    v.basic()("mode", mode,
              "as the particle filter's; literal: as printed, on the position, without process noise, without a gate");
    v("bias_input", bias_input,
      "input of the filter: fix minus predicted antenna (residual), or as printed (position)");
    v("shadow_sigma", shadow_sigma, positive(), "m",
      "standard deviation sigma_s = sigma_c of a fix in the shadow, eq. (15), (18)");
    v("bias_acceleration_density", bias_acceleration_density, non_negative(), "m/s^2/sqrt(Hz)",
      "noise density of the bias's acceleration, eq. (17); 0: as printed");
    v("bias_rate_sigma", bias_rate_sigma, positive(), "m/s", "initial standard deviation of the bias's rate of change");
    v("gate_probability", gate_probability, open_between(0.0, 1.0), "",
      "probability that a good fix passes the gate; 1: no gate");
    v("gate_timeout", gate_timeout, positive(), "s",
      "time with nothing but rejected fixes after which the filter restarts on the fix");
    v("shadow_probability", shadow_probability, between(0.5, 0.999999), "",
      "confidence at which the bias counts as significant (in_shadow)");
  }
};

/// Tracks the bias from fix to fix: the Kalman filter above with its start, its gate and its recovery from a lock-out.
/// In mode `literal` it is the printed filter: on the position, without process noise, without a gate.
class BiasTracker {
 public:
  explicit BiasTracker(const GpsBiasParameters& parameters);

  /// Takes one validated fix, with the antenna position that the localizer predicted for the fix's stamp from its last
  /// estimate and the odometry since. Requires stamps that ascend.
  const BiasEstimate& process(const LocalFix& fix, const Eigen::Vector2d& predicted_antenna_position,
                              const FixOutcome& validation = {});

  const BiasEstimate& estimate() const { return estimate_; }
  void reset();

 private:
  void start(const Eigen::Vector2d& measurement);

  GpsBiasParameters parameters_;
  double gate_threshold_;
  BiasKalmanFilter filter_;
  BiasEstimate estimate_;
  bool started_{false};
  Stamp last_accepted_{0};
  Stamp last_predicted_{0};
};

}  // namespace urban_gnss
