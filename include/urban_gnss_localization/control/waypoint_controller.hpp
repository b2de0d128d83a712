#pragma once

#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"

namespace urban_gnss {

struct WaypointControllerParameters {
  double speed{1.0};
  double steering_gain{0.8};
  double max_steering{1.2};
  double wheelbase{1.0};
  double switch_distance{0.5};
  int laps{0};
  std::vector<double> targets;
  std::vector<double> geographic;

  void visit(ParameterVisitor& v) {
    v.basic()("speed", speed, positive(), "m/s", "constant speed v, eq. (37)");
    v.basic()("steering_gain", steering_gain, positive(), "",
              "steering gain k_phi, eq. (36): steering angle per angle from heading to bearing, eq. (38)");
    v.basic()("max_steering", max_steering, open_between(0.0, 1.5), "rad", "limit of the steering angle");
    v.basic()("wheelbase", wheelbase, positive(), "m",
              "wheelbase l, eq. (4), which turns the steering angle into the yaw rate of cmd_vel");
    v.basic()("switch_distance", switch_distance, positive(), "m",
              "distance from estimate to target at which the next target becomes current");
    v.basic()("laps", laps, non_negative(), "", "number of laps after which the robot stops; 0: never");
    v.basic()("targets", targets, "m", "targets x1, y1, x2, y2, ... in the map frame; empty: the robot stands");
    v.basic()("geographic", geographic, "deg",
              "targets as latitude and longitude, [[48.1, 11.5], ...], in place of `targets`; they wait for gps/datum");
  }
  void check(std::vector<std::string>& faults) const;

  /// `targets` as points (m).
  std::vector<Eigen::Vector2d> target_points() const;
  /// The same with `geographic` as `targets`, on the ground at the datum's altitude. Throws std::runtime_error where
  /// one is farther from the datum than kFarthestTarget_m, which a robot does not drive. Requires parameters without
  /// faults.
  WaypointControllerParameters in_map(const LocalFrame& map) const;
  static constexpr double kFarthestTarget_m = 1e5;
};

/// Nishida et al. eq. (36)-(38): steers for one target after the other on the estimated pose. In (36) the bearing is
/// compared with the heading; the printed steering angle does not close the loop.
class WaypointController {
 public:
  /// `first_target` is the index of the target to steer for first.
  explicit WaypointController(const WaypointControllerParameters& parameters, std::size_t first_target = 0);

  /// The input for the next step; speed 0 once the laps are done. Without targets the speed is 0.
  BicycleInput steer(const Pose2& estimate);

  std::size_t current_target() const { return current_; }
  std::size_t targets_reached() const { return reached_; }
  bool finished() const;
  const std::vector<Eigen::Vector2d>& targets() const { return targets_; }

 private:
  WaypointControllerParameters parameters_;
  std::vector<Eigen::Vector2d> targets_;
  std::size_t current_;
  std::size_t reached_{0};
};

}  // namespace urban_gnss
