#pragma once

#include <Eigen/Core>
#include <GeographicLib/LocalCartesian.hpp>
#include <string>
#include <vector>

#include "urban_gnss_localization/geometry/geodetic_position.hpp"

namespace urban_gnss {

/// -90 to 90, both included; NaN and infinities are not.
bool is_latitude(double degrees);

/// -180 to 180, both included (they are the same meridian); NaN and infinities are not.
bool is_longitude(double degrees);

/// A height above the ellipsoid at which a receiver near the ground can be: within 100 km of it, finite.
bool is_altitude(double metres);

/// One sentence for each coordinate that no place near the Earth's surface has; empty where there is none.
std::vector<std::string> position_faults(const GeodeticPosition& position);

/// The map frame: east, north, up in metres in the plane that touches the ellipsoid's parallel surface at the datum
/// (REP-103). An exact conversion through the Earth-centred frame, with no projection and no zones, so that it behaves
/// the same in all four quadrants, across the 180° meridian and at the poles. At a pole, where every direction is north
/// or south, the datum's longitude says which way the axes point.
class LocalFrame {
 public:
  /// The origin is `datum`. Throws std::invalid_argument that names every coordinate that is not finite or out of
  /// range.
  explicit LocalFrame(const GeodeticPosition& datum);

  /// East, north, up in m. A latitude outside [-90, 90] and anything that is not finite give NaN in all three;
  /// longitudes are taken modulo 360°. Never throws.
  Eigen::Vector3d to_local(const GeodeticPosition& position) const;

  /// The place at east, north, up in m; its longitude is in [-180, 180]. Anything that is not finite gives NaN in all
  /// three. Never throws.
  GeodeticPosition to_geodetic(const Eigen::Vector3d& enu) const;

  /// The angle (rad, counter-clockwise) by which east at the place is turned from the frame's x axis, as meridians
  /// converge: near the datum 0; 90 km east of it, at 65 degrees north, 0.03. What a receiver says in east and north,
  /// turned by it, is in the frame. 0 for what is no place.
  double convergence_rad(const GeodeticPosition& position) const;

  const GeodeticPosition& datum() const { return datum_; }

 private:
  GeodeticPosition datum_;
  GeographicLib::LocalCartesian converter_;
};

}  // namespace urban_gnss
