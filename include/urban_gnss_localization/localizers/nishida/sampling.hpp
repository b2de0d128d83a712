#pragma once

#include <cstdint>
#include <vector>

#include "urban_gnss_localization/common/counter_random.hpp"
#include "urban_gnss_localization/localizers/particle_set.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"

namespace urban_gnss {

/// The noise of particle `particle` in sample_motion(): its draw of the stream.
MotionNoise motion_noise(const RandomStream& stream, std::size_t particle);

/// Eq. (46) and the first line of (22): moves every particle by the noisy motion of eq. (8). The array form of
/// `move_noisily` with `motion_noise`, without allocation.
void sample_motion(ParticleSet& particles, const MotionStep& step, const RandomStream& stream);

/// The ring part of the proposal, eq. (22)-(26): a share of the particles, chosen at random, is drawn anew on a ring of
/// the bias's length about the predicted pose.
class RingSampler {
 public:
  /// `share` in [0, 1] of the particles.
  RingSampler(std::size_t particle_count, double share);

  /// `predicted` is f(x_est, u) of eq. (23), `radius_m` r-hat, `radius_sigma_m` sigma_b, `weight_sigma_m` sigma_s. Each
  /// drawn particle takes the weight of eq. (26) in place of its own: requires weights that are normalised before.
  void sample(ParticleSet& particles, const Pose2& predicted, double radius_m, double radius_sigma_m,
              double weight_sigma_m, const RandomStream& stream);

  /// The order of the draws as at the start, so that the same stream gives the same particles again.
  void reset();

  std::size_t count() const { return count_; }

 private:
  std::size_t count_;
  std::vector<std::uint32_t> order_;  ///< a permutation that every call shuffles on
};

}  // namespace urban_gnss
