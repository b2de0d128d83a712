#include "urban_gnss_localization/simulation/polygon.hpp"

// Boost.Geometry includes a header that Boost calls deprecated, with a message at each compilation.
#define BOOST_ALLOW_DEPRECATED_HEADERS

#include <algorithm>
#include <boost/geometry.hpp>
#include <boost/geometry/geometries/multi_point.hpp>
#include <boost/geometry/geometries/point_xy.hpp>
#include <boost/geometry/geometries/polygon.hpp>
#include <cmath>
#include <sstream>

#include "urban_gnss_localization/simulation/world.hpp"

namespace urban_gnss {
namespace {

/// m: nearer corners are one corner, and a narrower building is none.
constexpr double kSmallestLength = 1e-6;

std::string text(const Eigen::Vector2d& point) {
  std::ostringstream out;
  out << "(" << point.x() << ", " << point.y() << ")";
  return out.str();
}

std::string crossing_fault(const Polygon& polygon) {
  namespace bg = boost::geometry;
  bg::model::polygon<bg::model::d2::point_xy<double>> ring;
  for (const Eigen::Vector2d& corner : polygon)
    bg::append(ring.outer(), bg::model::d2::point_xy<double>(corner.x(), corner.y()));
  bg::correct(ring);  // closes and orients
  bg::validity_failure_type failure;
  if (bg::is_valid(ring, failure)) return "";
  // What cannot be oriented has as much area to the left as to the right of its sides.
  if (failure == bg::failure_wrong_orientation) return "not a simple polygon (sides cross or overlap)";
  std::string message;
  bg::is_valid(ring, message);
  return "not a simple polygon (" + message.substr(0, message.find(';')) + ")";  // the rest is Boost's own
}

}  // namespace

double signed_area(const Polygon& polygon) {
  double doubled = 0.0;
  for (std::size_t i = 0, last = polygon.size() - 1; i < polygon.size(); last = i++) {
    // Relative to the first corner, so that a small polygon far from the origin keeps its digits.
    const Eigen::Vector2d a = polygon[last] - polygon[0];
    const Eigen::Vector2d b = polygon[i] - polygon[0];
    doubled += a.x() * b.y() - a.y() * b.x();
  }
  return 0.5 * doubled;
}

Polygon counter_clockwise(Polygon polygon) {
  if (signed_area(polygon) < 0.0) std::reverse(polygon.begin(), polygon.end());
  return polygon;
}

bool contains(const Polygon& polygon, const Eigen::Vector2d& point) {
  bool is_inside = false;
  for (std::size_t i = 0, last = polygon.size() - 1; i < polygon.size(); last = i++) {
    // From the lower to the upper end, so that the side of a shared edge is the same for both its polygons.
    const bool is_upward = polygon[last].y() <= polygon[i].y();
    const Eigen::Vector2d& low = is_upward ? polygon[last] : polygon[i];
    const Eigen::Vector2d& high = is_upward ? polygon[i] : polygon[last];
    if (point.y() < low.y() || point.y() >= high.y()) continue;
    const Eigen::Vector2d edge = high - low;
    const Eigen::Vector2d offset = point - low;
    if (edge.x() * offset.y() - edge.y() * offset.x() > 0.0) is_inside = !is_inside;
  }
  return is_inside;
}

std::string polygon_fault(const Polygon& polygon) {
  if (polygon.size() < 3) return "needs at least 3 corners, has " + std::to_string(polygon.size());
  for (const Eigen::Vector2d& corner : polygon) {
    if (!corner.allFinite()) return "corner " + text(corner) + " is not finite";
    if (!is_in_world(corner)) return "corner " + text(corner) + " is more than 100 km from the origin";
  }
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    for (std::size_t j = i + 1; j < polygon.size(); ++j) {
      if ((polygon[i] - polygon[j]).norm() >= kSmallestLength) continue;
      const bool is_closed = i == 0 && j + 1 == polygon.size();
      return "corner " + text(polygon[j]) + " is repeated" + (is_closed ? " (do not close the polygon)" : "");
    }
  }
  double perimeter = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) perimeter += (polygon[(i + 1) % polygon.size()] - polygon[i]).norm();
  // A bow tie may have no area either; that it crosses itself says more.
  const bool is_flat = std::abs(signed_area(polygon)) < kSmallestLength * perimeter;
  const std::string crossing = crossing_fault(polygon);
  if (is_flat && (polygon.size() == 3 || crossing.empty())) return "has no area";
  return crossing;
}

Polygon convex_hull(const std::vector<Eigen::Vector2d>& points) {
  if (points.empty()) return {};
  namespace bg = boost::geometry;
  using Point = bg::model::d2::point_xy<double>;
  bg::model::multi_point<Point> corners;
  for (const Eigen::Vector2d& point : points) corners.emplace_back(point.x(), point.y());
  bg::model::polygon<Point, false, false> hull;  // counter-clockwise, not closed
  bg::convex_hull(corners, hull);
  Polygon polygon;
  for (const Point& corner : hull.outer()) polygon.emplace_back(corner.x(), corner.y());
  return polygon;
}

}  // namespace urban_gnss
