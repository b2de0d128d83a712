#pragma once

#include <Eigen/Core>
#include <deque>
#include <optional>

#include "urban_gnss_localization/motion/odometry_history.hpp"
#include "urban_gnss_localization/pipeline/speed_source.hpp"

namespace urban_gnss {

/// The forward speed of the robot by two fixes some seconds apart, for a receiver that publishes no velocity. A
/// reflection moves fixes in any direction, wheels err along the track only. So what the fixes move sideways is their
/// error, and its largest of the last time says how little they can tell of the speed.
class FixSpeed {
 public:
  /// A fix (m, map frame) of the antenna (m, in the base frame); `path` holds its stamp, and is turned by
  /// `path_yaw_rad` in the map. Where that is not known, neither is the direction of the speed. Nothing where the last
  /// fixes are too close together or too far apart, or the robot has turned between them. Stamps ascend.
  std::optional<ReceiverSpeed> add(Stamp stamp, const Eigen::Vector2d& position, const OdometryHistory& path,
                                   std::optional<double> path_yaw_rad, const Eigen::Vector2d& antenna);

 private:
  struct Place {
    Stamp stamp;
    Eigen::Vector2d base;  ///< m, map frame
    double yaw_rad;        ///< in the map, or of the path
  };
  /// m/s per axis, with what the fixes have just moved sideways.
  double sigma_of(double sideways_mps, Stamp stamp);

  std::deque<Place> places_;
  double sideways_mps_{0.0};  ///< largest, that fades
  std::optional<Stamp> sideways_at_;
};

}  // namespace urban_gnss
