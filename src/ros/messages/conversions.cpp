#include "urban_gnss_localization/ros/conversions.hpp"

#include <sensor_msgs/point_cloud2_iterator.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace urban_gnss {
namespace {

namespace msgs = urban_gnss_localization;

/// Row-major index into a 6x6 covariance (x, y, z, roll, pitch, yaw) of the planar axes.
constexpr std::size_t kPlanar[3] = {0, 1, 5};

double yaw_of(const geometry_msgs::Quaternion& q) {
  const double norm2 = q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z;
  if (!(norm2 > 1e-12) || !std::isfinite(norm2)) return std::numeric_limits<double>::quiet_NaN();
  return std::atan2(2.0 * (q.w * q.z + q.x * q.y), q.w * q.w + q.x * q.x - q.y * q.y - q.z * q.z);
}

geometry_msgs::Quaternion quaternion_of(double yaw) {
  geometry_msgs::Quaternion q;
  q.z = std::sin(0.5 * yaw);
  q.w = std::cos(0.5 * yaw);
  return q;
}

}  // namespace

void Frames::check(std::vector<std::string>& faults) const {
  if (map.empty()) faults.push_back("map_frame: must not be empty");
  if (odom.empty()) faults.push_back("odom_frame: must not be empty");
  if (base_link.empty()) faults.push_back("base_link_frame: must not be empty");
  if (map == odom || odom == base_link || map == base_link) {
    faults.push_back("map_frame, odom_frame, base_link_frame = " + map + ", " + odom + ", " + base_link +
                     ": must be three different frames");
  }
}

Stamp to_stamp(const ros::Time& time) { return Stamp(static_cast<std::int64_t>(time.toNSec())); }

ros::Time to_ros(Stamp stamp) {
  ros::Time time;
  const std::int64_t limit = static_cast<std::int64_t>(std::numeric_limits<std::uint32_t>::max()) * 1000000000LL;
  time.fromNSec(static_cast<std::uint64_t>(std::clamp<std::int64_t>(stamp.count(), 0, limit)));
  return time;
}

RawFix to_raw_fix(const sensor_msgs::NavSatFix& message) {
  RawFix fix;
  fix.stamp = to_stamp(message.header.stamp);
  fix.has_fix = message.status.status >= sensor_msgs::NavSatStatus::STATUS_FIX;
  fix.has_sbas = message.status.status == sensor_msgs::NavSatStatus::STATUS_SBAS_FIX;
  fix.position = to_geodetic(message);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      fix.covariance(row, column) = message.position_covariance[static_cast<std::size_t>(3 * row + column)];
    }
  }
  switch (message.position_covariance_type) {
    case sensor_msgs::NavSatFix::COVARIANCE_TYPE_APPROXIMATED:
      fix.covariance_type = CovarianceType::kApproximated;
      break;
    case sensor_msgs::NavSatFix::COVARIANCE_TYPE_DIAGONAL_KNOWN:
      fix.covariance_type = CovarianceType::kDiagonalKnown;
      break;
    case sensor_msgs::NavSatFix::COVARIANCE_TYPE_KNOWN: fix.covariance_type = CovarianceType::kKnown; break;
    default: fix.covariance_type = CovarianceType::kUnknown;
  }
  return fix;
}

sensor_msgs::NavSatFix to_message(const GeodeticPosition& place, const ros::Time& time, const std::string& frame) {
  sensor_msgs::NavSatFix message;
  message.header.stamp = time;
  message.header.frame_id = frame;
  message.status.status = sensor_msgs::NavSatStatus::STATUS_FIX;
  message.status.service = sensor_msgs::NavSatStatus::SERVICE_GPS;
  message.latitude = place.latitude_deg;
  message.longitude = place.longitude_deg;
  message.altitude = place.altitude_m;
  return message;
}

GeodeticPosition to_geodetic(const sensor_msgs::NavSatFix& message) {
  return {message.latitude, message.longitude, message.altitude};
}

