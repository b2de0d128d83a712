#pragma once

#include "urban_gnss_localization/ros/comparison_node_parameters.hpp"
#include "urban_gnss_localization/ros/gps_bias_node_parameters.hpp"
#include "urban_gnss_localization/ros/gpsd_node_parameters.hpp"
#include "urban_gnss_localization/ros/occlusion_node.hpp"
#include "urban_gnss_localization/ros/receiver_node_parameters.hpp"
#include "urban_gnss_localization/ros/waypoint_controller_node_parameters.hpp"

namespace urban_gnss {

/// Calls use(name, what it does, what it reads, with the defaults) for each node with parameters that is no localizer.
template <class Use>
void for_each_other_node(Use use) {
  use("gps_bias",
      "The bias filter of Nishida et al. What it shares with the localizer has the same name and place there.",
      GpsBiasNodeParameters());
  use("occlusion", "Covariances of fixes by ray traces to the satellites, Maier and Kleiner.", OcclusionNodeSettings());
  use("waypoint_controller", "The steering law of Nishida et al., eq. (36) to (38).",
      WaypointControllerNodeParameters());
  use("comparison", "Plots the errors of several localizers, where there is a ground truth (comparison.launch).",
      ComparisonNodeParameters());
  use("receiver", "Fixes, velocities and satellites from the messages of a receiver's driver (docs/receivers.md).",
      ReceiverNodeParameters());
  use("gpsd", "Fixes, velocities and satellites from gpsd (docs/receivers/gpsd.md).", GpsdNodeParameters());
}

}  // namespace urban_gnss
