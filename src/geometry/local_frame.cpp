#include "urban_gnss_localization/geometry/local_frame.hpp"

#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>

namespace urban_gnss {
namespace {

constexpr double kMaxAltitude_m = 1e5;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::string fault(const char* field, double value, const char* unit, double limit) {
  std::ostringstream out;
  out.precision(12);
  out << field << " = " << value << ": must be at least " << -limit << " and at most " << limit << ' ' << unit;
  return out.str();
}

const GeodeticPosition& checked(const GeodeticPosition& datum) {
  std::string message;
  for (const std::string& sentence : position_faults(datum)) message += (message.empty() ? "" : "; ") + sentence;
  if (!message.empty()) throw std::invalid_argument("datum: " + message);
  return datum;
}

}  // namespace

// Comparisons with NaN are false, so that NaN is outside of every range.
bool is_latitude(double degrees) { return std::abs(degrees) <= 90.0; }
bool is_longitude(double degrees) { return std::abs(degrees) <= 180.0; }
bool is_altitude(double metres) { return std::abs(metres) <= kMaxAltitude_m; }

std::vector<std::string> position_faults(const GeodeticPosition& position) {
  std::vector<std::string> faults;
  if (!is_latitude(position.latitude_deg)) faults.push_back(fault("latitude", position.latitude_deg, "deg", 90.0));
  if (!is_longitude(position.longitude_deg)) faults.push_back(fault("longitude", position.longitude_deg, "deg", 180.0));
  if (!is_altitude(position.altitude_m)) faults.push_back(fault("altitude", position.altitude_m, "m", kMaxAltitude_m));
  return faults;
}

LocalFrame::LocalFrame(const GeodeticPosition& datum)
    : datum_(checked(datum)), converter_(datum.latitude_deg, datum.longitude_deg, datum.altitude_m) {}

Eigen::Vector3d LocalFrame::to_local(const GeodeticPosition& position) const {
  Eigen::Vector3d enu;
  converter_.Forward(position.latitude_deg, position.longitude_deg, position.altitude_m, enu.x(), enu.y(), enu.z());
  return enu.allFinite() ? enu : Eigen::Vector3d::Constant(kNaN);
}

GeodeticPosition LocalFrame::to_geodetic(const Eigen::Vector3d& enu) const {
  GeodeticPosition position;
  converter_.Reverse(enu.x(), enu.y(), enu.z(), position.latitude_deg, position.longitude_deg, position.altitude_m);
  const bool is_finite = std::isfinite(position.latitude_deg) && std::isfinite(position.longitude_deg) &&
                         std::isfinite(position.altitude_m);
  return is_finite ? position : GeodeticPosition{kNaN, kNaN, kNaN};
}

double LocalFrame::convergence_rad(const GeodeticPosition& position) const {
  if (!std::isfinite(position.latitude_deg) || !std::isfinite(position.longitude_deg)) return 0.0;
  double x, y, z;
  std::vector<double> rotation(9);  // of east, north, up at the place into the frame, row by row
  converter_.Forward(position.latitude_deg, position.longitude_deg, position.altitude_m, x, y, z, rotation);
  const double angle = std::atan2(rotation[3], rotation[0]);
  return std::isfinite(angle) ? angle : 0.0;
}

}  // namespace urban_gnss
