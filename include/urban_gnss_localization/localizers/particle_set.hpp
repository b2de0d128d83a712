#pragma once

#include <cstddef>
#include <vector>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/geometry/pose2.hpp"

namespace urban_gnss {

/// Weighted pose hypotheses as arrays: m, m, rad in [-pi, pi), log of the weight. Weights are kept as logarithms so
/// that no product of likelihoods underflows; `normalise` makes them sum to 1.
struct ParticleSet {
  std::vector<double> x;
  std::vector<double> y;
  std::vector<double> yaw;
  std::vector<double> log_weight;
  std::vector<double> weight;  ///< exp(log_weight), as of the last normalise

  explicit ParticleSet(std::size_t count = 0);

  std::size_t size() const { return x.size(); }
  /// The numbers of added particles, and the weights of all, are then to be set.
  void resize(std::size_t count);
  Pose2 pose(std::size_t i) const { return {x[i], y[i], yaw[i]}; }

  /// Draws every particle from the Gaussian about `start`, with equal weights. A yaw variance of pi^2/3 or more means
  /// an unknown heading and draws it uniformly. Only the lower triangle of the covariance is read; it may be singular.
  void draw_gaussian(const PoseEstimate& start, RandomEngine& engine);

  /// Moves every particle by independent Gaussian draws with these variances (m^2 per axis, rad^2).
  void spread(double position_m2, double heading_rad2, RandomEngine& engine);

  void set_equal_weights();

  /// Scales the weights to sum 1 and fills `weight`. False where no weight is positive and finite; the weights are
  /// then set equal.
  bool normalise();
};

}  // namespace urban_gnss
