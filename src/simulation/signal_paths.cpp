#include "urban_gnss_localization/simulation/signal_paths.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "urban_gnss_localization/simulation/knife_edge.hpp"

namespace urban_gnss {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kFacingTolerance = 1e-3;  // rad
constexpr double kOffWall_m = 1e-6;        // a reflected ray starts so far in front of its wall
constexpr double kOverEdge_m = 1e-3;       // the way over an edge passes so far above it

Eigen::Vector3d mirrored(const Eigen::Vector3d& direction, const Eigen::Vector2d& normal) {
  Eigen::Vector3d result = direction;
  result.head<2>() -= 2.0 * direction.head<2>().dot(normal) * normal;
  return result;
}

double distance_to_segment(const Eigen::Vector2d& point, const Wall& wall) {
  const Eigen::Vector2d along = wall.to - wall.from;
  const double share = std::clamp((point - wall.from).dot(along) / along.squaredNorm(), 0.0, 1.0);
  return (wall.from + share * along - point).norm();
}

/// Length of the ray from `origin` along the ascending unit vector `direction` within an upright cylinder.
double length_in_cylinder(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                          const Eigen::Vector2d& centre, double radius, double base, double top) {
  double begin = std::max(0.0, (base - origin.z()) / direction.z());
  double end = (top - origin.z()) / direction.z();
  const Eigen::Vector2d from_centre = origin.head<2>() - centre;
  const double outside = from_centre.squaredNorm() - radius * radius;
  const double squared_slope = direction.head<2>().squaredNorm();
  if (squared_slope < 1e-18) return outside < 0.0 ? std::max(0.0, end - begin) : 0.0;
  const double middle = -from_centre.dot(direction.head<2>()) / squared_slope;
  const double half_squared = middle * middle - outside / squared_slope;
  if (half_squared <= 0.0) return 0.0;
  begin = std::max(begin, middle - std::sqrt(half_squared));
  end = std::min(end, middle + std::sqrt(half_squared));
  return std::max(0.0, end - begin);
}

/// Horizontal distance beyond which a ray is above every roof by more than diffraction reaches: from there on, the
/// parameter of an edge is below kClearOfEdge. `rise_m` is the highest roof above the antenna.
double diffraction_range_m(double rise_m, double elevation_rad) {
  // With s = x^2 and d1 <= s / cos: s tan - rise >= -kClearOfEdge sqrt(lambda s / (2 cos)) / cos.
  const double cosine = std::cos(elevation_rad);
  const double slope = std::tan(elevation_rad);
  const double clearance = -kClearOfEdge * std::sqrt(0.5 * kL1Wavelength_m / cosine) / cosine;
  const double discriminant = clearance * clearance + 4.0 * slope * rise_m;
  if (discriminant < 0.0) return 0.0;
  const double root = 0.5 * (clearance + std::sqrt(discriminant)) / slope;
  return root * root;
}

}  // namespace

SignalTracer::SignalTracer(const World& world, const WallIndex& index, const SignalParameters& parameters)
    : world_(world), index_(index), parameters_(parameters) {
  for (const Building& building : world.buildings) highest_roof_m_ = std::max(highest_roof_m_, building.roof_m);
  for (const Wall& wall : index.walls()) {
    const auto is_same = [&](const Eigen::Vector2d& facing) {
      return (facing - wall.normal).norm() < kFacingTolerance;
    };
    const auto found = std::find_if(facings_.begin(), facings_.end(), is_same);
    facing_of_wall_.push_back(static_cast<int>(found - facings_.begin()));
    if (found == facings_.end()) facings_.push_back(wall.normal);
  }
}

void SignalTracer::trace(const Eigen::Vector3d& antenna, const Eigen::Vector3d& line_of_sight, SignalPaths& paths) {
  paths.is_blocked = false;
  paths.has_direct = true;
  paths.loss_db = 0.0;
  paths.excess_m = 0.0;
  paths.edge.setZero();
  paths.reflections.clear();
  if (!(line_of_sight.z() > 0.0) || index_.is_inside(antenna)) {
    paths.is_blocked = true;
    paths.has_direct = false;
    return;
  }
  trace_direct(antenna, line_of_sight, paths);
  if (parameters_.max_reflections == 0) return;
  find_near_walls(antenna.head<2>());
  reflect_once(antenna, line_of_sight, paths);
  reflect_repeatedly(antenna, line_of_sight, paths);
}

