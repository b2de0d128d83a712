#pragma once

#include <cstdint>
#include <string>

#include "urban_gnss_localization/pipeline/status_reporter.hpp"

namespace urban_gnss {

/// How much a user must care. The values are those of diagnostic_msgs/DiagnosticStatus.
enum class StatusLevel : std::uint8_t { kOk = 0, kWarn = 1, kError = 2 };

StatusLevel level_of(const LocalizationReport& report);

/// A localizer in a line: "OK: 1.2 m, 34 of 35 fixes used", or "WARN: no fix was used for 12 s; 4.1 m, 34 of 60 fixes
/// used". The metres are its position's standard deviation, along the worse direction.
std::string status_line(const LocalizationReport& report);

}  // namespace urban_gnss
