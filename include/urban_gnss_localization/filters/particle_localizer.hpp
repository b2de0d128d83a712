#pragma once

#include "urban_gnss_localization/filters/estimation.hpp"
#include "urban_gnss_localization/filters/localizer.hpp"
#include "urban_gnss_localization/filters/particle_set.hpp"

namespace urban_gnss {

/// What every particle filter publishes beside its pose.
class ParticleLocalizer : public Localizer {
 public:
  Pose2 pose() const override { return estimate_; }
  /// The covariance is that of all particles about the pose, other clusters included.
  PoseEstimate estimate() const override { return {estimate_, covariance_about(particles_, estimate_)}; }
  LocalizerHealth health() const override;

  const ParticleSet& particles() const { return particles_; }
  /// Before resampling, at the last fix.
  double effective_sample_size() const { return effective_sample_size_; }

 protected:
  ParticleLocalizer(std::size_t particle_count, double cluster_cell_m)
      : particles_(particle_count), clusters_(particle_count, cluster_cell_m) {}

  ParticleSet particles_;
  ParticleClusters clusters_;
  Pose2 estimate_;  ///< of the last fix, moved without noise since: f(x_est, u) of eq. (23)
  double effective_sample_size_{0.0};
};

}  // namespace urban_gnss