void SignalTracer::trace_direct(const Eigen::Vector3d& antenna, const Eigen::Vector3d& line_of_sight,
                                SignalPaths& paths) {
  paths.is_blocked = index_.cast(antenna, line_of_sight).has_value();

  KnifeEdge worst;
  worst.parameter = -kInfinity;
  const double horizontal = line_of_sight.head<2>().norm();
  if (horizontal > 1e-9) {
    const double elevation_rad = std::atan2(line_of_sight.z(), horizontal);
    const double slope = line_of_sight.z() / horizontal;
    const Eigen::Vector2d direction = line_of_sight.head<2>() / horizontal;
    index_.crossings(antenna.head<2>(), direction, diffraction_range_m(highest_roof_m_ - antenna.z(), elevation_rad),
                     crossings_);
    for (const auto& [distance_m, wall_number] : crossings_) {
      const Wall& wall = index_.walls()[wall_number];
      if (wall.base_m > antenna.z() + distance_m * slope) continue;
      const KnifeEdge edge = knife_edge(distance_m, wall.roof_m - antenna.z(), elevation_rad);
      if (edge.parameter <= worst.parameter) continue;
      worst = edge;
      paths.edge << antenna.head<2>() + distance_m * direction, wall.roof_m;
    }
  }
  paths.loss_db = knife_edge_loss_db(worst.parameter) + foliage_loss_db(antenna, line_of_sight);
  if (paths.is_blocked) {
    paths.has_direct = worst.parameter > 0.0;
    paths.excess_m = worst.excess_m;
    // A roof over the antenna or over the edge (a tunnel, a bridge) is not walked round.
    const auto meets_underside = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& direction, double range_m) {
      const auto hit = index_.cast(from, direction, range_m);
      return hit && hit->wall == WallIndex::kHorizontalFace;
    };
    const Eigen::Vector3d over_edge = paths.edge + kOverEdge_m * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d way = over_edge - antenna;
    if (paths.has_direct && (meets_underside(antenna, way.normalized(), way.norm()) ||
                             meets_underside(over_edge, line_of_sight, kInfinity))) {
      paths.has_direct = false;
    }
  }
  paths.has_direct = paths.has_direct && paths.loss_db <= parameters_.max_loss;
}

double SignalTracer::foliage_loss_db(const Eigen::Vector3d& antenna, const Eigen::Vector3d& line_of_sight) const {
  double loss_db = 0.0;
  for (const Tree& tree : world_.trees) {
    loss_db += tree.attenuation_db_per_m * length_in_cylinder(antenna, line_of_sight, tree.position,
                                                              tree.crown_radius_m, tree.crown_base_m, tree.crown_top_m);
    if (length_in_cylinder(antenna, line_of_sight, tree.position, tree.trunk_radius_m, 0.0, tree.crown_base_m) > 0.0) {
      loss_db += parameters_.trunk_loss;
    }
  }
  return loss_db;
}

void SignalTracer::find_near_walls(const Eigen::Vector2d& antenna) {
  if (near_what_ && *near_what_ == antenna) return;
  near_what_ = antenna;
  near_walls_.clear();
  near_facings_.clear();
  for (std::size_t i = 0; i < index_.walls().size(); ++i) {
    const Wall& wall = index_.walls()[i];
    if (distance_to_segment(antenna, wall) > parameters_.reflection_range) continue;
    near_walls_.push_back({static_cast<int>(i), wall.normal.dot(antenna - wall.from)});
    near_facings_.push_back(facing_of_wall_[i]);
  }
  std::sort(near_facings_.begin(), near_facings_.end());
  near_facings_.erase(std::unique(near_facings_.begin(), near_facings_.end()), near_facings_.end());
  if (near_facings_ != mirrored_facings_ || mirrors_.empty()) find_mirrors();
}

void SignalTracer::reflect_once(const Eigen::Vector3d& antenna, const Eigen::Vector3d& line_of_sight,
                                SignalPaths& paths) const {
  for (const auto& [number, distance_m] : near_walls_) {
    const Wall& wall = index_.walls()[number];
    const double approach = line_of_sight.head<2>().dot(wall.normal);
    if (distance_m <= 0.0 || approach <= 1e-12) continue;
    // Where the reversed ray meets the wall's plane; most walls are missed, which is cheaper to tell than to cast.
    const Eigen::Vector3d departure = mirrored(line_of_sight, wall.normal);
    const Eigen::Vector3d point = antenna + distance_m / approach * departure;
    const Eigen::Vector2d along = wall.to - wall.from;
    const double share = (point.head<2>() - wall.from).dot(along) / along.squaredNorm();
    if (share < 0.0 || share > 1.0 || point.z() < wall.base_m || point.z() > wall.roof_m) continue;
    Reflection reflection;
    if (follow(antenna, line_of_sight, departure, 1, reflection) == number) paths.reflections.push_back(reflection);
  }
}

