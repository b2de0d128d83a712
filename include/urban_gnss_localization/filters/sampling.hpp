#pragma once

#include <cstdint>
#include <vector>

#include "urban_gnss_localization/filters/particle_set.hpp"
#include "urban_gnss_localization/motion/odometry_errors.hpp"

namespace urban_gnss {

/// Eq. (46) and the first line of (22): moves every particle by the noisy motion of eq. (8). The array form of
/// `move_noisily`, without allocation.
void sample_motion(ParticleSet& particles, const MotionStep& step, RandomEngine& engine);

/// The odometry's errors as each particle takes them to be: Gaussian given its path, with a mean of its own and a
/// variance that all share, as it depends on the inputs alone.
struct OdometryErrorSet {
  std::vector<double> speed_scale;    ///< 1, mean
  std::vector<double> yaw_rate_bias;  ///< rad/s, mean
  double speed_scale_variance{0.0};
  double yaw_rate_bias_variance{0.0};  ///< (rad/s)^2

  explicit OdometryErrorSet(std::size_t count) : speed_scale(count), yaw_rate_bias(count) {}

  /// Unknown about 0, as the parameters say.
  void reset(const OdometryErrorParameters& parameters);
  /// Their random walk over `duration_s`.
  void walk(double duration_s, const OdometryErrorParameters& parameters);
};

/// Moves every particle by the noisy motion of the corrected twist, with the odometry's errors marginalised
/// (Rao-Blackwell): the step is drawn from noise and errors together, and what it says of the errors is learnt by a
/// scalar Kalman step for each. Without errors (variances 0) it draws what the plain form draws.
void sample_motion(ParticleSet& particles, OdometryErrorSet& errors, const MotionStep& step, RandomEngine& engine);

/// The ring part of the proposal, eq. (22)-(26): a share of the particles, chosen at random, is drawn anew on a ring of
/// the bias's length about the predicted pose.
class RingSampler {
 public:
  /// `share` in [0, 1] of the particles.
  RingSampler(std::size_t particle_count, double share);

  /// `predicted` is f(x_est, u) of eq. (23), `radius_m` r-hat, `radius_sigma_m` sigma_b, `weight_sigma_m` sigma_s. Each
  /// drawn particle takes the weight of eq. (26) in place of its own: requires weights that are normalised before.
  void sample(ParticleSet& particles, const Pose2& predicted, double radius_m, double radius_sigma_m,
              double weight_sigma_m, RandomEngine& engine);

  /// The order of the draws as at the start, so that the same engine gives the same particles again.
  void reset();

  std::size_t count() const { return count_; }

 private:
  std::size_t count_;
  std::vector<std::uint32_t> order_;  ///< a permutation that every call shuffles on
};

}  // namespace urban_gnss
