#pragma once

#include <geometry_msgs/Point.h>
#include <ros/time.h>
#include <visualization_msgs/Marker.h>

#include <Eigen/Core>
#include <string>

namespace urban_gnss {

struct Colour {
  float r, g, b, a;
};

inline visualization_msgs::Marker make_marker(const char* ns, int id, int type, Colour colour, const ros::Time& time,
                                              const std::string& frame) {
  visualization_msgs::Marker marker;
  marker.header.frame_id = frame;
  marker.header.stamp = time;
  marker.ns = ns;
  marker.id = id;
  marker.type = type;
  marker.action = visualization_msgs::Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.color.r = colour.r;
  marker.color.g = colour.g;
  marker.color.b = colour.b;
  marker.color.a = colour.a;
  return marker;
}

inline geometry_msgs::Point point(double x, double y, double z) {
  geometry_msgs::Point p;
  p.x = x;
  p.y = y;
  p.z = z;
  return p;
}

inline geometry_msgs::Point point(const Eigen::Vector3d& p) { return point(p.x(), p.y(), p.z()); }

inline void set_scale(visualization_msgs::Marker& marker, double x, double y, double z) {
  marker.scale.x = x;
  marker.scale.y = y;
  marker.scale.z = z;
}

}  // namespace urban_gnss
