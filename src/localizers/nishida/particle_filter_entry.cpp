#include "urban_gnss_localization/localizers/localizer_entry.hpp"
#include "urban_gnss_localization/localizers/nishida/particle_filter.hpp"

namespace urban_gnss {

LocalizerEntry particle_filter_entry() {
  return {"particle_filter",
          "Nishida et al.: a particle filter that uses the length of the bias, which gps_bias_node tracks.",
          std::make_unique<SettingsWithMotion<ParticleFilter, ParticleFilterParameters>>,
          {{"paper", {"mode=paper"}}}};
}

}  // namespace urban_gnss
