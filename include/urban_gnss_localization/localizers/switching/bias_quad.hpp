#pragma once

#include <array>
#include <cstddef>

#include "urban_gnss_localization/localizers/switching/bias_ekf.hpp"

namespace urban_gnss {

/// A number for each mode that a fix may have (BiasMode).
using ModeNumbers = std::array<double, kContinuations>;
/// For each quality of the odometry.
using QualityNumbers = std::array<ModeNumbers, kQualityLevels>;

/// The states of the four modes that a fix may have, at one quality of the odometry, side by side. The functions below
/// do with all of them at once what those of bias_ekf.hpp do with one, up to rounding, for which a test compares them.
/// Of the filters between two fixes, which are three, the last is idle: its weight is 0.
struct BiasQuad {
  static constexpr int kPairs = kBiasStates * (kBiasStates + 1) / 2;

  std::array<ModeNumbers, kBiasStates> mean;
  std::array<ModeNumbers, kPairs> covariance;  ///< upper triangle, by rows

  /// Where the covariance of two states stands.
  static constexpr std::size_t pair(int i, int j) {
    return static_cast<std::size_t>(i <= j ? i * kBiasStates - i * (i - 1) / 2 + (j - i) : pair(j, i));
  }
  BiasGaussian at(std::size_t mode) const;
  void set(std::size_t mode, const BiasGaussian& state);
};

using BiasQuads = std::array<BiasQuad, kQualityLevels>;
/// Whether all numbers are, and their sum.
bool are_finite(const BiasQuads& filters);

/// Dead-reckons a step, with the noise of each quality. Steps differ in nothing else.
void predict(BiasQuads& filters, const std::array<MotionStep, kQualityLevels>& steps,
             const std::array<OdometryErrorParameters, kQualityLevels>& levels);

/// Mean pose of all filters together, whose probabilities sum to 1: match_means().
Pose2 pose_of(const BiasQuads& filters, const QualityNumbers& probability);
/// Mean and covariance of the same: match_moments().
PoseEstimate pose_estimate_of(const BiasQuads& filters, const QualityNumbers& probability);
BiasGaussian mixture_of(const BiasQuads& filters, const QualityNumbers& probability);
/// The mixture of the qualities, each mode for itself. Weights count relative to their sums, which are returned; where
/// a mode has none, quality `otherwise` is all.
ModeNumbers mix_qualities(const BiasQuads& filters, const QualityNumbers& weights, std::size_t otherwise,
                          BiasQuad& mixed);

/// The states of the modes after, each a mixture of those before: continue_bias(). `weights` are by the mode before,
/// and count relative to their sums, which are returned; where a mode after has none, it comes of direct reception.
ModeNumbers continue_biases(const BiasQuad& before, const std::array<ModeNumbers, kLastingModes>& weights,
                            const BiasSteps& steps, BiasQuad& after);
/// A slow bias and a jump become one, with these weights, which sum to 1.
void merge_jump(const BiasQuad& before, double slow, double jump, BiasQuad& merged);

/// BiasEkfUpdate of each mode.
struct BiasQuadUpdate {
  ModeNumbers log_likelihood, nis, white_nis, outlier;
};
using BiasQuadUpdates = std::array<BiasQuadUpdate, kQualityLevels>;
/// Bayes' rule: multiplies by the likelihoods, of which the logarithm of the `largest` is told, and makes the sum 1.
void weigh(QualityNumbers& probability, const BiasQuadUpdates& updates, double largest);
/// take_fix(), each state in its mode.
BiasQuadUpdates take_fix(BiasQuads& filters, const FixMeasurement& fix, const FixNoise& noise,
                         const SwitchingModelParameters& parameters);
/// take_velocity().
BiasQuadUpdates take_velocity(BiasQuads& filters, const VelocityMeasurement& measured, const Eigen::Matrix2d& noise,
                              double inflation, double student_dof);

}  // namespace urban_gnss
