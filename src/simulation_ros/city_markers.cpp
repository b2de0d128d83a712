#include "urban_gnss_localization/simulation_ros/city_markers.hpp"

#include <Eigen/Geometry>
#include <boost/polygon/polygon.hpp>
#include <cmath>

#include "urban_gnss_localization/ros/marker_parts.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"

namespace urban_gnss {
namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

constexpr double kRayLength_m = 60.0;  ///< drawn of the way to a satellite

std_msgs::ColorRGBA to_message(const Colour& colour) {
  std_msgs::ColorRGBA message;
  message.r = colour.r;
  message.g = colour.g;
  message.b = colour.b;
  message.a = colour.a;
  return message;
}

/// Triangles with a colour for each, since rviz does not light a list of triangles.
class Triangles {
 public:
  explicit Triangles(Marker& marker) : marker_(marker) {}

  void add(const geometry_msgs::Point& a, const geometry_msgs::Point& b, const geometry_msgs::Point& c,
           const Colour& colour) {
    for (const auto& corner : {a, b, c}) {
      marker_.points.push_back(corner);
      marker_.colors.push_back(to_message(colour));
    }
  }
  void add_quad(const geometry_msgs::Point& a, const geometry_msgs::Point& b, const geometry_msgs::Point& c,
                const geometry_msgs::Point& d, const Colour& colour) {
    add(a, b, c, colour);
    add(a, c, d, colour);
  }

 private:
  Marker& marker_;
};

/// A shade by the side's direction, as if the sun stood in the south-west; one sees the street through it.
Colour wall_colour(const Eigen::Vector2d& normal) {
  const auto light = static_cast<float>(0.5 + 0.18 * normal.dot(Eigen::Vector2d(-0.6, -0.8)));
  return {light, 0.97F * light, 0.92F * light, 0.55F};
}

void add_walls(const Building& building, Triangles& triangles) {
  const auto& corners = building.footprint;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d& a = corners[i];
    const Eigen::Vector2d& b = corners[(i + 1) % corners.size()];
    const Eigen::Vector2d side = (b - a).normalized();
    triangles.add_quad(point(a.x(), a.y(), building.base_m), point(b.x(), b.y(), building.base_m),
                       point(b.x(), b.y(), building.roof_m), point(a.x(), a.y(), building.roof_m),
                       wall_colour({side.y(), -side.x()}));
  }
}

/// A face at a constant height: the footprint in trapezoids, in whole millimetres, since that library counts in
/// integers.
void add_face(const Building& building, double height_m, const Colour& colour, Triangles& triangles) {
  namespace bp = boost::polygon;
  std::vector<bp::point_data<int>> corners;
  for (const Eigen::Vector2d& corner : building.footprint) {
    corners.emplace_back(static_cast<int>(std::lround(1000.0 * corner.x())),
                         static_cast<int>(std::lround(1000.0 * corner.y())));
  }
  bp::polygon_data<int> polygon(corners.begin(), corners.end());
  bp::polygon_set_data<int> set;
  set.insert(polygon);
  std::vector<bp::polygon_data<int>> trapezoids;
  set.get_trapezoids(trapezoids);
  for (const auto& trapezoid : trapezoids) {
    std::vector<geometry_msgs::Point> outline;
    for (const auto& corner : trapezoid) outline.push_back(point(0.001 * corner.x(), 0.001 * corner.y(), height_m));
    for (std::size_t i = 2; i < outline.size(); ++i) triangles.add(outline[0], outline[i - 1], outline[i], colour);
  }
}

/// The roof's and the corners' edges.
void add_outline(const Building& building, Marker& edges) {
  const auto& corners = building.footprint;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d& a = corners[i];
    const Eigen::Vector2d& b = corners[(i + 1) % corners.size()];
    const auto top = point(a.x(), a.y(), building.roof_m);
    for (const auto& end : {top, point(b.x(), b.y(), building.roof_m), top, point(a.x(), a.y(), building.base_m)}) {
      edges.points.push_back(end);
    }
  }
}

