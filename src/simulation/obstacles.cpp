#include "urban_gnss_localization/simulation/obstacles.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "urban_gnss_localization/simulation/world.hpp"

namespace urban_gnss {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Cuts `interval` to where low <= origin + t direction <= high. A ray along a face from within it counts as inside.
void clip_to_slab(double origin, double direction, double low, double high, RayInterval& interval) {
  if (direction == 0.0) {
    if (origin < low || origin > high) interval = {kInfinity, -kInfinity};
    return;
  }
  double enter = (low - origin) / direction;
  double exit = (high - origin) / direction;
  if (enter > exit) std::swap(enter, exit);
  interval.enter_m = std::max(interval.enter_m, enter);
  interval.exit_m = std::min(interval.exit_m, exit);
}

std::optional<RayInterval> non_empty(const RayInterval& interval) {
  if (!(interval.enter_m <= interval.exit_m)) return std::nullopt;
  return interval;
}

}  // namespace

Car::Car(const CarParameters& parameters) : parameters_(parameters) {
  const CarParameters& p = parameters_;
  if (!std::isfinite(p.speed_mps) || !std::isfinite(p.phase_m)) {
    throw std::invalid_argument("car: speed and phase must be finite");
  }
  for (const double size : {p.length_m, p.width_m, p.height_m}) {
    if (!(size > 0.0 && std::isfinite(size))) throw std::invalid_argument("car: length, width, height must be > 0");
  }
  double travelled = 0.0;
  for (std::size_t i = 0; i < p.loop.size(); ++i) {
    if (!p.loop[i].allFinite()) throw std::invalid_argument("car: the loop's points must be finite");
    if (!is_in_world(p.loop[i]))
      throw std::invalid_argument("car: the loop leaves the world of 100 km about the origin");
    travelled += (p.loop[(i + 1) % p.loop.size()] - p.loop[i]).norm();
    leg_ends_m_.push_back(travelled);
  }
  if (!(travelled > 0.0)) throw std::invalid_argument("car: the loop needs two different points");
}

Box Car::at(double time_s) const {
  const double round = leg_ends_m_.back();
  const double distance = parameters_.phase_m + parameters_.speed_mps * time_s;
  const double along = distance - round * std::floor(distance / round);
  // The first leg that ends farther on, so that legs of no length are never it; rounding can give `round` itself.
  const auto found = std::upper_bound(leg_ends_m_.begin(), leg_ends_m_.end(), along);
  const auto leg = found != leg_ends_m_.end() ? found : std::lower_bound(leg_ends_m_.begin(), leg_ends_m_.end(), round);
  const std::size_t i = static_cast<std::size_t>(leg - leg_ends_m_.begin());
  const Eigen::Vector2d from = parameters_.loop[i];
  const Eigen::Vector2d to = parameters_.loop[(i + 1) % parameters_.loop.size()];
  const Eigen::Vector2d heading = (to - from).normalized();
  const Eigen::Vector2d position = to - (leg_ends_m_[i] - along) * heading;

  Box box;
  box.pose = {position.x(), position.y(), std::atan2(heading.y(), heading.x())};
  box.length_m = parameters_.length_m;
  box.width_m = parameters_.width_m;
  box.top_m = parameters_.height_m;
  return box;
}

std::optional<RayInterval> intersect(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, const Box& box) {
  const Eigen::Vector2d local_origin = transform_point(inverse(box.pose), origin.head<2>());
  const Eigen::Vector2d local_direction = transform_point({0.0, 0.0, -box.pose.yaw}, direction.head<2>());
  RayInterval interval{-kInfinity, kInfinity};
  clip_to_slab(local_origin.x(), local_direction.x(), -0.5 * box.length_m, 0.5 * box.length_m, interval);
  clip_to_slab(local_origin.y(), local_direction.y(), -0.5 * box.width_m, 0.5 * box.width_m, interval);
  clip_to_slab(origin.z(), direction.z(), box.base_m, box.top_m, interval);
  return non_empty(interval);
}

std::optional<RayInterval> intersect_cylinder(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                              const Eigen::Vector2d& centre, double radius_m, double base_m,
                                              double top_m) {
  // |o + t d|^2 = r^2 in the plane, o from the centre.
  const Eigen::Vector2d o = origin.head<2>() - centre;
  const Eigen::Vector2d d = direction.head<2>();
  const double a = d.squaredNorm();
  const double outside = o.squaredNorm() - radius_m * radius_m;
  RayInterval interval{-kInfinity, kInfinity};
  if (a > 0.0) {
    const double b = o.dot(d);
    const double discriminant = b * b - a * outside;
    if (discriminant < 0.0) return std::nullopt;
    const double root = std::sqrt(discriminant);
    interval = {(-b - root) / a, (-b + root) / a};
  } else if (outside > 0.0) {
    return std::nullopt;
  }
  clip_to_slab(origin.z(), direction.z(), base_m, top_m, interval);
  return non_empty(interval);
}

}  // namespace urban_gnss
