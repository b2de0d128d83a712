#pragma once

#include <sensor_msgs/Image.h>

#include <string>
#include <vector>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/evaluation/trajectory_errors.hpp"
#include "urban_gnss_localization/ros/marker_parts.hpp"

namespace urban_gnss {

struct ErrorCurve {
  std::string name;
  Colour colour;
  TrajectoryErrors errors;
};

/// Horizontal errors (m, logarithmic axis) over the time until `now` (s), `window` wide, with the root mean square and
/// the 95 % of each below. A curve is broken where it has no sample for 2 s.
sensor_msgs::Image error_plot(const std::vector<ErrorCurve>& curves, Stamp now, Stamp window, int width, int height);

}  // namespace urban_gnss
