#include "urban_gnss_localization/ros/visibility_messages.hpp"

#include <sensor_msgs/point_cloud2_iterator.h>

#include <algorithm>
#include <boost/endian/conversion.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "urban_gnss_localization/ros/marker_parts.hpp"
#include "visibility_colours.hpp"

namespace urban_gnss {
namespace {

namespace msgs = urban_gnss_localization;
using visualization_msgs::Marker;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kMaxVariance_m2 = 1e12;  ///< (1000 km)^2
constexpr double kFreeRay_m = 40.0;       ///< drawn of a way that is free

struct FloatField {
  std::uint32_t offset;
  bool is_double;
};

FloatField float_field(const sensor_msgs::PointCloud2& message, const char* name) {
  using Field = sensor_msgs::PointField;
  for (const Field& field : message.fields) {
    if (field.name != name) continue;
    if (field.datatype != Field::FLOAT32 && field.datatype != Field::FLOAT64) {
      throw std::invalid_argument(std::string("field ") + name + " is no floating point number");
    }
    const bool is_double = field.datatype == Field::FLOAT64;
    if (std::size_t{field.offset} + (is_double ? 8U : 4U) > message.point_step) {
      throw std::invalid_argument(std::string("field ") + name + " lies outside point_step");
    }
    return {field.offset, is_double};
  }
  throw std::invalid_argument(std::string("no field ") + name);
}

float read(const std::uint8_t* point, const FloatField& field) {
  if (field.is_double) {
    double value = 0.0;
    std::memcpy(&value, point + field.offset, sizeof value);
    return static_cast<float>(value);
  }
  float value = 0.0F;
  std::memcpy(&value, point + field.offset, sizeof value);
  return value;
}

boost::array<double, 4> row_major(const Eigen::Matrix2d& matrix) {
  boost::array<double, 4> values;
  values[0] = matrix(0, 0);
  values[1] = matrix(0, 1);
  values[2] = matrix(1, 0);
  values[3] = matrix(1, 1);
  return values;
}

/// "7 of 12 satellites" above the antenna: those that are visible, of those that are used.
Marker satellite_count(const Eigen::Vector3d& antenna, const msgs::Visibility& visibility, const ros::Time& time,
                       const std::string& frame) {
  constexpr double kAbove_m = 4.0;
  Marker text = make_marker("satellite_count", 0, Marker::TEXT_VIEW_FACING, {1.0F, 1.0F, 1.0F, 1.0F}, time, frame);
  text.pose.position = point(antenna + kAbove_m * Eigen::Vector3d::UnitZ());
  text.scale.z = 2.0;
  text.text = std::to_string(visibility.satellites_visible) + " of " + std::to_string(visibility.satellites_used) +
              " satellites";
  return text;
}

std::uint8_t visibility_class(const SatelliteAssessment& assessment, const SatelliteObservation& satellite,
                              bool has_map) {
  if (!assessment.is_used) return msgs::SatelliteVisibility::NOT_USED;
  if (!assessment.is_visible) return msgs::SatelliteVisibility::BLOCKED;
  const bool is_known = !has_map || satellite.known_fraction >= 0.5;
  return is_known ? msgs::SatelliteVisibility::FREE : msgs::SatelliteVisibility::UNKNOWN;
}

}  // namespace

PointCloud to_point_cloud(const sensor_msgs::PointCloud2& message) {
  const std::size_t count = static_cast<std::size_t>(message.width) * message.height;
  if (count == 0) return {};
  if (message.is_bigendian != (boost::endian::order::native == boost::endian::order::big)) {
    throw std::invalid_argument("the byte order is not this machine's");
  }
  const FloatField x = float_field(message, "x");
  const FloatField y = float_field(message, "y");
  const FloatField z = float_field(message, "z");
  const std::size_t full_row = static_cast<std::size_t>(message.width) * message.point_step;
  // Drivers leave row_step at 0, or write the length of the whole cloud there; without gaps it is known.
  const std::size_t data_row = message.data.size() / message.height;
  const bool has_no_gaps = data_row == full_row && message.data.size() % message.height == 0;
  const std::size_t row_step = has_no_gaps ? full_row : message.row_step;
  if (row_step < full_row || data_row < row_step) {
    throw std::invalid_argument("less data than width, height and row_step say");
  }
  // Most drivers write three floats side by side.
  const bool is_plain = !x.is_double && !y.is_double && !z.is_double && y.offset == x.offset + sizeof(float) &&
                        z.offset == y.offset + sizeof(float);
  PointCloud cloud(count);
  auto next = cloud.begin();
  for (std::uint32_t row = 0; row < message.height; ++row) {
    const std::uint8_t* point = message.data.data() + row * row_step;
    for (std::uint32_t i = 0; i < message.width; ++i, point += message.point_step, ++next) {
      if (is_plain) {
        std::memcpy(next->data(), point + x.offset, 3 * sizeof(float));
      } else {
        *next = {read(point, x), read(point, y), read(point, z)};
      }
    }
  }
  return cloud;
}

OcclusionFrames to_occlusion_frames(const Frames& frames) { return {frames.map, frames.odom, frames.base_link}; }

sensor_msgs::PointCloud2 to_message(const PointCloud& cloud, const ros::Time& time, const std::string& frame) {
  sensor_msgs::PointCloud2 message;
  message.header.stamp = time;
  message.header.frame_id = frame;
  sensor_msgs::PointCloud2Modifier modifier(message);
  modifier.setPointCloud2FieldsByString(1, "xyz");
  modifier.resize(cloud.size());
  sensor_msgs::PointCloud2Iterator<float> out(message, "x");
  for (const Eigen::Vector3f& point : cloud) {
    out[0] = point.x();
    out[1] = point.y();
    out[2] = point.z();
    ++out;
  }
  return message;
}

std::vector<SatelliteObservation> to_observations(const msgs::SatelliteArray& message) {
  std::vector<SatelliteObservation> observations;
  for (const msgs::Satellite& satellite : message.satellites) {
    SatelliteObservation observation;
    observation.id = {static_cast<Constellation>(satellite.constellation), satellite.svid};
    observation.look = {satellite.azimuth, satellite.elevation};
    observation.cn0_dbhz = satellite.cn0;
    observation.tracked = satellite.tracked;
    observation.residual_m = satellite.pseudorange_residual;
    observations.push_back(observation);
  }
  return observations;
}

QueuedCloud to_queued_cloud(const sensor_msgs::PointCloud2ConstPtr& message) {
  return {to_stamp(message->header.stamp), without_leading_slash(message->header.frame_id),
          [message] { return to_point_cloud(*message); }};
}

QueuedFix to_queued_fix(const sensor_msgs::NavSatFixConstPtr& message,
                        std::function<void(const FixAssessment*)> settle) {
  const bool has_position = message->status.status >= sensor_msgs::NavSatStatus::STATUS_FIX &&
                            std::isfinite(message->latitude) && std::isfinite(message->longitude);
  return {to_stamp(message->header.stamp), without_leading_slash(message->header.frame_id), has_position,
          claimed_covariance(*message), std::move(settle)};
}

std::optional<Eigen::Matrix2d> claimed_covariance(const sensor_msgs::NavSatFix& fix) {
  if (fix.position_covariance_type == sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN) return std::nullopt;
  const auto& c = fix.position_covariance;
  Eigen::Matrix2d claimed;
  claimed << c[0], 0.5 * (c[1] + c[3]), 0.5 * (c[1] + c[3]), c[4];
  const bool is_usable = claimed.allFinite() && claimed(0, 0) > 0.0 && claimed.determinant() > 0.0;
  return is_usable ? std::optional<Eigen::Matrix2d>(claimed) : std::nullopt;
}

sensor_msgs::NavSatFix fix_without_place(const sensor_msgs::NavSatFix& fix) {
  sensor_msgs::NavSatFix without_place = fix;
  without_place.status.status = std::min<std::int8_t>(fix.status.status, sensor_msgs::NavSatStatus::STATUS_NO_FIX);
  for (double* each : {&without_place.latitude, &without_place.longitude, &without_place.altitude}) {
    if (!std::isfinite(*each)) *each = 0.0;
  }
  without_place.position_covariance.fill(0.0);
  without_place.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN;
  return without_place;
}

sensor_msgs::NavSatFix weighted_fix(const sensor_msgs::NavSatFix& fix, const GnssCovariance& covariance) {
  sensor_msgs::NavSatFix weighted = fix;
  const Eigen::Matrix2d& horizontal = covariance.weighted;
  const auto claimed = claimed_covariance(fix);
  const double factor = claimed ? std::max(1.0, horizontal.trace() / claimed->trace()) : 1.0;
  if (!std::isfinite(fix.altitude)) weighted.altitude = kNaN;  // which is NavSatFix's word for "none"
  const double up = fix.position_covariance[8];
  auto& c = weighted.position_covariance;
  c.fill(0.0);
  c[0] = horizontal(0, 0);
  c[1] = c[3] = horizontal(0, 1);
  c[4] = horizontal(1, 1);
  c[8] = claimed && std::isfinite(up) && up > 0.0 ? std::min(factor * up, kMaxVariance_m2) : 2.0 * horizontal.trace();
  weighted.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_KNOWN;
  return weighted;
}

msgs::Visibility to_message(const FixAssessment& assessment, const std::optional<Eigen::Matrix2d>& claimed,
                            const GnssCovarianceParameters& parameters, const ros::Time& time,
                            const std::string& frame) {
  const GnssCovariance& covariance = assessment.covariance;
  msgs::Visibility message;
  message.header.stamp = time;
  message.header.frame_id = frame;
  message.model = enum_name(parameters.model);
  message.source = static_cast<std::uint8_t>(covariance.source);
  message.source_name = to_string(covariance.source);
  message.missing = assessment.missing;
  message.doubt = assessment.doubt;
  message.strong_share = static_cast<float>(assessment.strong_share);
  message.good = covariance.is_good;
  message.recovering = covariance.is_recovering;
  message.satellites_used = static_cast<std::uint16_t>(covariance.satellite_count);
  message.satellites_visible = static_cast<std::uint16_t>(covariance.visible_count);
  message.hdop_all = static_cast<float>(covariance.hdop_all);
  message.hdop_visible = static_cast<float>(covariance.hdop_visible);
  message.claimed_covariance = row_major(claimed.value_or(Eigen::Matrix2d::Zero()));
  message.conventional_covariance = row_major(covariance.conventional);
  message.weighted_covariance = row_major(covariance.weighted);
  for (std::size_t i = 0; i < assessment.satellites.size(); ++i) {
    const SatelliteObservation& satellite = assessment.satellites[i];
    const SatelliteAssessment& outcome = covariance.satellites[i];
    msgs::SatelliteVisibility visibility;
    visibility.constellation = static_cast<std::uint8_t>(satellite.id.constellation);
    visibility.svid = static_cast<std::uint16_t>(satellite.id.svid);
    visibility.name = satellite_name(satellite.id);
    visibility.azimuth = static_cast<float>(satellite.look.azimuth_rad);
    visibility.elevation = static_cast<float>(satellite.look.elevation_rad);
    visibility.cn0 = static_cast<float>(satellite.cn0_dbhz);
    visibility.blocked_fraction = static_cast<float>(satellite.blocked_fraction);
    visibility.known_fraction = static_cast<float>(satellite.known_fraction);
    visibility.nlos_probability = static_cast<float>(outcome.nlos_probability);
    visibility.range = static_cast<float>(assessment.has_map ? assessment.visibilities[i].range_m : kNaN);
    visibility.visibility = visibility_class(outcome, satellite, assessment.has_map);
    message.satellites.push_back(visibility);
  }
  return message;
}

visualization_msgs::MarkerArray ray_markers(const FixAssessment& assessment, const msgs::Visibility& visibility,
                                            const ros::Time& time, const std::string& frame) {
  visualization_msgs::MarkerArray markers;
  Marker clear = make_marker("", 0, Marker::SPHERE, {0.0F, 0.0F, 0.0F, 0.0F}, time, frame);
  clear.action = Marker::DELETEALL;  // satellites set
  markers.markers.push_back(clear);
  markers.markers.push_back(satellite_count(assessment.antenna.position, visibility, time, frame));
  if (!assessment.has_map) return markers;
  const Eigen::AngleAxisd turn(assessment.antenna.east_yaw_rad, Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d& from = assessment.antenna.position;
  for (std::size_t i = 0; i < visibility.satellites.size(); ++i) {
    const msgs::SatelliteVisibility& satellite = visibility.satellites[i];
    if (satellite.visibility == msgs::SatelliteVisibility::NOT_USED) continue;
    const int id = static_cast<int>(i);
    const double length = std::isfinite(satellite.range) ? satellite.range : kFreeRay_m;
    const Eigen::Vector3d to = from + length * (turn * line_of_sight({satellite.azimuth, satellite.elevation}));
    Marker ray = make_marker("rays", id, Marker::LINE_STRIP, colour_of(satellite.visibility), time, frame);
    ray.scale.x = 0.35;
    ray.points = {point(from), point(to)};
    Marker label = make_marker("names", id, Marker::TEXT_VIEW_FACING, {1.0F, 1.0F, 1.0F, 0.9F}, time, frame);
    label.pose.position = point(to);
    label.scale.z = 3.0;
    label.text = satellite.name;
    markers.markers.push_back(ray);
    markers.markers.push_back(label);
  }
  return markers;
}

}  // namespace urban_gnss
