#include "urban_gnss_localization/receivers/message_parts.hpp"

#include <cmath>

#include "urban_gnss_localization/geometry/angles.hpp"

namespace urban_gnss {

CovarianceType covariance_type_of(std::int64_t value) {
  switch (value) {
    case 1: return CovarianceType::kApproximated;
    case 2: return CovarianceType::kDiagonalKnown;
    case 3: return CovarianceType::kKnown;
    default: return CovarianceType::kUnknown;
  }
}

RawFix navsat_fix_of(const MessageView& message, Stamp stamp) {
  RawFix fix;
  fix.stamp = stamp;
  fix.has_fix = message.integer("status.status") >= 0;
  fix.position = {message.number("latitude"), message.number("longitude"), message.number("altitude")};
  const std::vector<double> covariance = message.numbers("position_covariance");
  const CovarianceType type = covariance_type_of(message.integer("position_covariance_type"));
  if (covariance.size() != 9 || covariance[0] == -1.0 || type == CovarianceType::kUnknown) return fix;
  fix.covariance = Eigen::Map<const Eigen::Matrix3d>(covariance.data()).transpose();
  fix.covariance_type = type;
  return fix;
}

RawVelocity velocity_of(const MessageView& message, Stamp stamp) {
  RawVelocity velocity;
  velocity.stamp = stamp;
  const bool has_covariance = message.has("twist.covariance");
  const std::string twist = has_covariance ? "twist.twist.linear." : "twist.linear.";
  velocity.velocity = {message.number(twist + "x"), message.number(twist + "y")};
  if (!has_covariance) return velocity;
  const std::vector<double> covariance = message.numbers("twist.covariance");
  if (covariance.size() != 36 || covariance[0] == -1.0) return velocity;
  velocity.covariance << covariance[0], covariance[1], covariance[6], covariance[7];
  return velocity;
}

LookAngles look_angles(double azimuth_deg, double elevation_deg) {
  constexpr double kFullTurn_deg = 360.0;
  if (!std::isfinite(azimuth_deg) || !(std::abs(elevation_deg) <= 90.0)) {
    return {SatelliteObservation::kUnknown, SatelliteObservation::kUnknown};
  }
  const double azimuth = azimuth_deg - kFullTurn_deg * std::floor(azimuth_deg / kFullTurn_deg);
  return {degrees_to_radians(azimuth), degrees_to_radians(elevation_deg)};
}

double cn0_or_unknown(double cn0_dbhz) { return cn0_dbhz > 0.0 ? cn0_dbhz : SatelliteObservation::kUnknown; }

double whole_degrees_rad() { return degrees_to_radians(1.0); }

}  // namespace urban_gnss
