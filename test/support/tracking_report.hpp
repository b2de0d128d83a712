#pragma once

#include "urban_gnss_localization/pipeline/status_reporter.hpp"

namespace urban_gnss {

/// Of a localizer that is well: 1.24 m, 34 of 35 fixes used.
inline LocalizationReport tracking_report() {
  LocalizationReport report;
  report.state = LocalizationState::kTracking;
  report.healthy = true;
  report.position_sigma_m = 1.24;
  report.fixes_used = 34;
  report.fixes_rejected = 1;
  return report;
}

}  // namespace urban_gnss
