#include "urban_gnss_localization/simulation_ros/simulation_messages.hpp"

#include <sensor_msgs/point_cloud2_iterator.h>

#include <cmath>
#include <limits>

#include "urban_gnss_localization/ros/marker_parts.hpp"

namespace urban_gnss {
namespace {

namespace msgs = urban_gnss_localization;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

nav_msgs::Odometry odometry(const Pose2& pose, const Twist2& twist, const ros::Time& time, const std::string& frame,
                            const std::string& child_frame) {
  nav_msgs::Odometry message;
  message.header.stamp = time;
  message.header.frame_id = frame;
  message.child_frame_id = child_frame;
  message.pose.pose = to_message(pose);
  message.twist.twist.linear.x = twist.speed_mps;
  message.twist.twist.angular.z = twist.yaw_rate_radps;
  return message;
}

geometry_msgs::Vector3 to_vector(const Eigen::Vector3d& vector) {
  geometry_msgs::Vector3 message;
  message.x = vector.x();
  message.y = vector.y();
  message.z = vector.z();
  return message;
}

/// [0, 2 pi), as Satellite.msg wants it.
float azimuth(const LookAngles& look) {
  return static_cast<float>(look.azimuth_rad - 2.0 * kPi * std::floor(look.azimuth_rad / (2.0 * kPi)));
}

std::uint8_t path_class(PathClass value) {
  switch (value) {
    case PathClass::kDirect: return msgs::SignalPath::DIRECT;
    case PathClass::kMultipath: return msgs::SignalPath::MULTIPATH;
    case PathClass::kNlos: return msgs::SignalPath::NLOS;
    case PathClass::kBlocked: break;
  }
  return msgs::SignalPath::BLOCKED;
}

}  // namespace

void SimulationFrames::check(std::vector<std::string>& faults) const {
  if (gps.empty()) faults.push_back("gps_frame: must not be empty");
  if (imu.empty()) faults.push_back("imu_frame: must not be empty");
  if (lidar.empty()) faults.push_back("lidar_frame: must not be empty");
}

nav_msgs::Odometry to_message(const OdometryEvent& event, const ros::Time& time, const Frames& frames) {
  nav_msgs::Odometry message = odometry(event.pose, event.twist, time, frames.odom, frames.base_link);
  message.twist.covariance[0] = event.speed_variance;
  message.twist.covariance[35] = event.yaw_rate_variance;
  return message;
}

nav_msgs::Odometry to_message(const TruthEvent& event, const ros::Time& time, const Frames& frames) {
  return odometry(event.pose, event.twist, time, frames.map, frames.base_link);
}

sensor_msgs::Imu to_message(const ImuMessage& imu, const ros::Time& time, const std::string& frame) {
  sensor_msgs::Imu message;
  message.header.stamp = time;
  message.header.frame_id = frame;
  message.orientation = to_message(Pose2{0.0, 0.0, imu.yaw_rad.value_or(0.0)}).orientation;
  if (imu.yaw_rad) {
    message.orientation_covariance[8] = imu.yaw_variance;  // roll and pitch are 0, exactly
  } else {
    message.orientation_covariance[0] = -1.0;  // sensor_msgs/Imu: no orientation
  }
  message.angular_velocity = to_vector(imu.angular_velocity_radps);
  message.linear_acceleration = to_vector(imu.acceleration_mps2);
  for (const std::size_t axis : {0U, 4U, 8U}) {
    message.angular_velocity_covariance[axis] = imu.angular_velocity_variance;
    message.linear_acceleration_covariance[axis] = imu.acceleration_variance;
  }
  return message;
}

sensor_msgs::NavSatFix to_message(const FixEvent& event, const LocalFrame& local, const ros::Time& time,
                                  const std::string& frame) {
  const PublishedFix& published = event.published;
  const std::string name = published.publisher == 0 ? frame : frame + "_" + std::to_string(published.publisher);
  if (!published.has_fix) {
    sensor_msgs::NavSatFix message = to_message({kNaN, kNaN, kNaN}, time, name);
    message.status.status = sensor_msgs::NavSatStatus::STATUS_NO_FIX;
    return message;
  }
  sensor_msgs::NavSatFix message = to_message(local.to_geodetic(published.fix.position), time, name);
  if (published.fix.covariance_type == CovarianceType::kUnknown) {
    message.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN;
    return message;
  }
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      message.position_covariance[static_cast<std::size_t>(3 * row + column)] = published.fix.covariance(row, column);
    }
  }
  message.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_APPROXIMATED;
  return message;
}

geometry_msgs::TwistWithCovarianceStamped to_velocity_message(const ReceiverFix& fix, const ros::Time& time,
                                                              const std::string& map_frame) {
  geometry_msgs::TwistWithCovarianceStamped message;
  message.header.stamp = time;
  message.header.frame_id = map_frame;
  message.twist.twist.linear = to_vector(fix.velocity);
  for (const std::size_t axis : {0U, 7U, 14U}) message.twist.covariance[axis] = std::pow(fix.velocity_sigma_mps, 2);
  return message;
}

