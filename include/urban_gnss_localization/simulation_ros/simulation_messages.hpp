#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <geometry_msgs/TwistWithCovarianceStamped.h>
#include <geometry_msgs/Vector3Stamped.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/Bool.h>
#include <tf2_msgs/TFMessage.h>
#include <urban_gnss_localization/SatelliteArray.h>
#include <urban_gnss_localization/SignalPathArray.h>

#include <string>
#include <variant>

#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/topics.hpp"
#include "urban_gnss_localization/simulation/simulator.hpp"

/// What a simulated sensor delivers, as messages: the same for the live node and for a generated bag.
namespace urban_gnss {

/// Frames of the simulated robot and of its sensors.
struct SimulationFrames {
  Frames base;
  std::string gps{"gps"};
  std::string imu{"imu_link"};
  std::string lidar{"lidar"};

  void visit(ParameterVisitor& v) {
    v.include(base);
    v("gps_frame", gps, "");
    v("imu_frame", imu, "");
    v("lidar_frame", lidar, "");
  }
  void check(std::vector<std::string>& faults) const;
};

nav_msgs::Odometry to_message(const OdometryEvent& event, const ros::Time& time, const Frames& frames);
nav_msgs::Odometry to_message(const TruthEvent& event, const ros::Time& time, const Frames& frames);
sensor_msgs::Imu to_message(const ImuMessage& imu, const ros::Time& time, const std::string& frame);
/// The k-th additional publisher's frame is `frame` with "_k" behind it. Without a fix the status says so and the
/// position is NaN. Without a declared covariance it is zero, of unknown type.
sensor_msgs::NavSatFix to_message(const FixEvent& event, const LocalFrame& local, const ros::Time& time,
                                  const std::string& frame);
/// Axes of the map frame. Requires a fix.
geometry_msgs::TwistWithCovarianceStamped to_velocity_message(const ReceiverFix& fix, const ros::Time& time,
                                                              const std::string& map_frame);
urban_gnss_localization::SatelliteArray to_message(const SatellitesEvent& event, const ros::Time& time,
                                                   const std::string& frame);
urban_gnss_localization::SignalPathArray to_message(const SignalsEvent& event, const ros::Time& time,
                                                    const std::string& map_frame);
geometry_msgs::Vector3Stamped to_message(const FixTruthEvent& event, const ros::Time& time,
                                         const std::string& map_frame);
/// Fields x, y, z (m), intensity (0 to 255), ring. Unordered.
sensor_msgs::PointCloud2 to_message(const LidarScan& scan, const ros::Time& time, const std::string& frame);

/// base_link to antenna and lidar (m), and to the IMU, which is in base_link's place.
tf2_msgs::TFMessage mounting_transforms(const Eigen::Vector3d& antenna, const Eigen::Vector3d& lidar,
                                        const ros::Time& time, const SimulationFrames& frames);

/// Calls write(topic, message) for every message that an event becomes.
template <class Write>
void write_messages(const SimulationEvent& event, const LocalFrame& local, const SimulationFrames& frames,
                    Write&& write) {
  const ros::Time time = to_ros(event.stamp);
  if (const auto* odometry = std::get_if<OdometryEvent>(&event.content)) {
    tf2_msgs::TFMessage transforms;
    transforms.transforms.push_back(to_transform(odometry->pose, time, frames.base.odom, frames.base.base_link));
    write("tf", transforms);
    write(topics::kOdometry, to_message(*odometry, time, frames.base));
  } else if (const auto* truth = std::get_if<TruthEvent>(&event.content)) {
    write(topics::kTruth, to_message(*truth, time, frames.base));
  } else if (const auto* imu = std::get_if<ImuMessage>(&event.content)) {
    write(topics::kImu, to_message(*imu, time, frames.imu));
  } else if (const auto* fix = std::get_if<FixEvent>(&event.content)) {
    write(topics::kFix, to_message(*fix, local, time, frames.gps));
    const ReceiverFix& solution = fix->published.fix;
    if (fix->published.publisher == 0 && fix->published.has_fix && solution.velocity_sigma_mps > 0.0) {
      write(topics::kVelocity, to_velocity_message(solution, time, frames.base.map));
    }
  } else if (const auto* satellites = std::get_if<SatellitesEvent>(&event.content)) {
    write(topics::kSatellites, to_message(*satellites, time, frames.gps));
  } else if (const auto* signals = std::get_if<SignalsEvent>(&event.content)) {
    write(topics::kTrueSignals, to_message(*signals, time, frames.base.map));
  } else if (const auto* error = std::get_if<FixTruthEvent>(&event.content)) {
    write(topics::kTrueFixError, to_message(*error, time, frames.base.map));
    if (error->in_shadow) {
      std_msgs::Bool shadow;
      shadow.data = *error->in_shadow;
      write(topics::kTrueShadow, shadow);
    }
  } else if (const auto* scan = std::get_if<LidarScan>(&event.content)) {
    write(topics::kPoints, to_message(*scan, time, frames.lidar));
  }
}

}  // namespace urban_gnss
