#pragma once

#include <istream>
#include <string>
#include <vector>

#include "urban_gnss_localization/simulation/constellation.hpp"

namespace urban_gnss {

/// GPS time is ahead of UTC by the leap seconds since 1980: 18 s since 2017, which is used for every date. In earlier
/// years the error is up to 18 s, in which the Earth turns by 0.075 deg.
inline constexpr double kGpsMinusUtc_s = 18.0;

/// Reads a YUMA almanac (US Coast Guard Navigation Center, "YUMA Almanac description"): blocks of `name: value` lines
/// under a heading of asterisks. GPS satellites with health 0, in the file's order; the others are left out.
///
/// A week below 1024 is taken to be the one of its era that is nearest to `near` (UTC); a larger one is taken as it is.
/// Throws std::runtime_error, "name:line: reason", for a line that is no field, a value that is no number or that no
/// GPS orbit has, a field or block that comes twice, a field that is missing (with the line of the block's heading),
/// and text without a block. Clock terms (Af0, Af1) may be missing; they are not used.
std::vector<OrbitingSatellite> read_yuma(std::istream& text, const std::string& name, Stamp near);

/// The same from a file; std::runtime_error where it cannot be read.
std::vector<OrbitingSatellite> read_yuma_file(const std::string& path, Stamp near);

}  // namespace urban_gnss
