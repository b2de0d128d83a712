#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <string>
#include <tuple>

namespace urban_gnss {

/// The numbering is that of u-blox and gpsd (gnssid), as in Satellite.msg.
enum class Constellation : std::uint8_t {
  kGps = 0,
  kSbas = 1,
  kGalileo = 2,
  kBeidou = 3,
  kImes = 4,
  kQzss = 5,
  kGlonass = 6,
  kNavic = 7,
  kUnknown = 255,
};

struct SatelliteId {
  Constellation constellation{Constellation::kUnknown};
  int svid{0};  ///< number within the constellation

  friend bool operator==(const SatelliteId& a, const SatelliteId& b) {
    return a.constellation == b.constellation && a.svid == b.svid;
  }
  friend bool operator!=(const SatelliteId& a, const SatelliteId& b) { return !(a == b); }
  friend bool operator<(const SatelliteId& a, const SatelliteId& b) {
    return std::tie(a.constellation, a.svid) < std::tie(b.constellation, b.svid);
  }
};

/// The name that RINEX gives a satellite ("G05", "E11"); "?07" where the constellation is unknown.
std::string satellite_name(const SatelliteId& id);

/// Where a satellite stands as seen from the antenna.
struct LookAngles {
  double azimuth_rad{0.0};    ///< clockwise from true north
  double elevation_rad{0.0};  ///< above the horizon
};

/// Unit vector to the satellite in east, north, up.
inline Eigen::Vector3d line_of_sight(const LookAngles& look) {
  const double horizontal = std::cos(look.elevation_rad);
  return {horizontal * std::sin(look.azimuth_rad), horizontal * std::cos(look.azimuth_rad),
          std::sin(look.elevation_rad)};
}

}  // namespace urban_gnss
