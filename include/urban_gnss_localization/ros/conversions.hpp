#pragma once

#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/PoseWithCovariance.h>
#include <geometry_msgs/TransformStamped.h>
#include <geometry_msgs/TwistStamped.h>
#include <geometry_msgs/TwistWithCovarianceStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/time.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/PointCloud2.h>
#include <urban_gnss_localization/FixDecision.h>
#include <urban_gnss_localization/GpsBias.h>
#include <urban_gnss_localization/LocalizationStatus.h>

#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/evaluation/trajectory.hpp"
#include "urban_gnss_localization/localizers/bias_estimate.hpp"
#include "urban_gnss_localization/localizers/particle_set.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

/// Between messages and the core's types. Nothing here decides or computes anything of its own.
namespace urban_gnss {

/// Names of REP-105's frames.
struct Frames {
  std::string map{"map"};
  std::string odom{"odom"};
  std::string base_link{"base_link"};

  void visit(ParameterVisitor& v) {
    v.basic()("map_frame", map, "frame fixed to the world: x east, y north of the datum");
    v.basic()("odom_frame", odom, "frame of the odometry's pose");
    v.basic()("base_link_frame", base_link, "frame of the robot; Nishida et al. put it on the rear axle");
    for (std::string* each : {&map, &odom, &base_link}) *each = without_leading_slash(*each);  // as tf had them
  }
  void check(std::vector<std::string>& faults) const;
};

Stamp to_stamp(const ros::Time& time);
/// Requires a stamp that ROS can express (0 to 2^32 s); others are clamped.
ros::Time to_ros(Stamp stamp);

RawFix to_raw_fix(const sensor_msgs::NavSatFix& message);
/// East and north of a receiver's velocity, whatever the frame's name is: drivers write that of the antenna there.
RawVelocity to_raw_velocity(const geometry_msgs::TwistWithCovarianceStamped& message);
/// The same without a covariance.
RawVelocity to_raw_velocity(const geometry_msgs::TwistStamped& message);
/// Either of them, in a message whose type is known when it comes: `Any` is topic_tools::ShapeShifter or
/// rosbag::MessageInstance. Nothing where it is of another type.
template <class Any>
std::optional<RawVelocity> to_raw_velocity_of(const Any& message) {
  using geometry_msgs::TwistStamped;
  using geometry_msgs::TwistWithCovarianceStamped;
  if (message.getDataType() == ros::message_traits::DataType<TwistWithCovarianceStamped>::value()) {
    return to_raw_velocity(*message.template instantiate<TwistWithCovarianceStamped>());
  }
  if (message.getDataType() == ros::message_traits::DataType<TwistStamped>::value()) {
    return to_raw_velocity(*message.template instantiate<TwistStamped>());
  }
  return std::nullopt;
}
inline constexpr char kVelocityTypes[] = "geometry_msgs/TwistWithCovarianceStamped or geometry_msgs/TwistStamped";
/// A fix without covariance.
sensor_msgs::NavSatFix to_message(const GeodeticPosition& place, const ros::Time& time, const std::string& frame);
GeodeticPosition to_geodetic(const sensor_msgs::NavSatFix& message);

/// A quaternion of 0 is no pose; a covariance of -1 says that there is no twist.
OdometrySample to_odometry_sample(const nav_msgs::Odometry& message);
/// Nothing where there is no angular velocity: it is not finite, or said not to be there. The same holds for
/// orientation and acceleration alone.
std::optional<ImuSample> to_imu_sample(const sensor_msgs::Imu& message);
/// Planar part; yaw NaN where the quaternion has no direction.
Pose2 to_pose2(const geometry_msgs::Pose& pose);
geometry_msgs::Pose to_message(const Pose2& pose);
PoseEstimate to_pose_estimate(const geometry_msgs::PoseWithCovariance& message);
TimedPose to_timed_pose(const nav_msgs::Odometry& message);

/// Pose in the map frame and twist in the base frame; what a planar filter does not estimate (z, roll, pitch) has the
/// variance `kUnobservedVariance`.
nav_msgs::Odometry to_message(const LocalizationOutput& output, const Frames& frames);
inline constexpr double kUnobservedVariance = 1e6;
/// The estimate as a fix, for map viewers, as robot_localization's navsat_transform_node publishes it: latitude and
/// longitude of the base, and their covariance (m^2, the map's east and north). The altitude is the datum's, with the
/// variance `kUnobservedVariance`, since a planar filter does not estimate it. `map` is the map frame.
sensor_msgs::NavSatFix to_fix_message(const LocalizationOutput& output, const LocalFrame& map, const Frames& frames);

/// map -> odom, valid until `offset_s` after the stamp.
geometry_msgs::TransformStamped to_map_to_odom(const Pose2& map_to_odometry, Stamp stamp, const Frames& frames,
                                               double offset_s);
geometry_msgs::TransformStamped to_transform(const Pose2& pose, const ros::Time& time, const std::string& parent,
                                             const std::string& child);

urban_gnss_localization::FixDecision to_message(const FixOutcome& outcome);
FixOutcome to_outcome(const urban_gnss_localization::FixDecision& message);
urban_gnss_localization::GpsBias to_message(const BiasEstimate& bias, const std::string& map_frame);
BiasEstimate to_bias_estimate(const urban_gnss_localization::GpsBias& message);
urban_gnss_localization::LocalizationStatus to_message(const LocalizationReport& report, const Localizer& localizer,
                                                       const ros::Time& time, const std::string& map_frame);

/// The state once for each outcome, so that no decision goes unpublished where several came at once. Computes the
/// state once; nothing where there is no outcome.
std::vector<urban_gnss_localization::LocalizationStatus> to_status_messages(const LocalizationPipeline& pipeline,
                                                                            const std::vector<FixOutcome>& outcomes,
                                                                            const ros::Time& time,
                                                                            const std::string& map_frame);

geometry_msgs::PoseArray to_pose_array(const ParticleSet& particles, const ros::Time& time, const std::string& frame);
/// Fields x, y, z (m; z = 0), yaw (rad), weight (sums to 1), intensity (weight relative to the heaviest, 0 to 1).
sensor_msgs::PointCloud2 to_point_cloud(const ParticleSet& particles, const ros::Time& time, const std::string& frame);

}  // namespace urban_gnss
