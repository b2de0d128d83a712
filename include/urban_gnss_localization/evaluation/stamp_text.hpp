#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "urban_gnss_localization/common/stamp.hpp"

namespace urban_gnss {

/// Seconds written in decimal ("457633.000", "1.4322354980393e9") as a stamp. The digits are read as an integer: a
/// double has no room for the nanoseconds of a Unix time. Digits beyond the nanosecond are rounded, halves away from
/// zero. Nothing where the text is no finite decimal number or exceeds 292 years.
std::optional<Stamp> parse_stamp(std::string_view text);

/// The stamp in seconds with exactly nine decimals, e.g. "457633.000000000".
std::string format_stamp(Stamp stamp);

}  // namespace urban_gnss
