#pragma once

#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"

namespace urban_gnss {

struct WaypointControllerParameters {
  double speed{1.0};            ///< m/s, constant, eq. (37)
  double steering_gain{0.8};    ///< k_phi
  double max_steering{1.2};     ///< rad
  double wheelbase{1.0};        ///< m, turns the steering angle into the yaw rate of cmd_vel
  double switch_distance{0.5};  ///< m, between the estimate and a target, at which the next target becomes current
  int laps{0};                  ///< rounds over all targets after which it stops; 0 goes on for ever
  std::vector<double> targets;  ///< m, x and y of each target in turn, map frame

  template <class V>
  void visit(V& v) {
    v("speed", speed, positive());
    v("steering_gain", steering_gain, positive());
    v("max_steering", max_steering, Range{0.0, 1.5, true});
    v("wheelbase", wheelbase, positive());
    v("switch_distance", switch_distance, positive());
    v("laps", laps, non_negative());
    v("targets", targets);
  }
  void check(std::vector<std::string>& faults) const;

  std::vector<Eigen::Vector2d> target_points() const;
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
