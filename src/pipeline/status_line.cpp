#include "urban_gnss_localization/pipeline/status_line.hpp"

#include <cmath>
#include <iomanip>
#include <sstream>

namespace urban_gnss {
namespace {

const char* name_of(StatusLevel level) {
  switch (level) {
    case StatusLevel::kOk: return "OK";
    case StatusLevel::kWarn: return "WARN";
    case StatusLevel::kError: return "ERROR";
  }
  return "?";
}

}  // namespace

StatusLevel level_of(const LocalizationReport& report) {
  if (report.state == LocalizationState::kLost) return StatusLevel::kError;
  return report.healthy && !report.is_gate_inert ? StatusLevel::kOk : StatusLevel::kWarn;
}

std::string status_line(const LocalizationReport& report) {
  std::ostringstream line;
  line << name_of(level_of(report)) << ": ";
  if (!report.reason.empty()) line << report.reason << "; ";
  if (std::isfinite(report.position_sigma_m)) {
    line << std::fixed << std::setprecision(report.position_sigma_m < 10.0 ? 1 : 0) << report.position_sigma_m
         << " m, ";
  }
  const std::uint64_t examined = report.fixes_used + report.fixes_rejected;
  if (examined == 0 && report.last_fix.stamp != Stamp(0)) {
    line << "fixes come, none was examined yet";
  } else {
    line << report.fixes_used << " of " << examined << " fixes used";
  }
  return line.str();
}

}  // namespace urban_gnss
