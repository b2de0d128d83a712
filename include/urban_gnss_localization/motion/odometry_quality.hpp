#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "urban_gnss_localization/motion/odometry_errors.hpp"

namespace urban_gnss {

/// Levels of the quality of an odometry, the best first. A filter carries each as a hypothesis, and fixes tell which is
/// true: the yaw rate of a Segway's wheels wanders ten times as far as that of a car.
inline constexpr std::size_t kQualityLevels = 3;

struct OdometryQualityParameters {
  double wander_factor{12.0};
  double wander_share{0.3};
  double quality_time{600.0};
  double quality_evidence{0.1};

  void visit(ParameterVisitor& v) {
    v("wander_factor", wander_factor, at_least(1.0), "",
      "factor on heading_walk from the best to the worst level of the odometry; 1: only one level");
    v("wander_share", wander_share, between(0.0, 1.0), "",
      "prior probability of the odometry not being of the best level");
    v("quality_time", quality_time, positive(), "s", "mean time until the level of the odometry is drawn anew");
    v("quality_evidence", quality_evidence, non_negative(), "",
      "greatest log-likelihood ratio between levels that one fix may give; 0: nothing is learnt");
  }
};

using QualityProbabilities = Eigen::Matrix<double, kQualityLevels, 1>;
/// Row: the level before; column: the level after.
using QualityTransition = Eigen::Matrix<double, kQualityLevels, kQualityLevels>;

/// The errors of the odometry at each level: heading_walk grows by factors of equal ratio, motion_noise_factor by their
/// square (it is a factor on variances), position_walk and speed_scale_walk by their root.
std::array<OdometryErrorParameters, kQualityLevels> quality_levels(const OdometryErrorParameters& best,
                                                                   const OdometryQualityParameters& parameters);

/// The errors of an odometry of the middle level: for filters that do not learn which one it is.
inline OdometryErrorParameters middle_quality() { return quality_levels({}, {})[kQualityLevels / 2]; }

/// One step of the odometry with the noise of each level.
std::array<MotionStep, kQualityLevels> make_motion_steps(
    const Twist2& twist, double duration_s, const MotionParameters& motion,
    const std::array<OdometryErrorParameters, kQualityLevels>& levels);

QualityProbabilities prior_quality(const OdometryQualityParameters& parameters);

/// After `elapsed_s` >= 0, in which the level may have been drawn anew from prior_quality().
QualityTransition quality_transition(double elapsed_s, const OdometryQualityParameters& parameters);

/// By which to multiply what has the probabilities `present`, so that it has `target`; 1 where there is nothing.
QualityProbabilities rescaling(const QualityProbabilities& present, const QualityProbabilities& target);

/// The probabilities that a fix leaves, by those `before` and `after` it by Bayes' rule, where no fix may say more than
/// quality_evidence: errors of fixes last, and one that is off is no proof of a bad odometry.
QualityProbabilities bounded_quality(const QualityProbabilities& before, const QualityProbabilities& after,
                                     const OdometryQualityParameters& parameters);

}  // namespace urban_gnss
