#include "urban_gnss_localization/control/waypoint_controller.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace urban_gnss {

void WaypointControllerParameters::check(std::vector<std::string>& faults) const {
  if (targets.size() % 2 != 0) {
    faults.push_back("targets: has " + std::to_string(targets.size()) + " numbers; must be x and y of each target");
  }
  if (geographic.size() % 2 != 0) {
    faults.push_back("geographic: has " + std::to_string(geographic.size()) +
                     " numbers; must be latitude and longitude of each target");
  }
  for (std::size_t i = 0; i + 1 < geographic.size(); i += 2) {
    for (const std::string& fault : position_faults({geographic[i], geographic[i + 1], 0.0})) {
      faults.push_back("geographic: target " + std::to_string(i / 2) + ": " + fault);
    }
  }
  if (!targets.empty() && !geographic.empty()) {
    faults.push_back("geographic: there are targets in the map frame, too; give all as targets or all as geographic");
  }
}

WaypointControllerParameters WaypointControllerParameters::in_map(const LocalFrame& map) const {
  WaypointControllerParameters in_map = *this;
  in_map.targets.clear();
  in_map.geographic.clear();
  for (std::size_t i = 0; i + 1 < geographic.size(); i += 2) {
    const Eigen::Vector3d point = map.to_local({geographic[i], geographic[i + 1], map.datum().altitude_m});
    if (!(point.norm() <= kFarthestTarget_m)) {
      std::ostringstream out;
      out << "geographic: target " << i / 2 << " is " << std::round(1e-3 * point.norm()) << " km from the datum";
      throw std::runtime_error(out.str());
    }
    in_map.targets.insert(in_map.targets.end(), {point.x(), point.y()});
  }
  return in_map;
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