OdometrySample to_odometry_sample(const nav_msgs::Odometry& message) {
  OdometrySample sample;
  sample.stamp = to_stamp(message.header.stamp);
  const geometry_msgs::Quaternion& q = message.pose.pose.orientation;
  sample.has_pose = q.x != 0.0 || q.y != 0.0 || q.z != 0.0 || q.w != 0.0;
  if (sample.has_pose) sample.pose = to_pose2(message.pose.pose);
  // Of Imu.msg, and of drivers that follow it: -1 in the first element says that there is no measurement.
  sample.has_twist = message.twist.covariance[0] != -1.0;
  const geometry_msgs::Twist& twist = message.twist.twist;
  // Drivers of robots that cannot move sideways leave it as it is, or say that they do not know.
  const double lateral_mps = std::isfinite(twist.linear.y) ? twist.linear.y : 0.0;
  if (sample.has_twist) sample.twist = {twist.linear.x, twist.angular.z, lateral_mps};
  return sample;
}

RawVelocity to_raw_velocity(const geometry_msgs::TwistStamped& message) {
  RawVelocity velocity;
  velocity.stamp = to_stamp(message.header.stamp);
  velocity.velocity = {message.twist.linear.x, message.twist.linear.y};
  return velocity;
}

RawVelocity to_raw_velocity(const geometry_msgs::TwistWithCovarianceStamped& message) {
  constexpr int kDimension = 6;
  geometry_msgs::TwistStamped twist;
  twist.header = message.header;
  twist.twist = message.twist.twist;
  RawVelocity velocity = to_raw_velocity(twist);
  for (int row = 0; row < 2; ++row) {
    for (int column = 0; column < 2; ++column) {
      velocity.covariance(row, column) = message.twist.covariance[static_cast<std::size_t>(kDimension * row + column)];
    }
  }
  return velocity;
}

std::optional<ImuSample> to_imu_sample(const sensor_msgs::Imu& message) {
  if (message.angular_velocity_covariance[0] == -1.0) return std::nullopt;
  ImuSample sample;
  sample.stamp = to_stamp(message.header.stamp);
  sample.rate_radps << message.angular_velocity.x, message.angular_velocity.y, message.angular_velocity.z;
  if (!sample.rate_radps.allFinite()) return std::nullopt;
  const Eigen::Vector3d acceleration(message.linear_acceleration.x, message.linear_acceleration.y,
                                     message.linear_acceleration.z);
  if (message.linear_acceleration_covariance[0] != -1.0 && acceleration.allFinite()) {
    sample.acceleration_mps2 = acceleration;
  }
  const Eigen::Quaterniond orientation(message.orientation.w, message.orientation.x, message.orientation.y,
                                       message.orientation.z);
  if (message.orientation_covariance[0] >= 0.0 && std::abs(orientation.norm() - 1.0) < 0.1) {
    sample.orientation = orientation.normalized();
    const double variance_rad2 = message.orientation_covariance[8];
    if (std::isfinite(variance_rad2) && variance_rad2 > 0.0) sample.heading_sigma_rad = std::sqrt(variance_rad2);
  }
  return sample;
}

Pose2 to_pose2(const geometry_msgs::Pose& pose) { return {pose.position.x, pose.position.y, yaw_of(pose.orientation)}; }

geometry_msgs::Pose to_message(const Pose2& pose) {
  geometry_msgs::Pose message;
  message.position.x = pose.x;
  message.position.y = pose.y;
  message.orientation = quaternion_of(pose.yaw);
  return message;
}

PoseEstimate to_pose_estimate(const geometry_msgs::PoseWithCovariance& message) {
  PoseEstimate estimate;
  estimate.pose = to_pose2(message.pose);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      estimate.covariance(row, column) = message.covariance[6 * kPlanar[row] + kPlanar[column]];
    }
  }
  return estimate;
}

TimedPose to_timed_pose(const nav_msgs::Odometry& message) {
  const PoseEstimate estimate = to_pose_estimate(message.pose);
  TimedPose timed;
  timed.stamp = to_stamp(message.header.stamp);
  timed.pose = estimate.pose;
  // All zeros is what a publisher without a covariance sends.
  if (estimate.covariance.squaredNorm() > 0.0) timed.covariance = estimate.covariance;
  return timed;
}

nav_msgs::Odometry to_message(const LocalizationOutput& output, const Frames& frames) {
  nav_msgs::Odometry message;
  message.header.stamp = to_ros(output.stamp);
  message.header.frame_id = frames.map;
  message.child_frame_id = frames.base_link;
  message.pose.pose = to_message(output.estimate.pose);
  for (std::size_t axis = 0; axis < 6; ++axis) {
    message.pose.covariance[7 * axis] = kUnobservedVariance;
    message.twist.covariance[7 * axis] = kUnobservedVariance;
  }
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      message.pose.covariance[6 * kPlanar[row] + kPlanar[column]] = output.estimate.covariance(row, column);
    }
  }
  message.twist.twist.linear.x = output.twist.speed_mps;
  message.twist.twist.linear.y = output.twist.lateral_mps;
  message.twist.twist.angular.z = output.twist.yaw_rate_radps;
  return message;
}

