#pragma once

#include <urban_gnss_localization/SatelliteVisibility.h>

#include <cstdint>

#include "urban_gnss_localization/ros/marker_parts.hpp"

namespace urban_gnss {

/// The same of rays and of the sky plot.
inline Colour colour_of(std::uint8_t visibility) {
  switch (visibility) {
    case urban_gnss_localization::SatelliteVisibility::FREE: return {0.2F, 0.9F, 0.3F, 0.9F};
    case urban_gnss_localization::SatelliteVisibility::BLOCKED: return {1.0F, 0.55F, 0.0F, 0.9F};
    case urban_gnss_localization::SatelliteVisibility::NOT_USED: return {1.0F, 1.0F, 1.0F, 0.9F};
    default: return {0.6F, 0.6F, 0.65F, 0.8F};
  }
}

}  // namespace urban_gnss
