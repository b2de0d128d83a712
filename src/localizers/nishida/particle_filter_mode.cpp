#include "urban_gnss_localization/localizers/nishida/particle_filter_mode.hpp"

namespace urban_gnss {

EnumNames<ParticleFilterMode> enum_names(ParticleFilterMode) {
  return {{"literal", ParticleFilterMode::kLiteral},
          {"paper", ParticleFilterMode::kPaper},
          {"conventional", ParticleFilterMode::kConventional}};
}

}  // namespace urban_gnss