sensor_msgs::NavSatFix to_fix_message(const LocalizationOutput& output, const LocalFrame& map, const Frames& frames) {
  GeodeticPosition place = map.to_geodetic({output.estimate.pose.x, output.estimate.pose.y, 0.0});
  place.altitude_m = map.datum().altitude_m;  // the plane z = 0 rises above the ellipsoid with the distance
  sensor_msgs::NavSatFix message = to_message(place, to_ros(output.stamp), frames.base_link);
  for (int row = 0; row < 2; ++row) {
    for (int column = 0; column < 2; ++column) {
      message.position_covariance[static_cast<std::size_t>(3 * row + column)] = output.estimate.covariance(row, column);
    }
  }
  message.position_covariance[8] = kUnobservedVariance;
  message.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_KNOWN;
  return message;
}

geometry_msgs::TransformStamped to_transform(const Pose2& pose, const ros::Time& time, const std::string& parent,
                                             const std::string& child) {
  geometry_msgs::TransformStamped transform;
  transform.header.stamp = time;
  transform.header.frame_id = parent;
  transform.child_frame_id = child;
  transform.transform.translation.x = pose.x;
  transform.transform.translation.y = pose.y;
  transform.transform.rotation = quaternion_of(pose.yaw);
  return transform;
}

geometry_msgs::TransformStamped to_map_to_odom(const Pose2& map_to_odometry, Stamp stamp, const Frames& frames,
                                               double offset_s) {
  return to_transform(map_to_odometry, to_ros(stamp + from_seconds(offset_s)), frames.map, frames.odom);
}

msgs::FixDecision to_message(const FixOutcome& outcome) {
  msgs::FixDecision message;
  message.stamp = to_ros(outcome.stamp);
  message.decision = static_cast<std::uint8_t>(outcome.decision);
  message.decision_name = to_string(outcome.decision);
  message.nis = outcome.nis;
  message.nis_threshold = outcome.nis_threshold;
  message.nis_dof = static_cast<std::uint8_t>(outcome.nis_dof);
  message.covariance_clamped = outcome.covariance_clamped;
  message.reason = outcome.reason;
  return message;
}

FixOutcome to_outcome(const msgs::FixDecision& message) {
  FixOutcome outcome;
  outcome.stamp = to_stamp(message.stamp);
  outcome.decision = static_cast<FixDecision>(message.decision);
  outcome.nis = message.nis;
  outcome.nis_threshold = message.nis_threshold;
  outcome.nis_dof = message.nis_dof;
  outcome.covariance_clamped = message.covariance_clamped;
  outcome.reason = message.reason;
  return outcome;
}

msgs::GpsBias to_message(const BiasEstimate& bias, const std::string& map_frame) {
  msgs::GpsBias message;
  message.header.stamp = to_ros(bias.stamp);
  message.header.frame_id = map_frame;
  message.bias.x = bias.bias.x();
  message.bias.y = bias.bias.y();
  message.bias_rate.x = bias.rate.x();
  message.bias_rate.y = bias.rate.y();
  message.covariance[0] = bias.covariance(0, 0);
  message.covariance[1] = bias.covariance(0, 1);
  message.covariance[3] = bias.covariance(1, 0);
  message.covariance[4] = bias.covariance(1, 1);
  message.covariance[8] = kUnobservedVariance;
  message.radius = bias.radius_m;
  message.in_shadow = bias.in_shadow;
  message.shadow_statistic = bias.shadow_statistic;
  message.shadow_threshold = bias.shadow_threshold;
  message.fix = to_message(bias.outcome);
  return message;
}

BiasEstimate to_bias_estimate(const msgs::GpsBias& message) {
  BiasEstimate bias;
  bias.stamp = to_stamp(message.header.stamp);
  bias.bias = {message.bias.x, message.bias.y};
  bias.rate = {message.bias_rate.x, message.bias_rate.y};
  bias.covariance << message.covariance[0], message.covariance[1], message.covariance[3], message.covariance[4];
  bias.radius_m = message.radius;
  bias.in_shadow = message.in_shadow;
  bias.shadow_statistic = message.shadow_statistic;
  bias.shadow_threshold = message.shadow_threshold;
  bias.outcome = to_outcome(message.fix);
  return bias;
}

