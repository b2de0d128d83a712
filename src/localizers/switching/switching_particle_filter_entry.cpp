#include "urban_gnss_localization/localizers/localizer_entry.hpp"
#include "urban_gnss_localization/localizers/switching/switching_particle_filter.hpp"

namespace urban_gnss {

LocalizerEntry switching_particle_filter_entry() {
  return make_entry<SettingsWithMotion<SwitchingParticleFilter, SwitchingParticleFilterParameters>>(
      "switching_particle_filter", "The model of imm_ekf with particles, for a start whose heading is unknown.",
      {{"switching", {}, true}}, "switching_model");
}

}  // namespace urban_gnss
