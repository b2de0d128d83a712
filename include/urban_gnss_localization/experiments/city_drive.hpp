#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <optional>
#include <vector>

#include "urban_gnss_localization/evaluation/trajectory.hpp"
#include "urban_gnss_localization/gnss/gnss_covariance.hpp"
#include "urban_gnss_localization/motion/imu_heading.hpp"
#include "urban_gnss_localization/motion/odometry_history.hpp"
#include "urban_gnss_localization/occlusion/point_cloud.hpp"
#include "urban_gnss_localization/simulation/receiver.hpp"
#include "urban_gnss_localization/simulation/scenario.hpp"

namespace urban_gnss {

/// Everything of one epoch of the receiver, with the truth about it.
struct DriveEpoch {
  Stamp stamp{0};
  std::optional<ReceiverFix> fix;                    ///< nothing: none, or no position in it
  Eigen::Vector2d error_m{Eigen::Vector2d::Zero()};  ///< truth: east, north, of the fix
  std::vector<SatelliteObservation> satellites;
  double angle_resolution_rad{0.0};
  std::vector<bool> has_line_of_sight;  ///< truth, of each satellite
};

/// Someone who takes part in a simulated drive. All participants are told the same, in the same order.
class DriveParticipant {
 public:
  virtual ~DriveParticipant() = default;
  virtual bool wants_clouds() const = 0;
  virtual void add_imu_yaw_rate(Stamp, double /*radps*/) {}
  virtual void add_imu_heading(const HeadingSample& /*heading*/) {}
  virtual void add_odometry(const OdometrySample& sample) = 0;
  /// A lidar's cloud (m, sensor frame), and where the base was in the odometry frame at its stamp.
  virtual void add_cloud(Stamp stamp, const PointCloud& cloud, const Eigen::Isometry3d& sensor_in_base,
                         const Pose2& base_in_odom) = 0;
  /// An epoch, once odometry has reached it, and where the base was in the odometry frame.
  virtual void add_epoch(const DriveEpoch& epoch, const Pose2& base_in_odom) = 0;
};

/// What a drive leaves behind.
struct DriveRecord {
  Trajectory truth;     ///< base_link, map frame
  Trajectory odometry;  ///< base_link, odometry frame
};

/// Drives the scenario to its end. Of a spinning lidar's scans one in `cloud_every` is passed on; where nobody wants
/// clouds there is no lidar. `on_progress` is told the share done, 0 to 1. Throws what CitySimulator throws.
DriveRecord drive_city(Scenario scenario, int cloud_every, const std::vector<DriveParticipant*>& participants,
                       const std::function<void(double)>& on_progress);

}  // namespace urban_gnss
