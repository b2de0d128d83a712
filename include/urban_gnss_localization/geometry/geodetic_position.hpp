#pragma once

namespace urban_gnss {

/// A position on the WGS-84 ellipsoid: degrees, metres above the ellipsoid.
struct GeodeticPosition {
  double latitude_deg{0.0};
  double longitude_deg{0.0};
  double altitude_m{0.0};
};

inline bool operator==(const GeodeticPosition& a, const GeodeticPosition& b) {
  return a.latitude_deg == b.latitude_deg && a.longitude_deg == b.longitude_deg && a.altitude_m == b.altitude_m;
}

}  // namespace urban_gnss
