#pragma once

#include <cstddef>
#include <vector>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/geometry/pose2.hpp"

namespace urban_gnss {

/// Weighted pose hypotheses as arrays, in the numbers of which the processor takes most at once. Places count from an
/// origin among the particles: within 32 m of it a float is exact to 1 um, however far away the map's datum is. Weights
/// are kept as logarithms so that no product of likelihoods underflows; `normalise` makes them sum to 1.
struct ParticleSet {
  Eigen::Vector2d origin{Eigen::Vector2d::Zero()};  ///< m, map frame
  std::vector<float> x;                             ///< m, from the origin
  std::vector<float> y;                             ///< m, from the origin
  std::vector<float> yaw;                           ///< rad in [-pi, pi], within rounding
  std::vector<float> log_weight;
  std::vector<float> weight;  ///< exp(log_weight), as of the last normalise

  explicit ParticleSet(std::size_t count = 0);

  std::size_t size() const { return x.size(); }
  /// The numbers of added particles, and the weights of all, are then to be set.
  void resize(std::size_t count);
  Pose2 pose(std::size_t i) const { return {origin.x() + x[i], origin.y() + y[i], wrap_angle(yaw[i])}; }
  void set_pose(std::size_t i, const Pose2& pose);

  /// Lets places count from `place`, where that is more than 16 m from the origin.
  void recentre(const Eigen::Vector2d& place);

  /// Draws every particle from the Gaussian about `start`, the new origin, with equal weights. A yaw variance of pi^2/3
  /// or more means an unknown heading and draws it uniformly. Only the lower triangle of the covariance is read; it may
  /// be singular.
  void draw_gaussian(const PoseEstimate& start, RandomEngine& engine);

  /// Moves every particle by independent Gaussian draws with these variances (m^2 per axis, rad^2).
  void spread(double position_m2, double heading_rad2, RandomEngine& engine);

  void set_equal_weights();

  /// Scales the weights to sum 1 and fills `weight`. False where no weight is positive and finite; the weights are
  /// then set equal.
  bool normalise();
};

}  // namespace urban_gnss
