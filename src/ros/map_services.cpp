#include "urban_gnss_localization/ros/map_services.hpp"

#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "urban_gnss_localization/geometry/pose_faults.hpp"
#include "urban_gnss_localization/gnss/position_hint.hpp"

namespace urban_gnss {
namespace {

namespace srv = urban_gnss_localization;

constexpr char kNoDatum[] = "there is no datum yet";

geometry_msgs::Point to_point(const Eigen::Vector3d& position) {
  geometry_msgs::Point point;
  point.x = position.x();
  point.y = position.y();
  point.z = position.z();
  return point;
}

Eigen::Vector3d to_vector(const geometry_msgs::Point& point) { return {point.x, point.y, point.z}; }

std::string joined(const std::vector<std::string>& faults) {
  std::string text;
  for (const std::string& fault : faults) text += (text.empty() ? "" : "; ") + fault;
  return text;
}

/// The place, or why there is none: in `fault`.
GeodeticPosition place_of(const geometry_msgs::Point& point, const LocalFrame& map, std::string& fault) {
  const Eigen::Vector3d position = to_vector(point);
  if (!(position.cwiseAbs().maxCoeff() <= kMaxCoordinate_m) || !position.allFinite()) {
    std::ostringstream out;
    out << "map_point = " << position.transpose() << ": must be finite, and within 10 000 km";
    fault = out.str();
    return {};
  }
  const GeodeticPosition place = map.to_geodetic(position);
  fault = joined(position_faults(place));
  if (!fault.empty()) fault = "map_point is not near the ground: " + fault;
  return place;
}

/// What a place that far from the datum has come from is a mistake: of signs, of the order, or another city's.
constexpr double kFarthest_m = 1e6;
/// Where a place must be to be meant rather than the far one.
constexpr double kNear_m = 1e5;

/// The point of the map frame, or why there is none: in `fault`.
geometry_msgs::Point point_of(const GeodeticPosition& place, const LocalFrame& map, std::string& fault) {
  fault = joined(position_faults(place));
  if (!fault.empty()) return {};
  const Eigen::Vector3d position = map.to_local(place);
  if (position.norm() <= kFarthest_m) return to_point(position);
  std::ostringstream out;
  out << "the place is " << std::lround(1e-3 * position.norm()) << " km from the datum: must be within "
      << std::lround(1e-3 * kFarthest_m) << " km";
  const std::string hint = hint_of_far_place(place, map, kNear_m);
  fault = out.str() + (hint.empty() ? "" : "; " + hint);
  return {};
}

std::string element(std::size_t index) { return "element " + std::to_string(index) + ": "; }

/// Why the lengths do not fit; empty where they do.
std::string length_fault(const srv::FromLLArray::Request& request) {
  const std::size_t count = request.latitudes.size();
  const bool has_altitudes = !request.altitudes.empty();
  if (request.longitudes.size() == count && (!has_altitudes || request.altitudes.size() == count)) return {};
  std::ostringstream out;
  out << count << " latitudes, " << request.longitudes.size() << " longitudes, " << request.altitudes.size()
      << " altitudes: must be as many of each, or no altitudes";
  return out.str();
}

}  // namespace

srv::FromLL::Response answer(const srv::FromLL::Request& request, const MapFrame& map) {
  srv::FromLL::Response response;
  response.success = false;
  if (!map) {
    response.message = kNoDatum;
    return response;
  }
  const GeodeticPosition place{request.latitude, request.longitude, request.altitude};
  response.map_point = point_of(place, *map, response.message);
  response.success = response.message.empty();
  return response;
}

srv::ToLL::Response answer(const srv::ToLL::Request& request, const MapFrame& map) {
  srv::ToLL::Response response;
  response.success = false;
  if (!map) {
    response.message = kNoDatum;
    return response;
  }
  const GeodeticPosition place = place_of(request.map_point, *map, response.message);
  response.success = response.message.empty();
  if (!response.success) return response;
  response.latitude = place.latitude_deg;
  response.longitude = place.longitude_deg;
  response.altitude = place.altitude_m;
  return response;
}

srv::FromLLArray::Response answer(const srv::FromLLArray::Request& request, const MapFrame& map) {
  srv::FromLLArray::Response response;
  response.success = false;
  response.message = map ? length_fault(request) : kNoDatum;
  if (!response.message.empty()) return response;
  for (std::size_t i = 0; i < request.latitudes.size(); ++i) {
    const double altitude = request.altitudes.empty() ? map->datum().altitude_m : request.altitudes[i];
    const GeodeticPosition place{request.latitudes[i], request.longitudes[i], altitude};
    std::string fault;
    response.map_points.push_back(point_of(place, *map, fault));
    if (!fault.empty()) {
      response.message = element(i) + fault;
      response.map_points.clear();
      return response;
    }
  }
  response.success = true;
  return response;
}

srv::ToLLArray::Response answer(const srv::ToLLArray::Request& request, const MapFrame& map) {
  srv::ToLLArray::Response response;
  response.success = false;
  if (!map) {
    response.message = kNoDatum;
    return response;
  }
  for (std::size_t i = 0; i < request.map_points.size(); ++i) {
    std::string fault;
    const GeodeticPosition place = place_of(request.map_points[i], *map, fault);
    if (!fault.empty()) {
      srv::ToLLArray::Response refused;
      refused.success = false;
      refused.message = element(i) + fault;
      return refused;
    }
    response.latitudes.push_back(place.latitude_deg);
    response.longitudes.push_back(place.longitude_deg);
    response.altitudes.push_back(place.altitude_m);
  }
  response.success = true;
  return response;
}

}  // namespace urban_gnss
