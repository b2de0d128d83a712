#pragma once

#include <string>
#include <vector>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/geometry/pose2.hpp"
#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/simulation/compass.hpp"
#include "urban_gnss_localization/simulation/constellation.hpp"
#include "urban_gnss_localization/simulation/fix_faults.hpp"
#include "urban_gnss_localization/simulation/imu_sensor.hpp"
#include "urban_gnss_localization/simulation/lidar.hpp"
#include "urban_gnss_localization/simulation/obstacles.hpp"
#include "urban_gnss_localization/simulation/receiver.hpp"
#include "urban_gnss_localization/simulation/route.hpp"
#include "urban_gnss_localization/simulation/signal_paths.hpp"
#include "urban_gnss_localization/simulation/vehicle.hpp"
#include "urban_gnss_localization/simulation/wheel_odometry.hpp"
#include "urban_gnss_localization/simulation/world.hpp"

namespace urban_gnss {

/// A city to drive through: what a scenario file says (docs/simulator.md has the schema).
struct Scenario {
  std::string file;  ///< where it was read from
  GeodeticPosition datum;
  Stamp start_time{0};  ///< UTC, ns since 1970-01-01
  int seed{1};
  double duration_s{0.0};  ///< 0: until the route ends
  World world;
  Route route;
  Pose2 start;
  std::vector<CarParameters> cars;
  VehicleParameters vehicle;
  RouteFollowerParameters autopilot;
  WheelOdometryParameters odometry;
  ImuParameters imu;
  CompassParameters compass;
  SkyParameters sky;
  SignalParameters signals;
  ReceiverParameters receiver;
  LidarParameters lidar;
  std::vector<FixFault> faults;
};

/// Reads a scenario. `overrides` are texts "section.name=value" or "name=value" that are put over the file's.
/// Throws std::runtime_error where the file cannot be read or is no YAML, ParameterError with every fault, each with
/// its file and line, where it is no scenario that can be driven.
Scenario load_scenario(const std::string& file, const std::vector<std::string>& overrides = {});

/// "2026-05-04T09:30:00Z" as ns since 1970-01-01 UTC. Throws std::invalid_argument for anything else.
Stamp parse_utc(const std::string& text);

}  // namespace urban_gnss
