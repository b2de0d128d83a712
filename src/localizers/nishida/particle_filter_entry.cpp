#include "urban_gnss_localization/localizers/localizer_entry.hpp"
#include "urban_gnss_localization/localizers/nishida/particle_filter.hpp"

namespace urban_gnss {

LocalizerEntry particle_filter_entry() {
  return make_entry<SettingsWithMotion<ParticleFilter, ParticleFilterParameters>>(
      "particle_filter",
      "Nishida et al.: a particle filter that uses the length of the bias, which gps_bias_node tracks.",
      {{"paper", {"mode=paper"}}});
}

}  // namespace urban_gnss
