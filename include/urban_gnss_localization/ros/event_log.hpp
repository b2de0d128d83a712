#pragma once

#include <vector>

#include "urban_gnss_localization/pipeline/stamp_monitor.hpp"

namespace urban_gnss {

/// Says on the console what happened; the same warning at most once in five seconds, with the count of those left out.
void log_events(const std::vector<PipelineEvent>& events);

}  // namespace urban_gnss
