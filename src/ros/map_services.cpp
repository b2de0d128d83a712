#include "urban_gnss_localization/ros/map_services.hpp"

#include <cmath>
#include <sstream>

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
  const Eigen::Vector3d point = map->to_local({request.latitude, request.longitude, request.altitude});
  response.success = point.allFinite();
  if (!response.success) response.message = "there is no such place";
  response.map_point = to_point(point);
  return response;
}

srv::ToLL::Response answer(const srv::ToLL::Request& request, const MapFrame& map) {
  srv::ToLL::Response response;
  response.success = false;
  if (!map) {
    response.message = kNoDatum;
    return response;
  }
  const GeodeticPosition place = map->to_geodetic(to_vector(request.map_point));
  response.success = std::isfinite(place.latitude_deg);
  if (!response.success) response.message = "map_point is not finite";
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
    for (const std::string& fault : position_faults(place)) {
      response.message += (response.message.empty() ? element(i) : "; ") + fault;
    }
    if (!response.message.empty()) {
      response.map_points.clear();
      return response;
    }
    response.map_points.push_back(to_point(map->to_local(place)));
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
    const GeodeticPosition place = map->to_geodetic(to_vector(request.map_points[i]));
    if (!std::isfinite(place.latitude_deg)) {
      srv::ToLLArray::Response refused;
      refused.success = false;
      refused.message = element(i) + "is not finite";
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
