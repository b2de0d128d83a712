#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "urban_gnss_localization/common/stamp.hpp"

/// The fields of NMEA sentences. Each function gives nothing where the field is empty, is no such thing, or is out of
/// its range; none throws.
namespace urban_gnss {

/// A decimal number: sign, digits, point. No exponents, no infinities.
std::optional<double> to_number(std::string_view field);

/// A whole number of at most nine digits, not negative.
std::optional<int> to_count(std::string_view field);

/// hhmmss with decimals, as time since midnight. A leap second is 23:59:60.
std::optional<Stamp> to_time_of_day(std::string_view field);

/// Days since 1970-01-01.
using Day = std::int32_t;

/// Requires nothing: a date that no calendar has gives nothing. Years 1970 to 2200.
std::optional<Day> to_day(int year, int month, int day);
/// ddmmyy of sentence RMC; years 1980 to 2079.
std::optional<Day> to_day(std::string_view ddmmyy);

/// ddmm.mmmm and N or S, in degrees, north positive.
std::optional<double> to_latitude_deg(std::string_view field, std::string_view hemisphere);
/// dddmm.mmmm and E or W, in degrees, east positive.
std::optional<double> to_longitude_deg(std::string_view field, std::string_view hemisphere);

}  // namespace urban_gnss
