#pragma once

#include <cmath>
#include <string>

#include "urban_gnss_localization/common/positive_definite.hpp"
#include "urban_gnss_localization/receivers/receiver_output.hpp"

namespace urban_gnss {

/// What is not finite although it must be, of what a decoder gives; empty where all is well.
inline std::string fault_of_numbers(const ReceiverOutput& output) {
  for (const RawFix& fix : output.fixes) {
    const GeodeticPosition& at = fix.position;
    if (fix.has_fix && !(std::isfinite(at.latitude_deg) && std::isfinite(at.longitude_deg))) return "a fix nowhere";
    if (std::isinf(at.altitude_m)) return "an infinite altitude";
    if (!fix.covariance.allFinite()) return "a fix's covariance that is not finite";
  }
  for (const RawVelocity& velocity : output.velocities) {
    if (!velocity.velocity.allFinite()) return "a velocity that is not finite";
    if (!velocity.covariance.allFinite()) return "a velocity's covariance that is not finite";
  }
  for (const SatelliteEpoch& epoch : output.satellites) {
    if (!std::isfinite(epoch.angle_resolution_rad)) return "a resolution of angles that is not finite";
    for (const SatelliteObservation& satellite : epoch.satellites) {
      if (std::isinf(satellite.look.azimuth_rad) || std::isinf(satellite.look.elevation_rad))
        return "an infinite angle";
      if (std::isinf(satellite.residual_m)) return "an infinite residual";
    }
  }
  return {};
}

/// The same, and what is no place, no speed of a vehicle, or no satellite: of decoders that judge what they read.
inline std::string fault_of(const ReceiverOutput& output) {
  for (const RawFix& fix : output.fixes) {
    const GeodeticPosition& at = fix.position;
    const bool is_place = std::abs(at.latitude_deg) <= 90.0 && std::abs(at.longitude_deg) <= 180.0;
    if (fix.has_fix && !is_place) return "a fix nowhere";
    if (fix.covariance_type != CovarianceType::kUnknown && !is_positive_definite<3>(fix.covariance)) {
      return "a fix's covariance that is none";
    }
  }
  for (const RawVelocity& velocity : output.velocities) {
    if (!(velocity.velocity.norm() <= 600.1)) return "a velocity of more than 600 m/s";
  }
  for (const SatelliteEpoch& epoch : output.satellites) {
    for (const SatelliteObservation& satellite : epoch.satellites) {
      if (satellite.id.svid <= 0) return "a satellite without a number";
      if (satellite.cn0_dbhz <= 0.0 || satellite.cn0_dbhz > 99.0) return "a C/N0 out of range";
    }
  }
  return fault_of_numbers(output);
}

}  // namespace urban_gnss
