#include "urban_gnss_localization/simulation/constellation.hpp"

#include <GeographicLib/Geocentric.hpp>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/simulation/yuma.hpp"

namespace urban_gnss {
namespace {

constexpr double kGravitation_m3ps2 = 3.986005e14;  // IS-GPS-200, table 20-IV

constexpr double kDay_s = 86400.0;
constexpr Stamp kJ2000 = std::chrono::seconds(946728000);  // 2000-01-01 12:00 UTC

struct Slot {
  double node_deg;
  double argument_of_latitude_deg;
};

/// A slot of a constellation of circular orbits: without a perigee, the mean anomaly is the argument of latitude.
OrbitingSatellite in_slot(Constellation constellation, int svid, const KeplerElements& shape, const Slot& slot) {
  OrbitingSatellite satellite{{constellation, svid}, shape};
  satellite.orbit.node_rad = degrees_to_radians(slot.node_deg);
  satellite.orbit.mean_anomaly_rad = degrees_to_radians(slot.argument_of_latitude_deg);
  return satellite;
}

std::string resolved(const std::string& path, const std::string& directory) {
  return directory.empty() || path.front() == '/' ? path : directory + "/" + path;
}

}  // namespace

double eccentric_anomaly(double mean_anomaly_rad, double eccentricity) {
  const double mean = wrap_angle(mean_anomaly_rad);
  // |E| is between |M| and this bound, and E - e sin E is convex there: Newton's steps approach the root from one side.
  double eccentric = std::copysign(std::min(std::abs(mean) + eccentricity, kPi), mean);
  for (int i = 0; i < 30; ++i) {
    const double step =
        (eccentric - eccentricity * std::sin(eccentric) - mean) / (1.0 - eccentricity * std::cos(eccentric));
    eccentric -= step;
    if (std::abs(step) < 1e-15) break;
  }
  return eccentric + (mean_anomaly_rad - mean);
}

double greenwich_mean_sidereal_time(Stamp utc) {
  const double days = to_seconds(utc - kJ2000) / kDay_s;
  const double centuries = days / 36525.0;
  // The whole turns of the days are taken off before they cost digits.
  const double seconds = 67310.54841 + std::fmod(days, 1.0) * kDay_s +
                         (8640184.812866 + (0.093104 - 6.2e-6 * centuries) * centuries) * centuries;
  const double turns = seconds / kDay_s;
  const double angle_rad = 2.0 * kPi * (turns - std::floor(turns));
  return angle_rad < 2.0 * kPi ? angle_rad : 0.0;
}

Eigen::Vector3d ecef_position(const KeplerElements& orbit, Stamp utc) {
  const double elapsed_s = to_seconds(utc - orbit.reference);
  const double a = orbit.semi_major_axis_m;
  const double e = orbit.eccentricity;
  const double mean_motion_radps = std::sqrt(kGravitation_m3ps2 / (a * a * a));
  const double eccentric = eccentric_anomaly(orbit.mean_anomaly_rad + mean_motion_radps * elapsed_s, e);
  const double true_anomaly = std::atan2(std::sqrt(1.0 - e * e) * std::sin(eccentric), std::cos(eccentric) - e);
  const double radius_m = a * (1.0 - e * std::cos(eccentric));
  const double argument_of_latitude = orbit.argument_of_perigee_rad + true_anomaly;

  const double earth_turn_rad = orbit.node_reference == NodeReference::kInertial ? greenwich_mean_sidereal_time(utc)
                                                                                 : kEarthRate_radps * elapsed_s;
  const double node_longitude = orbit.node_rad + orbit.node_rate_radps * elapsed_s - earth_turn_rad;

  const double x = radius_m * std::cos(argument_of_latitude);
  const double y = radius_m * std::sin(argument_of_latitude) * std::cos(orbit.inclination_rad);
  const double z = radius_m * std::sin(argument_of_latitude) * std::sin(orbit.inclination_rad);
  return {x * std::cos(node_longitude) - y * std::sin(node_longitude),
          x * std::sin(node_longitude) + y * std::cos(node_longitude), z};
}

std::vector<OrbitingSatellite> gps_baseline() {
  KeplerElements shape;
  shape.reference = std::chrono::seconds(741484800);  // 1993-07-01 00:00 UTC
  shape.semi_major_axis_m = 26559.7e3;
  shape.inclination_rad = degrees_to_radians(55.0);
  shape.node_rate_radps = degrees_to_radians(-4.4874e-7);
  constexpr Slot kSlots[] = {
      {272.847, 268.126}, {272.847, 161.786}, {272.847, 11.676},  {272.847, 41.806},   // A1 to A4
      {332.847, 80.956},  {332.847, 173.336}, {332.847, 309.976}, {332.847, 204.376},  // B
      {32.847, 111.876},  {32.847, 11.796},   {32.847, 339.666},  {32.847, 241.556},   // C
      {92.847, 135.226},  {92.847, 265.446},  {92.847, 35.156},   {92.847, 167.356},   // D
      {152.847, 197.046}, {152.847, 302.596}, {152.847, 66.066},  {152.847, 333.686},  // E
      {212.847, 238.886}, {212.847, 345.226}, {212.847, 105.206}, {212.847, 135.346},  // F
  };
  std::vector<OrbitingSatellite> satellites;
  for (const Slot& slot : kSlots) {
    satellites.push_back(in_slot(Constellation::kGps, static_cast<int>(satellites.size()) + 1, shape, slot));
  }
  return satellites;
}

std::vector<OrbitingSatellite> galileo_reference() {
  KeplerElements shape;
  shape.reference = std::chrono::seconds(1479686400);  // 2016-11-21 00:00 UTC
  shape.semi_major_axis_m = 29599.8e3;
  shape.inclination_rad = degrees_to_radians(56.0);
  shape.node_rate_radps = degrees_to_radians(-0.02764398) / kDay_s;
  std::vector<OrbitingSatellite> satellites;
  for (int plane = 0; plane < 3; ++plane) {
    for (int place = 0; place < 8; ++place) {
      const Slot slot{317.632 + 120.0 * plane, 180.153 + 45.0 * place + 15.0 * plane};
      satellites.push_back(in_slot(Constellation::kGalileo, 8 * plane + place + 1, shape, slot));
    }
  }
  return satellites;
}

std::vector<OrbitingSatellite> glonass_nominal() {
  KeplerElements shape;
  shape.reference = std::chrono::seconds(410216400);  // 1983-01-01 00:00 Moscow time
  // The draconic period is given, from node to node; for a circle that counts as Kepler's.
  const double motion_radps = 2.0 * kPi / 40544.0;
  shape.semi_major_axis_m = std::cbrt(kGravitation_m3ps2 / (motion_radps * motion_radps));
  shape.inclination_rad = degrees_to_radians(64.8);
  shape.node_rate_radps = -0.00059251 / kDay_s;
  std::vector<OrbitingSatellite> satellites;
  for (int plane = 0; plane < 3; ++plane) {
    for (int place = 0; place < 8; ++place) {
      const Slot slot{251.25 + 120.0 * plane, 145.4436 + 15.0 * plane - 45.0 * place};
      satellites.push_back(in_slot(Constellation::kGlonass, 8 * plane + place + 1, shape, slot));
    }
  }
  return satellites;
}

void SkyParameters::check(std::vector<std::string>& faults) const {
  if (!gps && !galileo && !glonass) faults.push_back("gps = false: one of gps, galileo and glonass must be true");
  if (!gps && !almanac.empty()) faults.push_back("almanac = " + almanac + ": has no effect where gps = false");
}

Sky::Sky(const SkyParameters& parameters, const GeodeticPosition& datum, Stamp near, const std::string& directory)
    : elevation_mask_rad_(parameters.elevation_mask) {
  const std::vector<std::string> faults = position_faults(datum);
  if (!faults.empty()) throw std::invalid_argument("datum: " + faults.front());

  const auto add = [this](const std::vector<OrbitingSatellite>& more) {
    satellites_.insert(satellites_.end(), more.begin(), more.end());
  };
  if (parameters.gps) {
    add(parameters.almanac.empty() ? gps_baseline() : read_yuma_file(resolved(parameters.almanac, directory), near));
  }
  if (parameters.galileo) add(galileo_reference());
  if (parameters.glonass) add(glonass_nominal());
  std::sort(satellites_.begin(), satellites_.end(),
            [](const OrbitingSatellite& a, const OrbitingSatellite& b) { return a.id < b.id; });

  std::vector<double> ecef_from_enu(9);  // row-major
  GeographicLib::Geocentric::WGS84().Forward(datum.latitude_deg, datum.longitude_deg, datum.altitude_m, origin_m_.x(),
                                             origin_m_.y(), origin_m_.z(), ecef_from_enu);
  enu_from_ecef_ = Eigen::Map<const Eigen::Matrix3d>(ecef_from_enu.data());  // column-major: the transpose
}

std::vector<VisibleSatellite> Sky::above_horizon(Stamp utc) const {
  std::vector<VisibleSatellite> visible;
  above_horizon(utc, visible);
  return visible;
}

void Sky::above_horizon(Stamp utc, std::vector<VisibleSatellite>& visible) const {
  visible.clear();
  for (const OrbitingSatellite& satellite : satellites_) {
    const Eigen::Vector3d enu = enu_from_ecef_ * (ecef_position(satellite.orbit, utc) - origin_m_);
    const double elevation_rad = std::atan2(enu.z(), enu.head<2>().norm());
    if (elevation_rad < elevation_mask_rad_) continue;
    const double azimuth_rad = std::atan2(enu.x(), enu.y());
    visible.push_back({satellite.id, {azimuth_rad, elevation_rad}, enu.norm()});
  }
}

}  // namespace urban_gnss
