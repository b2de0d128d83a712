#pragma once

#include "urban_gnss_localization/control/waypoint_controller.hpp"

namespace urban_gnss {

/// Parameters of waypoint_controller_node.
struct WaypointControllerNodeParameters {
  WaypointControllerParameters steering;
  int first_target{0};
  double estimate_timeout{0.5};

  void visit(ParameterVisitor& v) {
    v.include(steering);
    v.basic()("first_target", first_target, non_negative(), "", "index of the target to steer for first");
    v.basic()("estimate_timeout", estimate_timeout, positive(), "s",
              "wall time without an estimate after which the robot is stopped");
  }
};

}  // namespace urban_gnss