msgs::SatelliteArray to_message(const SatellitesEvent& event, const ros::Time& time, const std::string& frame) {
  msgs::SatelliteArray message;
  message.header.stamp = time;
  message.header.frame_id = frame;
  message.angle_resolution = static_cast<float>(event.angle_resolution_rad);
  for (const SatelliteReport& report : event.satellites) {
    msgs::Satellite satellite;
    satellite.constellation = static_cast<std::uint8_t>(report.id.constellation);
    satellite.svid = static_cast<std::uint16_t>(report.id.svid);
    satellite.name = satellite_name(report.id);
    satellite.azimuth = azimuth(report.look);
    satellite.elevation = static_cast<float>(report.look.elevation_rad);
    satellite.cn0 = static_cast<float>(report.cn0_dbhz);
    satellite.tracked = report.is_tracked;
    satellite.used = report.is_used ? msgs::Satellite::USED : msgs::Satellite::NOT_USED;
    satellite.pseudorange_residual = static_cast<float>(report.residual_m);
    message.satellites.push_back(satellite);
  }
  return message;
}

msgs::SignalPathArray to_message(const SignalsEvent& event, const ros::Time& time, const std::string& map_frame) {
  msgs::SignalPathArray message;
  message.header.stamp = time;
  message.header.frame_id = map_frame;
  for (const SignalTruth& truth : event.signals) {
    msgs::SignalPath path;
    path.constellation = static_cast<std::uint8_t>(truth.report.id.constellation);
    path.svid = static_cast<std::uint16_t>(truth.report.id.svid);
    path.name = satellite_name(truth.report.id);
    path.azimuth = azimuth(truth.look);
    path.elevation = static_cast<float>(truth.look.elevation_rad);
    path.path_class = path_class(truth.report.path_class);
    path.line_of_sight = truth.has_line_of_sight;
    path.cn0 = static_cast<float>(truth.report.cn0_dbhz);
    path.excess_path = static_cast<float>(truth.report.excess_m);
    path.pseudorange_error = static_cast<float>(truth.report.range_error_m);
    for (const Eigen::Vector3d& corner : truth.path) path.path.push_back(point(corner));
    message.paths.push_back(path);
  }
  return message;
}

geometry_msgs::Vector3Stamped to_message(const FixTruthEvent& event, const ros::Time& time,
                                         const std::string& map_frame) {
  geometry_msgs::Vector3Stamped message;
  message.header.stamp = time;
  message.header.frame_id = map_frame;
  message.vector = to_vector(event.error);
  return message;
}

sensor_msgs::PointCloud2 to_message(const LidarScan& scan, const ros::Time& time, const std::string& frame) {
  using Field = sensor_msgs::PointField;
  sensor_msgs::PointCloud2 message;
  message.header.stamp = time;
  message.header.frame_id = frame;
  message.height = 1;
  message.is_dense = true;
  sensor_msgs::PointCloud2Modifier modifier(message);
  modifier.setPointCloud2Fields(5, "x", 1, Field::FLOAT32, "y", 1, Field::FLOAT32, "z", 1, Field::FLOAT32, "intensity",
                                1, Field::FLOAT32, "ring", 1, Field::UINT16);
  modifier.resize(scan.size());
  sensor_msgs::PointCloud2Iterator<float> x(message, "x"), y(message, "y"), z(message, "z");
  sensor_msgs::PointCloud2Iterator<float> intensity(message, "intensity");
  sensor_msgs::PointCloud2Iterator<std::uint16_t> ring(message, "ring");
  for (std::size_t i = 0; i < scan.size(); ++i, ++x, ++y, ++z, ++intensity, ++ring) {
    *x = scan.x[i];
    *y = scan.y[i];
    *z = scan.z[i];
    *intensity = scan.intensity[i];
    *ring = scan.ring[i];
  }
  return message;
}

tf2_msgs::TFMessage mounting_transforms(const Eigen::Vector3d& antenna, const Eigen::Vector3d& lidar,
                                        const ros::Time& time, const SimulationFrames& frames) {
  tf2_msgs::TFMessage message;
  const auto add = [&](const Eigen::Vector3d& place, const std::string& child) {
    geometry_msgs::TransformStamped transform;
    transform.header.stamp = time;
    transform.header.frame_id = frames.base.base_link;
    transform.child_frame_id = child;
    transform.transform.translation = to_vector(place);
    transform.transform.rotation.w = 1.0;
    message.transforms.push_back(transform);
  };
  add(antenna, frames.gps);
  add(lidar, frames.lidar);
  add(Eigen::Vector3d::Zero(), frames.imu);
  return message;
}

}  // namespace urban_gnss
