#pragma once

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/common_error.hpp"
#include "urban_gnss_localization/gnss/correlated_errors.hpp"
#include "urban_gnss_localization/gnss/reacquisition.hpp"
#include "urban_gnss_localization/localizers/kim/bias_detector.hpp"
#include "urban_gnss_localization/localizers/kim/fix_noise_monitor.hpp"
#include "urban_gnss_localization/motion/odometry_quality.hpp"

namespace urban_gnss {

enum class ComplementaryMode {
  // As we read it: with the odometry's errors as states, the noise of the fixes as they show it, and our rules.
  kStandard,     ///< every fix is used
  kGated,        ///< a fix that is taken for biased is rejected
  kCompensated,  ///< its bias is estimated
  // As Kim et al. print it: the pose alone, every fix with the covariance that it declares, a threshold of 7.81.
  kStandardAsPrinted,     ///< section 2.3, the conventional filter
  kGatedAsPrinted,        ///< the same, but a fix above the threshold of section 4.2 is rejected
  kCompensatedAsPrinted,  ///< section 3 and figure 4, the proposed filter
};
EnumNames<ComplementaryMode> enum_names(ComplementaryMode);
bool is_as_printed(ComplementaryMode mode);

/// What happens when the fixes contradict the estimate for long.
enum class LockoutPolicy {
  kAutomatic,      ///< after lockout_timeout the estimate is what is wrong: its position starts anew on the fixes
  kDeadReckoning,  ///< the odometry is believed until a fix agrees with it again, or a pose is set
};
EnumNames<LockoutPolicy> enum_names(LockoutPolicy);

/// The Sigma_v of Kim et al.: 0.02 of the speed and 0.03 of the yaw rate, per sqrt(Hz).
MotionParameters kim_motion();

/// An odometry of the middle level, beside kim_motion(). Below 1e-4 rad/s the wheels do not turn the robot: the limit
/// of 0.01 rad/s, which a gyroscope may show at a standstill, would be too large here.
OdometryErrorParameters kim_odometry_errors();

struct ComplementaryEkfParameters {
  ComplementaryMode mode{ComplementaryMode::kCompensated};
  double fix_bias_sigma{20.0};
  double fix_bias_time{30.0};
  double close_probability{0.95};
  int close_count{5};
  double detection_horizon{10.0};
  double parked_correlation_time{150.0};
  LockoutPolicy lockout_policy{LockoutPolicy::kAutomatic};
  double lockout_timeout{20.0};
  double bias_open_timeout{120.0};
  double lockout_gap{5.0};
  bool estimate_odometry_errors{true};
  BiasDetectorParameters detector;
  FixNoiseParameters fix_noise;
  ErrorCorrelation errors{kFixErrors};
  ReacquisitionParameters reacquisition;
  CommonErrorParameters common_error;
  OdometryErrorParameters odometry = kim_odometry_errors();
  MotionParameters motion = kim_motion();

  void visit(ParameterVisitor& v) {
    v.basic()("mode", mode,
              "treatment of biased fixes; standard: used; gated: rejected; compensated: the bias is estimated; "
              "..._as_printed: the same as Kim et al. print it");
    v("fix_bias_sigma", fix_bias_sigma, positive(), "m per axis",
      "standard deviation of the bias when the bias filter opens (M0), also as printed");
    v("fix_bias_time", fix_bias_time, positive(), "s",
      "time constant of the bias's decay; with fix_bias_sigma it gives the growth of M");
    v("close_probability", close_probability, between(0.01, 0.999999), "",
      "probability of the quantile within which a bias is insignificant");
    v("close_count", close_count, between(1, 10000), "",
      "number of consecutive fixes with an insignificant bias after which the bias filter closes");
    v("detection_horizon", detection_horizon, non_negative(), "s",
      "time of doubted fixes after which the odometry's growing uncertainty no longer widens the tests");
    v("parked_correlation_time", parked_correlation_time, non_negative(), "s",
      "correlation time of the errors of fixes at a standstill");
    v("lockout_policy", lockout_policy,
      "response to fixes that contradict the estimate for long; automatic: position restarts on the fixes; "
      "dead_reckoning: odometry alone until a fix agrees again");
    v("lockout_timeout", lockout_timeout, positive(), "s",
      "time with nothing but rejected fixes after which the position restarts (automatic)");
    v("bias_open_timeout", bias_open_timeout, positive(), "s",
      "time with the bias filter open after which the position restarts (automatic)");
    v("lockout_gap", lockout_gap, positive(), "s",
      "time without a fix that ends a run of rejected fixes, after which lockout_timeout counts anew");
    v("estimate_odometry_errors", estimate_odometry_errors,
      "whether speed scale and yaw-rate bias are states; as printed they never are");
    v.group("detector", detector, "Detection of a biased fix; as printed the threshold is 7.81.");
    v.group("fix_noise", fix_noise, "Noise of the fixes, estimated from the fixes; not as printed.");
    v.group("error_correlation", errors, "How long errors of fixes last at least; not as printed.");
    v.group("reacquisition", reacquisition, "The first fixes after a gap; not as printed.");
    v.group("common_error", common_error,
            "Error that fixes share for a whole drive, which no filter can see; not as printed.");
    v.group("odometry", odometry, "Errors of the odometry.");
    v.group("motion", motion,
            "Noise of the motion, Nishida et al. eq. (5) to (8); alpha1 and alpha4 are the Sigma_v of Kim et al.");
  }
};

/// For the paper's own experiment, in every mode: an odometry that does not wander, and errors of fixes that last as
/// long as FixNoiseMonitor finds, with none that they share.
ComplementaryEkfParameters published_complementary_ekf();

}  // namespace urban_gnss
