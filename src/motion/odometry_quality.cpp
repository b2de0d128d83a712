#include "urban_gnss_localization/motion/odometry_quality.hpp"

#include <cmath>

namespace urban_gnss {

std::array<OdometryErrorParameters, kQualityLevels> quality_levels(const OdometryErrorParameters& best,
                                                                   const OdometryQualityParameters& p) {
  std::array<OdometryErrorParameters, kQualityLevels> levels;
  for (std::size_t i = 0; i < kQualityLevels; ++i) {
    const double factor = std::pow(p.wander_factor, static_cast<double>(i) / (kQualityLevels - 1));
    levels[i] = best;
    levels[i].heading_walk *= factor;
    levels[i].motion_noise_factor *= factor * factor;
    levels[i].position_walk *= std::sqrt(factor);
    levels[i].speed_scale_walk *= std::sqrt(factor);
  }
  return levels;
}

std::array<MotionStep, kQualityLevels> make_motion_steps(
    const Twist2& twist, double duration_s, const MotionParameters& motion,
    const std::array<OdometryErrorParameters, kQualityLevels>& levels) {
  std::array<MotionStep, kQualityLevels> steps;
  steps.fill(make_motion_step(twist, duration_s, motion));
  for (std::size_t i = 0; i < kQualityLevels; ++i) scale_noise(steps[i], levels[i]);
  return steps;
}

QualityProbabilities prior_quality(const OdometryQualityParameters& p) {
  QualityProbabilities prior = QualityProbabilities::Constant(p.wander_share / (kQualityLevels - 1));
  prior[0] = 1.0 - p.wander_share;
  return prior;
}

QualityTransition quality_transition(double elapsed_s, const OdometryQualityParameters& p) {
  const double stays = std::exp(-elapsed_s / p.quality_time);
  const QualityTransition drawn = QualityProbabilities::Ones() * prior_quality(p).transpose();
  return stays * QualityTransition::Identity() + (1.0 - stays) * drawn;
}

QualityProbabilities rescaling(const QualityProbabilities& present, const QualityProbabilities& target) {
  QualityProbabilities factors = QualityProbabilities::Ones();
  for (int i = 0; i < factors.size(); ++i) {
    if (present[i] > 0.0) factors[i] = target[i] / present[i];
  }
  return factors;
}

QualityProbabilities bounded_quality(const QualityProbabilities& before, const QualityProbabilities& after,
                                     const OdometryQualityParameters& p) {
  QualityProbabilities evidence = QualityProbabilities::Zero();
  for (int i = 0; i < evidence.size(); ++i) {
    if (before[i] > 0.0) evidence[i] = after[i] / before[i];
  }
  if (!(evidence.maxCoeff() > 0.0)) return before;
  const double least = evidence.maxCoeff() * std::exp(-p.quality_evidence);
  const QualityProbabilities bounded = before.cwiseProduct(evidence.cwiseMax(least));
  return bounded / bounded.sum();
}

}  // namespace urban_gnss
