#pragma once

#include <Eigen/Core>
#include <optional>
#include <variant>
#include <vector>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/geometry/pose2.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"
#include "urban_gnss_localization/simulation/fix_faults.hpp"
#include "urban_gnss_localization/simulation/imu_sensor.hpp"
#include "urban_gnss_localization/simulation/lidar.hpp"
#include "urban_gnss_localization/simulation/receiver.hpp"

namespace urban_gnss {

/// Wheel odometry.
struct OdometryEvent {
  Pose2 pose;  ///< in the odom frame
  Twist2 twist;
  double speed_variance{0.0};     ///< (m/s)^2
  double yaw_rate_variance{0.0};  ///< (rad/s)^2
};

/// A fix on the topic, also one that says that there is none.
struct FixEvent {
  PublishedFix published;
  int used_count{0};
};

struct SatellitesEvent {
  std::vector<SatelliteReport> satellites;
  double angle_resolution_rad{0.0};
};

/// base_link, in the map frame.
struct TruthEvent {
  Pose2 pose;
  Twist2 twist;
};

/// What is wrong with the receiver's fix.
struct FixTruthEvent {
  Eigen::Vector3d error{Eigen::Vector3d::Zero()};  ///< m, east, north, up: fix minus antenna at the fix's stamp
  std::optional<bool> in_shadow;                   ///< of the paper's field, which has nothing but a shadow
};

/// How the signals truly arrive, one for each satellite above the horizon.
struct SignalTruth {
  SatelliteReport report;
  LookAngles look;  ///< not rounded
  bool has_line_of_sight{false};
  std::vector<Eigen::Vector3d> path;  ///< m, map frame: antenna, then the points where the tracked signal is turned
};
struct SignalsEvent {
  std::vector<SignalTruth> signals;
};

/// Something that happened in the simulated world and is published.
struct SimulationEvent {
  Stamp stamp{0};      ///< of the measurement
  Stamp published{0};  ///< when it leaves the sensor, not before `stamp`
  std::variant<TruthEvent, OdometryEvent, ImuMessage, SatellitesEvent, FixEvent, FixTruthEvent, SignalsEvent, LidarScan>
      content;
};

/// A simulated world with one robot in it.
class Simulator {
 public:
  virtual ~Simulator() = default;

  /// Advances by one step; the robot follows `command` or, where there is none, drives its route by itself, on its true
  /// pose. Appends the events that are published up to the new time, in the order of their publication.
  virtual void step(const std::optional<Twist2>& command, std::vector<SimulationEvent>& events) = 0;

  virtual double interval_s() const = 0;
  virtual Stamp now() const = 0;
  virtual const Pose2& truth() const = 0;
  /// Share of the route (or of the duration) that is done, 0 to 1.
  virtual double progress() const = 0;
  virtual bool is_finished() const = 0;
};

}  // namespace urban_gnss
