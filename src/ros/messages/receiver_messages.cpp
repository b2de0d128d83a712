#include "urban_gnss_localization/ros/receiver_messages.hpp"

#include <cmath>

#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/visibility_messages.hpp"

namespace urban_gnss {
namespace {

namespace msgs = urban_gnss_localization;

std::uint8_t to_message(CovarianceType type) {
  switch (type) {
    case CovarianceType::kApproximated: return sensor_msgs::NavSatFix::COVARIANCE_TYPE_APPROXIMATED;
    case CovarianceType::kDiagonalKnown: return sensor_msgs::NavSatFix::COVARIANCE_TYPE_DIAGONAL_KNOWN;
    case CovarianceType::kKnown: return sensor_msgs::NavSatFix::COVARIANCE_TYPE_KNOWN;
    case CovarianceType::kUnknown: break;
  }
  return sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN;
}

msgs::Satellite to_message(const SatelliteObservation& observation) {
  msgs::Satellite message;
  message.constellation = static_cast<std::uint8_t>(observation.id.constellation);
  message.svid = static_cast<std::uint16_t>(observation.id.svid);
  message.name = satellite_name(observation.id);
  message.azimuth = static_cast<float>(observation.look.azimuth_rad);
  message.elevation = static_cast<float>(observation.look.elevation_rad);
  message.cn0 = static_cast<float>(observation.cn0_dbhz);
  message.tracked = observation.tracked;
  message.used = std::isfinite(observation.residual_m) ? msgs::Satellite::USED : msgs::Satellite::USE_UNKNOWN;
  message.pseudorange_residual = static_cast<float>(observation.residual_m);
  return message;
}

}  // namespace

sensor_msgs::NavSatFix to_message(const RawFix& fix, const std::string& frame) {
  sensor_msgs::NavSatFix message = to_message(fix.position, to_ros(fix.stamp), frame);
  if (!fix.has_fix) message.status.status = sensor_msgs::NavSatStatus::STATUS_NO_FIX;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      message.position_covariance[static_cast<std::size_t>(3 * row + column)] = fix.covariance(row, column);
    }
  }
  message.position_covariance_type = to_message(fix.covariance_type);
  return message;
}

geometry_msgs::TwistWithCovarianceStamped to_message(const RawVelocity& velocity, const std::string& frame) {
  constexpr std::size_t kDimension = 6;
  geometry_msgs::TwistWithCovarianceStamped message;
  message.header.stamp = to_ros(velocity.stamp);
  message.header.frame_id = frame;
  message.twist.twist.linear.x = velocity.velocity.x();
  message.twist.twist.linear.y = velocity.velocity.y();
  for (std::size_t row = 0; row < 2; ++row) {
    for (std::size_t column = 0; column < 2; ++column) {
      message.twist.covariance[kDimension * row + column] =
          velocity.covariance(static_cast<int>(row), static_cast<int>(column));
    }
  }
  for (std::size_t axis = 2; axis < kDimension; ++axis) {
    message.twist.covariance[(kDimension + 1) * axis] = kUnobservedVariance;
  }
  return message;
}

msgs::SatelliteArray to_message(const SatelliteEpoch& epoch, const std::string& frame) {
  msgs::SatelliteArray message;
  message.header.stamp = to_ros(epoch.stamp);
  message.header.frame_id = frame;
  message.angle_resolution = static_cast<float>(epoch.angle_resolution_rad);
  for (const SatelliteObservation& satellite : epoch.satellites) message.satellites.push_back(to_message(satellite));
  return message;
}

SatelliteEpoch to_satellite_epoch(const msgs::SatelliteArray& message) {
  return {to_stamp(message.header.stamp), to_observations(message), message.angle_resolution};
}

}  // namespace urban_gnss
