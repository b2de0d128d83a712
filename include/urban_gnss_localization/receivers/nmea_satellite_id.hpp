#pragma once

#include <optional>
#include <string_view>

#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

/// The system whose satellites a sentence lists: by the system id of NMEA 4.10 and later (1 GPS, 2 GLONASS, 3 Galileo,
/// 4 BeiDou, 5 QZSS, 6 NavIC), else by its talker (GP, GL, GA, GB and BD, GQ and QZ, GI; PQ is Quectel's name for
/// BeiDou). kUnknown for GN, and for every other: the numbers tell it then.
Constellation nmea_system(std::string_view talker, std::string_view system_id);

/// The satellite that has this number in a sentence of a system. Both ways of counting are known, from 1 within the
/// system and in ranges that the systems share, the standard's and those of receivers:
///
///   1-32 GPS · 33-64 and 120-158 SBAS · 65-99 GLONASS · 173-182 IMES · 193-200 QZSS · 201-263 and 401-463 BeiDou ·
///   301-336 Galileo · 500-514 NavIC
///
/// svid as u-blox and gpsd count: SBAS from 120, all others from 1. Nothing for a number that no system has.
std::optional<SatelliteId> nmea_satellite_id(Constellation system, int number);

}  // namespace urban_gnss