void SignalTracer::find_mirrors() {
  mirrored_facings_ = near_facings_;
  mirrors_.assign(1, Eigen::Matrix2d::Identity());
  longest_chain_ = 0;
  std::size_t begin = 0;  // of the products of one mirror less
  while (longest_chain_ < parameters_.max_reflections) {
    const std::size_t end = mirrors_.size();
    for (std::size_t i = begin; i < end; ++i) {
      for (const int facing : near_facings_) {
        const Eigen::Vector2d& normal = facings_[facing];
        const Eigen::Matrix2d candidate = mirrors_[i] - 2.0 * normal * (normal.transpose() * mirrors_[i]);
        const auto is_same = [&](const Eigen::Matrix2d& known) {
          return (known - candidate).squaredNorm() < kFacingTolerance * kFacingTolerance;
        };
        if (std::any_of(mirrors_.begin(), mirrors_.end(), is_same)) continue;
        if (static_cast<int>(mirrors_.size()) == parameters_.max_directions) {
          mirrors_.resize(end);
          return;
        }
        mirrors_.push_back(candidate);
      }
    }
    begin = end;
    ++longest_chain_;
  }
}

void SignalTracer::reflect_repeatedly(const Eigen::Vector3d& antenna, const Eigen::Vector3d& line_of_sight,
                                      SignalPaths& paths) const {
  if (longest_chain_ < 2) return;
  for (const Eigen::Matrix2d& mirror : mirrors_) {
    Eigen::Vector3d departure = line_of_sight;
    departure.head<2>() = mirror * line_of_sight.head<2>();
    Reflection reflection;
    if (!follow(antenna, line_of_sight, departure, longest_chain_, reflection) || reflection.count < 2) continue;
    // A line of sight along a wall is hardly changed by its mirror, so that two departures may be one.
    const auto is_same = [&](const Reflection& known) {
      const Eigen::Vector3d known_departure = (known.points[0] - antenna).normalized();
      return known.count == reflection.count &&
             (known_departure - departure).norm() < 2.0 * kFacingTolerance * reflection.count;
    };
    if (std::none_of(paths.reflections.begin(), paths.reflections.end(), is_same)) {
      paths.reflections.push_back(reflection);
    }
  }
}

std::optional<int> SignalTracer::follow(const Eigen::Vector3d& antenna, const Eigen::Vector3d& line_of_sight,
                                        const Eigen::Vector3d& departure, int max_count, Reflection& reflection) const {
  const double range_squared = parameters_.reflection_range * parameters_.reflection_range;
  int first = WallIndex::kHorizontalFace;
  double way_m = 0.0;
  Eigen::Vector3d from = antenna;
  Eigen::Vector3d direction = departure;
  reflection.count = 0;
  reflection.loss_db = 0.0;
  while (const auto hit = index_.cast(from, direction)) {
    if (hit->wall == WallIndex::kHorizontalFace || reflection.count == max_count) return std::nullopt;
    const Wall& wall = index_.walls()[hit->wall];
    if (direction.head<2>().dot(wall.normal) >= 0.0) return std::nullopt;
    const Eigen::Vector3d point = from + hit->range_m * direction;
    if ((point - antenna).head<2>().squaredNorm() > range_squared) return std::nullopt;
    if (reflection.count == 0) first = hit->wall;
    way_m += hit->range_m;
    reflection.points[reflection.count++] = point;
    reflection.loss_db += wall.reflection_loss_db;
    if (reflection.loss_db > parameters_.max_loss) return std::nullopt;
    direction = mirrored(direction, wall.normal);
    from = point;
    from.head<2>() += kOffWall_m * wall.normal;
  }
  if (reflection.count == 0) return std::nullopt;
  if ((direction - line_of_sight).norm() > 2.0 * kFacingTolerance * reflection.count) return std::nullopt;
  if (reflection.count % 2 == 1) reflection.loss_db += parameters_.polarisation_loss;
  if (reflection.loss_db > parameters_.max_loss) return std::nullopt;
  reflection.excess_m = way_m - line_of_sight.dot(reflection.points[reflection.count - 1] - antenna);
  return first;
}

}  // namespace urban_gnss
