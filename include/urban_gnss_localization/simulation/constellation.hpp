#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

/// Rate of the Earth's rotation, IS-GPS-200, table 20-IV.
inline constexpr double kEarthRate_radps = 7.2921151467e-5;

/// What the longitude of a node is counted from.
enum class NodeReference {
  kInertial,    ///< the vernal equinox: right ascension, as in a constellation's definition
  kEarthFixed,  ///< the prime meridian at the reference time, as in an almanac
};

/// A satellite's orbit: an ellipse whose node precesses. Instants here are UTC in ns since 1970-01-01 without leap
/// seconds; UT1 is taken to be UTC (within 0.9 s, in which the Earth turns by 0.004 deg).
struct KeplerElements {
  Stamp reference{0};  ///< UTC instant at which node and mean anomaly hold
  double semi_major_axis_m{0.0};
  double eccentricity{0.0};  ///< [0, 1)
  double inclination_rad{0.0};
  double node_rad{0.0};  ///< of the ascending node, at the reference time
  double node_rate_radps{0.0};
  double argument_of_perigee_rad{0.0};
  double mean_anomaly_rad{0.0};
  NodeReference node_reference{NodeReference::kInertial};
};

struct OrbitingSatellite {
  SatelliteId id;
  KeplerElements orbit;
};

/// Solves Kepler's equation M = E - e sin E for the eccentric anomaly E in rad by Newton's method, to 1e-14 rad for
/// every finite M and e in [0, 0.99], of which orbits in use have less than 0.2. At most 30 iterations.
double eccentric_anomaly(double mean_anomaly_rad, double eccentricity);

/// Greenwich mean sidereal time, rad in [0, 2 pi): IAU 1982 (Aoki et al., Astron. Astrophys. 105, 359, 1982).
double greenwich_mean_sidereal_time(Stamp utc);

/// Where the satellite is in the Earth-centred, Earth-fixed frame (WGS-84), m. Kepler's motion with the GM of
/// IS-GPS-200 (table 20-IV) and a linear precession of the node.
Eigen::Vector3d ecef_position(const KeplerElements& orbit, Stamp utc);

/// The 24 slots of the GPS baseline constellation, A1..A4, B1..F4 as svid 1..24: slots are not PRNs. GPS SPS
/// Performance Standard (4th ed. 2008, 5th ed. 2020), table 3.2-1; rate of the node from the 2001 edition, table A-2-1.
std::vector<OrbitingSatellite> gps_baseline();

/// The 24 slots of the Galileo reference constellation (Walker 24/3/1), A01..A08, B01..C08 as svid 1..24: slots are not
/// PRNs. European GNSS Service Centre, "Orbital and technical parameters" (reference epoch 2016-11-21), from which the
/// Galileo OS Service Definition Document takes them.
std::vector<OrbitingSatellite> galileo_reference();

/// The 24 slots of GLONASS, svid = slot number: three planes of eight, 15 deg apart in argument of latitude, numbered
/// against the motion; inclination 64.8 deg, draconic period 40 544 s (GLONASS ICD L1, L2, ed. 5.1, 2008). The phase
/// is that of the ideal constellation of 1983-01-01 00:00 Moscow time. Seen from the ground, satellites that receivers
/// reported were at most 7.4 deg (8 of them, 2019) and 13 deg (9, 2020, median 4 deg) from their slots, which are 45
/// deg apart.
std::vector<OrbitingSatellite> glonass_nominal();

/// Which satellites there are, and from which elevation on a receiver hears them.
struct SkyParameters {
  bool gps{true};
  bool galileo{true};
  bool glonass{false};
  std::string almanac;
  double elevation_mask{0.0873};

  void visit(ParameterVisitor& v) {
    v("gps", gps, "");
    v("galileo", galileo, "");
    v("glonass", glonass, "");
    v("almanac", almanac,
      "YUMA almanac file that replaces the GPS baseline constellation; empty for none. Relative to the scenario's "
      "folder");
    v("elevation_mask", elevation_mask, between(0.0, 1.5), "", "rad");
  }
  void check(std::vector<std::string>& faults) const;
};

struct VisibleSatellite {
  SatelliteId id;
  LookAngles look;      ///< from the datum; azimuth in [-pi, pi]
  double range_m{0.0};  ///< from the datum
};

/// The satellites over one place. Directions hold for the surroundings: 1 km away they differ by less than 0.003 deg.
/// Geometric: refraction (0.2 deg at the mask), and the 0.07 s that the signal travels (0.001 deg), are left out.
class Sky {
 public:
  /// `near` is a UTC instant of the simulation: it tells which of the 1024-week eras an almanac's week belongs to.
  /// `directory` is the folder that a relative almanac path starts from; empty for the working directory.
  /// Throws std::invalid_argument for a datum that is no place, std::runtime_error for an almanac that cannot be used.
  /// Requires parameters without faults.
  Sky(const SkyParameters& parameters, const GeodeticPosition& datum, Stamp near, const std::string& directory = "");

  /// The satellites above the elevation mask, sorted by id.
  std::vector<VisibleSatellite> above_horizon(Stamp utc) const;

  /// The same, into a vector whose memory is used again.
  void above_horizon(Stamp utc, std::vector<VisibleSatellite>& visible) const;

  /// All satellites, sorted by id.
  const std::vector<OrbitingSatellite>& satellites() const { return satellites_; }

 private:
  std::vector<OrbitingSatellite> satellites_;
  Eigen::Vector3d origin_m_;       ///< the datum, ECEF
  Eigen::Matrix3d enu_from_ecef_;  ///< rotation
  double elevation_mask_rad_{0.0};
};

}  // namespace urban_gnss
