#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace urban_gnss {

/// Corners in order, m, not closed: the last is joined to the first.
using Polygon = std::vector<Eigen::Vector2d>;

/// m^2, positive where the corners run counter-clockwise (the shoelace formula).
double signed_area(const Polygon& polygon);

/// The same polygon with its corners counter-clockwise.
Polygon counter_clockwise(Polygon polygon);

/// Whether the point is inside a simple polygon, by the parity of the edges that a ray towards +x crosses. Of polygons
/// that share an edge exactly one has the points near it, whatever the rounding.
bool contains(const Polygon& polygon, const Eigen::Vector2d& point);

/// The smallest convex polygon around the points (m), counter-clockwise. Empty without points.
Polygon convex_hull(const std::vector<Eigen::Vector2d>& points);

/// Why the corners, in either orientation, make no footprint: too few, not finite, too far, repeated, without an area,
/// or sides that cross or touch each other. Empty where they do make one.
std::string polygon_fault(const Polygon& polygon);

}  // namespace urban_gnss
