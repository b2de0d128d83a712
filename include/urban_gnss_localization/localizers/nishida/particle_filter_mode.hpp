#pragma once

#include "urban_gnss_localization/common/parameters.hpp"

namespace urban_gnss {

/// How closely the text of Nishida et al. is followed, by the particle filter and by its bias filter.
enum class ParticleFilterMode {
  kLiteral,       ///< the text as printed
  kPaper,         ///< its reading that works
  kConventional,  ///< eq. (46), (47) as printed: motion proposal, direct likelihood, no bias
};
EnumNames<ParticleFilterMode> enum_names(ParticleFilterMode);

}  // namespace urban_gnss
