#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "urban_gnss_localization/gnss/common_error.hpp"
#include "urban_gnss_localization/gnss/fix_noise_model.hpp"
#include "urban_gnss_localization/gnss/fix_sigma.hpp"
#include "urban_gnss_localization/gnss/range_fix.hpp"
#include "urban_gnss_localization/gnss/reacquisition.hpp"
#include "urban_gnss_localization/localizers/localizer.hpp"
#include "urban_gnss_localization/localizers/switching/bias_modes.hpp"
#include "urban_gnss_localization/localizers/switching/velocity_noise.hpp"
#include "urban_gnss_localization/motion/dead_reckoning.hpp"
#include "urban_gnss_localization/motion/odometry_quality.hpp"

namespace urban_gnss {

/// The common error where the odometry's quality is learnt. Smaller than the default, with which filters that do not
/// learn it cover a part of the odometry's drift, too.
inline constexpr CommonErrorParameters kCommonErrorBesideLearntOdometry{0.55, 0.15, 4.0};

/// The noise of fixes where biases are modelled beside it: these take up what lasts, so that fixes are compared over
/// less than the time for which a receiver smooths them.
inline FixNoiseModelParameters fix_noise_beside_biases() {
  FixNoiseModelParameters noise;
  noise.first_fix_scale = 2.5;
  noise.fix_scale_lag = 4.0;
  return noise;
}

/// The model of odometry and receiver that the filters of the switching bias share.
struct SwitchingModelParameters {
  FixSigmaParameters fix;
  FixNoiseModelParameters noise{fix_noise_beside_biases()};
  RangeFixParameters ranges;
  VelocityNoiseParameters velocity;
  BiasModeParameters modes;
  OdometryErrorParameters odometry;
  OdometryQualityParameters quality;
  double yaw_rate_scale_sigma{0.005};
  ReacquisitionParameters reacquisition;
  CommonErrorParameters common_error{kCommonErrorBesideLearntOdometry};
  double range_common_error_share{0.35};

  void visit(ParameterVisitor& v) {
    v.include(fix);
    v.group("fix_noise", noise, "Noise of the fixes relative to their declared covariance.");
    v.group("ranges", ranges,
            "Ranges of a fix (gps/satellites), from which it is solved anew, each in line of sight or reflected.");
    v.group("velocity_noise", velocity, "Noise of the receiver's velocity (gps/velocity).");
    v.group("bias", modes, "Bias of a fix: none in direct reception, else one that changes slowly, fast, or at once.");
    v.group("odometry", odometry, "Errors of the odometry, which the filter estimates.");
    v.group("odometry_quality", quality, "How far the odometry wanders, which the filter learns.");
    v("yaw_rate_scale_sigma", yaw_rate_scale_sigma, non_negative(), "",
      "standard deviation of the odometry's relative yaw-rate error, a constant");
    v.group("reacquisition", reacquisition, "The first fixes after a gap.");
    v("range_common_error_share", range_common_error_share, non_negative(), "",
      "standard deviation of the common error relative to that of a fix which is solved from its ranges");
    v.group("common_error", common_error, "Error that fixes share for a whole drive, which no filter can see.");
  }
};

/// Order of the states: pose and odometry errors (kErrorStates), relative error of the yaw rate (1), bias b_x, b_y (m).
inline constexpr int kMotionStates = kErrorStates + 1;
inline constexpr int kBiasStates = kMotionStates + 2;
using BiasEkfState = Eigen::Matrix<double, kBiasStates, 1>;
using BiasEkfCovariance = Eigen::Matrix<double, kBiasStates, kBiasStates>;

/// The state of the extended Kalman filter that the model is, given the modes of all fixes; the yaw is in [-pi, pi).
struct BiasGaussian {
  BiasEkfState mean{BiasEkfState::Zero()};
  BiasEkfCovariance covariance{BiasEkfCovariance::Zero()};

  Pose2 pose() const { return {mean[0], mean[1], mean[2]}; }
  PoseEstimate pose_estimate() const { return {pose(), covariance.topLeftCorner<3, 3>()}; }
  bool is_finite() const { return mean.allFinite() && covariance.allFinite(); }
};

/// The state at a start: no bias, odometry errors about 0.
BiasGaussian start_gaussian(const PoseEstimate& start, const SwitchingModelParameters& parameters);

/// The difference of two states, the yaw's on the circle.
BiasEkfState difference(const BiasEkfState& a, const BiasEkfState& b);

/// Mean of a mixture of `count` >= 1 Gaussians: state_of(i) with weight_of(i), which sum to 1. Yaws are averaged as
/// differences from the heaviest.
template <class StateOf, class WeightOf>
BiasEkfState match_means(std::size_t count, const StateOf& state_of, const WeightOf& weight_of) {
  std::size_t heaviest = 0;
  for (std::size_t i = 1; i < count; ++i) {
    if (weight_of(i) > weight_of(heaviest)) heaviest = i;
  }
  const BiasEkfState centre = state_of(heaviest).mean;
  BiasEkfState apart = BiasEkfState::Zero();
  for (std::size_t i = 0; i < count; ++i) apart += weight_of(i) * difference(state_of(i).mean, centre);
  BiasEkfState mean = centre + apart;
  mean[2] = wrap_angle(mean[2]);
  return mean;
}

/// Mean and covariance of the same.
template <class StateOf, class WeightOf>
BiasGaussian match_moments(std::size_t count, const StateOf& state_of, const WeightOf& weight_of) {
  BiasGaussian whole;
  whole.mean = match_means(count, state_of, weight_of);
  for (std::size_t i = 0; i < count; ++i) {
    if (weight_of(i) <= 0.0) continue;
    const BiasEkfState spread = difference(state_of(i).mean, whole.mean);
    whole.covariance += weight_of(i) * (state_of(i).covariance + spread * spread.transpose());
  }
  return whole;
}

/// Dead-reckons one step.
void predict(BiasGaussian& state, const MotionStep& step, const OdometryErrorParameters& parameters);

/// Adds what the last step may be wrong by.
void doubt(BiasGaussian& state, const MotionDoubt& doubt);

/// The bias within the state goes on.
void continue_bias(BiasGaussian& state, const BiasStep& step);

/// What a measurement said.
struct BiasEkfUpdate {
  double log_likelihood{-std::numeric_limits<double>::infinity()};
  double nis{0.0};
  double white_nis{0.0};  ///< the same without the inflation of correlated fixes
  double outlier{0.0};    ///< posterior probability that it is one
};

/// Factors on a fix's covariance.
struct FixNoise {
  double scale{1.0};      ///< learnt
  double inflation{1.0};  ///< of correlated errors
  double added_m2{0.0};   ///< a variance per axis beside it: Reacquisition
  bool of_ranges{false};  ///< the covariance is that of the fix's ranges, which use_fix_covariance does not concern
};

/// Takes a fix of the mode `mode`. Direct reception has the heavy tails of Student's t: a fix that is far off counts as
/// one with larger noise. A share of outlier_share of the fixes says nothing: the states with and without such a fix
/// are merged by their moments.
BiasEkfUpdate take_fix(BiasGaussian& state, BiasMode mode, const FixMeasurement& fix, const FixNoise& noise,
                       const SwitchingModelParameters& parameters);

/// Takes a velocity of the receiver, whose noise is Student's t with `noise` for its covariance ((m/s)^2): it corrects
/// yaw and speed scale. The likelihood lacks a constant factor.
BiasEkfUpdate take_velocity(BiasGaussian& state, const VelocityMeasurement& measured, const Eigen::Matrix2d& noise,
                            double inflation, double student_dof);

}  // namespace urban_gnss