Marker ground(const World& world, const Route& route, const ros::Time& time, const std::string& map_frame) {
  Eigen::AlignedBox2d bounds;
  for (const RouteWaypoint& waypoint : route.waypoints) bounds.extend(waypoint.position);
  for (const Building& building : world.buildings) {
    for (const Eigen::Vector2d& corner : building.footprint) bounds.extend(corner);
  }
  constexpr double kMargin_m = 50.0;
  Marker marker = make_marker("ground", 0, Marker::CUBE, {0.28F, 0.29F, 0.30F, 1.0F}, time, map_frame);
  marker.pose.position = point(bounds.center().x(), bounds.center().y(), -0.1);
  set_scale(marker, bounds.sizes().x() + 2.0 * kMargin_m, bounds.sizes().y() + 2.0 * kMargin_m, 0.1);
  return marker;
}

void add_trees(const World& world, const ros::Time& time, const std::string& map_frame, MarkerArray& markers) {
  for (std::size_t i = 0; i < world.trees.size(); ++i) {
    const Tree& tree = world.trees[i];
    const auto cylinder = [&](const char* ns, double radius, double base, double top, const Colour& colour) {
      Marker marker = make_marker(ns, static_cast<int>(i), Marker::CYLINDER, colour, time, map_frame);
      marker.pose.position = point(tree.position.x(), tree.position.y(), 0.5 * (base + top));
      set_scale(marker, 2.0 * radius, 2.0 * radius, top - base);
      markers.markers.push_back(marker);
    };
    cylinder("trunks", tree.trunk_radius_m, 0.0, tree.crown_base_m, {0.35F, 0.25F, 0.15F, 1.0F});
    cylinder("crowns", tree.crown_radius_m, tree.crown_base_m, tree.crown_top_m, {0.2F, 0.45F, 0.2F, 0.6F});
  }
}

Colour colour_of(PathClass path_class) {
  switch (path_class) {
    case PathClass::kDirect: return {0.2F, 0.9F, 0.3F, 0.9F};
    case PathClass::kMultipath: return {1.0F, 0.85F, 0.1F, 0.9F};
    case PathClass::kNlos: return {1.0F, 0.2F, 0.15F, 0.9F};
    case PathClass::kBlocked: break;
  }
  return {0.6F, 0.6F, 0.65F, 0.35F};
}

}  // namespace

MarkerArray world_markers(const World& world, const Route& route, const ros::Time& time, const std::string& map_frame) {
  MarkerArray markers;
  markers.markers.push_back(ground(world, route, time, map_frame));
  Marker buildings = make_marker("buildings", 0, Marker::TRIANGLE_LIST, {1.0F, 1.0F, 1.0F, 1.0F}, time, map_frame);
  set_scale(buildings, 1.0, 1.0, 1.0);
  Marker edges = make_marker("edges", 0, Marker::LINE_LIST, {0.85F, 0.85F, 0.8F, 0.8F}, time, map_frame);
  edges.scale.x = 0.25;
  Triangles triangles(buildings);
  for (const Building& building : world.buildings) {
    add_walls(building, triangles);
    add_face(building, building.roof_m, {0.72F, 0.72F, 0.7F, 0.2F}, triangles);
    add_outline(building, edges);
  }
  if (!buildings.points.empty()) {  // rviz warns of an empty list
    markers.markers.push_back(buildings);
    markers.markers.push_back(edges);
  }
  add_trees(world, time, map_frame, markers);
  Marker line = make_marker("route", 0, Marker::LINE_STRIP, {0.75F, 0.75F, 0.8F, 0.7F}, time, map_frame);
  line.scale.x = 0.3;
  for (const RouteWaypoint& waypoint : route.waypoints) {
    line.points.push_back(point(waypoint.position.x(), waypoint.position.y(), 0.05));
  }
  if (route.loop) line.points.push_back(line.points.front());
  markers.markers.push_back(line);
  return markers;
}

