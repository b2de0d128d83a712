#pragma once

#include <cstdint>
#include <optional>

#include "urban_gnss_localization/gnss/satellite.hpp"

/// How drivers number satellites. Nothing for a number that no satellite has.
namespace urban_gnss {

/// gpsd: the ranges that systems share in NMEA 0183 (nmea_satellite_id()).
std::optional<SatelliteId> satellite_of_gpsd(int number);

/// u-blox up to protocol 13 (NAV-SVINFO): 65 is GLONASS 1, 211 Galileo 1, 159 BeiDou 1, 33 BeiDou 6.
std::optional<SatelliteId> satellite_of_ublox_svinfo(int number);

/// Septentrio's SBF blocks (SVID): 38 is GLONASS 1, 71 Galileo 1, 141 BeiDou 1.
std::optional<SatelliteId> satellite_of_septentrio(int number);

/// NovAtel's logs: the PRN (38 is GLONASS 1), and the system in bits 16 to 18 of the channel's tracking status.
std::optional<SatelliteId> satellite_of_novatel(int prn, std::uint32_t tracking_status);

}  // namespace urban_gnss
