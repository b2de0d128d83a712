#include "urban_gnss_localization/filters/particle_localizer.hpp"

#include <cmath>

namespace urban_gnss {

LocalizerHealth ParticleLocalizer::health() const {
  LocalizerHealth health;
  health.heading_sigma_rad = circular_sigma(particles_);
  health.particle_count = static_cast<std::uint32_t>(particles_.size());
  health.effective_sample_size = effective_sample_size_;
  health.position_spread_m =
      std::sqrt(covariance_about(particles_, circular_mean(particles_)).topLeftCorner<2, 2>().trace());
  health.cluster_mass = clusters_.heaviest_mass();
  health.cluster_count = clusters_.count();
  return health;
}

}  // namespace urban_gnss
