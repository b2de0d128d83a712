#include "urban_gnss_localization/control/waypoint_controller.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {

void WaypointControllerParameters::check(std::vector<std::string>& faults) const {
  if (targets.size() % 2 != 0) {
    faults.push_back("targets: has " + std::to_string(targets.size()) + " numbers; must be x and y of each target");
  }
}

std::vector<Eigen::Vector2d> WaypointControllerParameters::target_points() const {
  std::vector<Eigen::Vector2d> points;
  for (std::size_t i = 0; i + 1 < targets.size(); i += 2) points.emplace_back(targets[i], targets[i + 1]);
  return points;
}

WaypointController::WaypointController(const WaypointControllerParameters& parameters, std::size_t first_target)
    : parameters_(parameters),
      targets_(parameters.target_points()),
      current_(targets_.empty() ? 0 : first_target % targets_.size()) {}

bool WaypointController::finished() const {
  return targets_.empty() ||
         (parameters_.laps > 0 && reached_ >= static_cast<std::size_t>(parameters_.laps) * targets_.size());
}

BicycleInput WaypointController::steer(const Pose2& estimate) {
  if (finished()) return {};
  if ((targets_[current_] - estimate.position()).norm() <= parameters_.switch_distance) {
    current_ = (current_ + 1) % targets_.size();
    ++reached_;
    if (finished()) return {};
  }
  const Eigen::Vector2d way = targets_[current_] - estimate.position();
  const double bearing = std::atan2(way.y(), way.x());                                          // (38)
  const double steering = parameters_.steering_gain * angle_difference(bearing, estimate.yaw);  // (36)
  return {parameters_.speed, std::clamp(steering, -parameters_.max_steering, parameters_.max_steering)};
}

}  // namespace urban_gnss
