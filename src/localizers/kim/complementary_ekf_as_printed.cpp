// What the modes as printed do in place of our own rules.

#include "urban_gnss_localization/localizers/kim/complementary_ekf.hpp"

namespace urban_gnss {

OdometryErrorParameters ComplementaryEkf::odometry_of_mode() const {
  OdometryErrorParameters odometry = parameters_.odometry;
  if (is_as_printed() || !parameters_.estimate_odometry_errors) {
    odometry.speed_scale_sigma = odometry.speed_scale_walk = 0.0;
    odometry.yaw_rate_bias_sigma = odometry.yaw_rate_bias_walk = 0.0;
  }
  if (is_as_printed()) {
    odometry.motion_noise_factor = 1.0;
    odometry.standstill_radps = 0.0;  // eq. (1) and (2) at every step, also where the robot stands
  }
  return odometry;
}

void ComplementaryEkf::decide_as_printed(const Innovation& innovation, FixOutcome& outcome) {
  last_test_covariance_ = prediction_covariance(innovation) + innovation.declared;
  outcome.nis = normalised_innovation_squared(innovation.value, last_test_covariance_);
  outcome.nis_threshold = kPrintedThreshold;
  const bool is_biased = outcome.nis > kPrintedThreshold;
  if (is_biased && parameters_.mode == ComplementaryMode::kGatedAsPrinted) {
    outcome.decision = FixDecision::kRejectedGate;
    outcome.reason = "innovation above the printed threshold";
    return;
  }
  if (is_biased && !is_open_ && parameters_.mode == ComplementaryMode::kCompensatedAsPrinted) open();
  if (!is_biased && is_open_) {
    close();
    outcome.reason = "the bias has ended";
  }
  apply(innovation);
  if (is_open_) outcome.decision = FixDecision::kBiasCompensated;
}

}  // namespace urban_gnss
