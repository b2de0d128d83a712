#pragma once

#include "urban_gnss_localization/localizers/localizer.hpp"
#include "urban_gnss_localization/localizers/particle_set.hpp"

namespace urban_gnss {

/// What of the particles is the estimate.
enum class EstimateMethod { kMean, kHeaviestCluster };
EnumNames<EstimateMethod> enum_names(EstimateMethod);

/// What every particle filter publishes beside its pose.
class ParticleLocalizer : public Localizer {
 public:
  Pose2 pose() const override { return estimate_; }

  /// What is shown of them: where particles are no points, one drawn from each.
  const ParticleSet& particles() const { return particles_; }
  /// At the last fix.
  double effective_sample_size() const { return effective_sample_size_; }

 protected:
  explicit ParticleLocalizer(std::size_t particle_count) : particles_(particle_count) {}

  ParticleSet particles_;
  Pose2 estimate_;
  double effective_sample_size_{0.0};
};

}  // namespace urban_gnss