msgs::LocalizationStatus to_message(const LocalizationReport& report, const Localizer& localizer, const ros::Time& time,
                                    const std::string& map_frame) {
  msgs::LocalizationStatus message;
  message.header.stamp = time;
  message.header.frame_id = map_frame;
  message.localizer = localizer.name();
  message.mode = localizer.mode();
  message.state = static_cast<std::uint8_t>(report.state);
  message.state_name = to_string(report.state);
  message.healthy = report.healthy;
  message.reason = report.reason;
  message.last_fix = to_message(report.last_fix);
  message.fixes_used = report.fixes_used;
  message.fixes_rejected = report.fixes_rejected;
  message.fixes_with_ranges = report.fixes_with_ranges;
  message.velocities_used = report.velocities_used;
  message.fix_age = report.fix_age_s;
  message.odometry_age = report.odometry_age_s;
  message.position_sigma = report.position_sigma_m;
  message.protection_level = report.protection_level_m;
  message.time_to_detect = report.time_to_detect_s;
  message.time_to_recover = report.time_to_recover_s;
  message.fix_delay = report.fix_delay_s;
  message.heading_sigma = report.health.heading_sigma_rad;
  message.heading_converged = report.heading_converged;
  message.bias_radius = report.bias_radius_m;
  message.particle_count = report.health.particle_count;
  message.effective_sample_size = report.health.effective_sample_size;
  message.position_spread = report.health.position_spread_m;
  message.cluster_mass = report.health.cluster_mass;
  message.cluster_count = report.health.cluster_count;
  return message;
}

std::vector<msgs::LocalizationStatus> to_status_messages(const LocalizationPipeline& pipeline,
                                                         const std::vector<FixOutcome>& outcomes, const ros::Time& time,
                                                         const std::string& map_frame) {
  std::vector<msgs::LocalizationStatus> messages;
  if (outcomes.empty()) return messages;
  messages.assign(outcomes.size(), to_message(pipeline.report(), pipeline.localizer(), time, map_frame));
  for (std::size_t i = 0; i < outcomes.size(); ++i) messages[i].last_fix = to_message(outcomes[i]);
  return messages;
}

geometry_msgs::PoseArray to_pose_array(const ParticleSet& particles, const ros::Time& time, const std::string& frame) {
  geometry_msgs::PoseArray message;
  message.header.stamp = time;
  message.header.frame_id = frame;
  message.poses.reserve(particles.size());
  for (std::size_t i = 0; i < particles.size(); ++i) message.poses.push_back(to_message(particles.pose(i)));
  return message;
}

sensor_msgs::PointCloud2 to_point_cloud(const ParticleSet& particles, const ros::Time& time, const std::string& frame) {
  sensor_msgs::PointCloud2 message;
  message.header.stamp = time;
  message.header.frame_id = frame;
  message.is_dense = true;
  constexpr auto kFloat = sensor_msgs::PointField::FLOAT32;
  sensor_msgs::PointCloud2Modifier modifier(message);
  modifier.setPointCloud2Fields(6, "x", 1, kFloat, "y", 1, kFloat, "z", 1, kFloat, "yaw", 1, kFloat, "weight", 1,
                                kFloat, "intensity", 1, kFloat);
  modifier.resize(particles.size());
  const auto heaviest = std::max_element(particles.weight.begin(), particles.weight.end());
  const double scale = heaviest != particles.weight.end() && *heaviest > 0.0 ? 1.0 / *heaviest : 0.0;
  sensor_msgs::PointCloud2Iterator<float> x(message, "x");
  for (std::size_t i = 0; i < particles.size(); ++i, ++x) {
    const Pose2 pose = particles.pose(i);
    x[0] = static_cast<float>(pose.x);
    x[1] = static_cast<float>(pose.y);
    x[2] = 0.0F;
    x[3] = static_cast<float>(pose.yaw);
    x[4] = particles.weight[i];
    x[5] = static_cast<float>(particles.weight[i] * scale);
  }
  return message;
}

}  // namespace urban_gnss
