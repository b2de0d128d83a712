#pragma once

#include <cstddef>
#include <optional>

#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

/// Numbers that a receiver or a sentence gives to the satellites of one system.
struct SatelliteNumberRange {
  Constellation constellation;
  int first, last;  ///< as the receiver counts
  int first_svid;   ///< of `first`, as Satellite.msg counts

  std::optional<SatelliteId> id_of(int number) const {
    if (number < first || number > last) return std::nullopt;
    return SatelliteId{constellation, first_svid + number - first};
  }
};

/// By the first range that has the number.
template <std::size_t N>
std::optional<SatelliteId> id_in(const SatelliteNumberRange (&ranges)[N], int number) {
  for (const SatelliteNumberRange& range : ranges) {
    if (const auto id = range.id_of(number)) return id;
  }
  return std::nullopt;
}

}  // namespace urban_gnss
