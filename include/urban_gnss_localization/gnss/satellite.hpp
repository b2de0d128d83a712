#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <tuple>
#include <vector>

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

/// The clock of the receiver that a range contains: SBAS and QZSS keep the time of GPS.
Constellation clock_of(Constellation constellation);

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

/// What is known of one satellite. Angles may be whole degrees, as many receivers give them.
struct SatelliteObservation {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  SatelliteId id;
  LookAngles look;  ///< not finite, or below the horizon: the satellite is left out
  double cn0_dbhz{kUnknown};
  bool tracked{true};                 ///< otherwise the satellite is left out
  double blocked_fraction{kUnknown};  ///< share of rays that the map blocks, 0 to 1; unknown without a map
  double known_fraction{0.0};         ///< share of rays whose way through the map is known, 0 to 1
  /// m, of its pseudorange in the receiver's own solution: measured minus expected; unknown where it was not used
  double residual_m{kUnknown};
};

/// Whether the satellite's direction is known and on or above the horizon.
bool has_direction(const SatelliteObservation& satellite);

/// Whether its C/N0 is known; receivers report 0 where it is not.
bool has_cn0(const SatelliteObservation& satellite);

/// Whether there is a signal of it, with direction and C/N0.
bool is_received(const SatelliteObservation& satellite);

/// m, root mean square of the residuals of the satellites that were received; 0 where no residual is known.
double residual_rms_m(const std::vector<SatelliteObservation>& satellites);

}  // namespace urban_gnss
