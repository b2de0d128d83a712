#include "urban_gnss_localization/simulation/compass.hpp"

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/geometry/angles.hpp"

namespace urban_gnss {
namespace {

constexpr std::uint64_t kCompassStream = 231;
/// Distances, in units of the reach, beyond which a field is nothing.
constexpr double kFar = 6.0;

/// Which way the i-th piece of steel is magnetised: 1 or -1.
double polarity(std::size_t i) { return (make_engine(i, kCompassStream)() & 1U) == 0U ? 1.0 : -1.0; }

Eigen::Vector2d nearest_on(const Wall& wall, const Eigen::Vector2d& place) {
  const Eigen::Vector2d edge = wall.to - wall.from;
  const double share = std::clamp((place - wall.from).dot(edge) / edge.squaredNorm(), 0.0, 1.0);
  return wall.from + share * edge;
}

}  // namespace

Eigen::Vector2d steel_field(const CompassParameters& parameters, const Eigen::Vector2d& place,
                            const std::vector<Wall>& walls, const std::vector<Box>& cars) {
  Eigen::Vector2d field = Eigen::Vector2d::Zero();
  if (parameters.steel_field == 0.0) return field;
  const double far_m = kFar * parameters.steel_reach;
  const auto strength = [&](double distance_m) {
    return parameters.steel_field * std::exp(-distance_m / parameters.steel_reach);
  };
  for (std::size_t i = 0; i < walls.size(); ++i) {
    const double distance_m = (place - nearest_on(walls[i], place)).norm();
    if (distance_m < far_m) field += polarity(i) * strength(distance_m) * walls[i].normal;
  }
  for (std::size_t i = 0; i < cars.size(); ++i) {
    const Eigen::Vector2d away = place - cars[i].pose.position();
    const double distance_m = std::max(0.0, away.norm() - 0.5 * cars[i].width_m);
    if (distance_m < far_m) field += polarity(walls.size() + i) * strength(distance_m) * away.normalized();
  }
  return field;
}

Compass::Compass(const CompassParameters& parameters, std::uint64_t seed)
    : parameters_(parameters), engine_(make_engine(seed, kCompassStream)) {
  offset_rad_ = parameters.offset + parameters.offset_sigma * draw_normal(engine_);
  wander_rad_ = parameters.wander_sigma * draw_normal(engine_);
}

double Compass::measure(double yaw_rad, const Eigen::Vector2d& field, double elapsed_s) {
  const double kept = std::exp(-elapsed_s / parameters_.wander_time);
  wander_rad_ = kept * wander_rad_ + parameters_.wander_sigma * std::sqrt(1.0 - kept * kept) * draw_normal(engine_);
  // The Earth's field is (0, 1). Where the field is turned to the left, what is taken for north is, and the robot seems
  // to stand farther to the right.
  const double turned_rad = std::atan2(-field.x(), 1.0 + field.y());
  return wrap_angle(yaw_rad + offset_rad_ + wander_rad_ - turned_rad + parameters_.noise * draw_normal(engine_));
}

double Compass::claimed_variance() const {
  return parameters_.noise * parameters_.noise + parameters_.offset_sigma * parameters_.offset_sigma;
}

}  // namespace urban_gnss
