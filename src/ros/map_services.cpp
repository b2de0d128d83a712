#include "urban_gnss_localization/ros/map_services.hpp"

#include <sstream>
#include <string>
#include <vector>

#include "urban_gnss_localization/geometry/pose_faults.hpp"

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
  response.message = joined(position_faults(place));
  response.success = response.message.empty();
  if (response.success) response.map_point = to_point(map->to_local(place));
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
    const std::string fault = joined(position_faults(place));
    if (!fault.empty()) {
      response.message = element(i) + fault;
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
