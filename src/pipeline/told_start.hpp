#pragma once

#include <string>

#include "urban_gnss_localization/pipeline/start_supervisor.hpp"

namespace urban_gnss {

/// A start at a pose that somebody has set.
inline Start told(const PoseEstimate& pose, const std::string& source) {
  Start start;
  start.estimate = pose;
  start.source = source;
  start.is_told = true;
  return start;
}

}  // namespace urban_gnss