MarkerArray traffic_markers(const Pose2& truth, const LidarParameters& body, const std::vector<Car>& cars,
                            double time_s, const ros::Time& time, const std::string& map_frame) {
  MarkerArray markers;
  const auto box = [&](const char* ns, int id, const Pose2& pose, const Eigen::Vector3d& size, double base,
                       const Colour& colour) {
    Marker marker = make_marker(ns, id, Marker::CUBE, colour, time, map_frame);
    marker.pose = to_message(pose);
    marker.pose.position.z = base + 0.5 * size.z();
    set_scale(marker, size.x(), size.y(), size.z());
    markers.markers.push_back(marker);
  };
  const Eigen::Vector2d centre = transform_point(truth, {0.5 * (body.body_rear + body.body_front), 0.0});
  box("truth", 0, {centre.x(), centre.y(), truth.yaw},
      {body.body_front - body.body_rear, std::max(body.body_width, 0.1), body.body_top - body.body_bottom},
      body.body_bottom, {0.95F, 0.95F, 0.95F, 1.0F});
  for (std::size_t i = 0; i < cars.size(); ++i) {
    const Box car = cars[i].at(time_s);
    box("cars", static_cast<int>(i), car.pose, {car.length_m, car.width_m, car.top_m - car.base_m}, car.base_m,
        {0.35F, 0.45F, 0.75F, 1.0F});
  }
  return markers;
}

MarkerArray signal_markers(const SignalsEvent& signals, const ros::Time& time, const std::string& map_frame) {
  MarkerArray markers;
  Marker clear = make_marker("", 0, Marker::SPHERE, {}, time, map_frame);
  clear.action = Marker::DELETEALL;  // satellites set
  markers.markers.push_back(clear);
  for (std::size_t i = 0; i < signals.signals.size(); ++i) {
    const SignalTruth& signal = signals.signals[i];
    const PathClass path_class = signal.report.path_class;
    const Colour colour = colour_of(path_class);
    Marker ray = make_marker("signals", static_cast<int>(i), Marker::LINE_STRIP, colour, time, map_frame);
    ray.scale.x = path_class == PathClass::kBlocked ? 0.1 : 0.3;
    for (const Eigen::Vector3d& corner : signal.path) ray.points.push_back(point(corner));
    const Eigen::Vector3d end = signal.path.back() + kRayLength_m * line_of_sight(signal.look);
    ray.points.push_back(point(end));
    Marker label =
        make_marker("satellites", static_cast<int>(i), Marker::TEXT_VIEW_FACING, {1, 1, 1, 0.9F}, time, map_frame);
    label.pose.position = point(end);
    label.scale.z = 3.0;
    label.text = satellite_name(signal.report.id);
    markers.markers.push_back(ray);
    markers.markers.push_back(label);
  }
  return markers;
}

MarkerArray fix_markers(const ReceiverFix& fix, const Eigen::Vector3d& error, const ros::Time& time,
                        const std::string& map_frame) {
  constexpr double kHeight_m = 0.3;  // on the ground, where the robot is, whatever height the fix has
  const Eigen::Vector3d place(fix.position.x(), fix.position.y(), kHeight_m);
  Marker disc = make_marker("claimed", 0, Marker::CYLINDER, {1.0F, 0.95F, 0.1F, 0.3F}, time, map_frame);
  disc.pose.position = point(place);
  set_scale(disc, 4.0 * std::sqrt(fix.covariance(0, 0)), 4.0 * std::sqrt(fix.covariance(1, 1)), 0.1);
  Marker ball = make_marker("fix", 0, Marker::SPHERE, {1.0F, 0.95F, 0.1F, 1.0F}, time, map_frame);
  ball.pose.position = point(place);
  set_scale(ball, 2.0, 2.0, 2.0);
  Marker line = make_marker("fix_error", 0, Marker::LINE_STRIP, {1.0F, 0.95F, 0.1F, 0.9F}, time, map_frame);
  line.scale.x = 0.3;
  line.points = {point(place), point(place.x() - error.x(), place.y() - error.y(), kHeight_m)};
  MarkerArray markers;
  markers.markers = {disc, ball, line};
  return markers;
}

}  // namespace urban_gnss
