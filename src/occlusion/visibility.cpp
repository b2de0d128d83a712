#include "urban_gnss_localization/occlusion/visibility.hpp"

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>

#include "urban_gnss_localization/geometry/angles.hpp"

namespace urban_gnss {
namespace {

/// A direction of the sky in the map of the surroundings.
Eigen::Vector3d direction(const LookAngles& look, double east_yaw_rad) {
  const Eigen::Vector3d enu = line_of_sight(look);
  const double c = std::cos(east_yaw_rad);
  const double s = std::sin(east_yaw_rad);
  return {c * enu.x() - s * enu.y(), s * enu.x() + c * enu.y(), enu.z()};
}

}  // namespace

std::vector<double> normal_quantiles(int count) {
  const boost::math::normal_distribution<double> normal;
  std::vector<double> quantiles;
  for (int i = 0; i < count; ++i) quantiles.push_back(boost::math::quantile(normal, (i + 0.5) / count));
  return quantiles;
}

SatelliteVisibility assess_visibility(const RayTracer& tracer, const ObservedSpace& observed,
                                      const AntennaPose& antenna, const LookAngles& look, double angle_resolution_rad,
                                      const VisibilitySampling& sampling) {
  const double rounding_sigma = angle_resolution_rad / std::sqrt(12.0);
  const double azimuth_sigma = std::hypot(antenna.east_yaw_sigma_rad, rounding_sigma);

  SatelliteVisibility visibility;
  const Eigen::Vector3d centre = direction(look, antenna.east_yaw_rad);
  const RayOutcome ahead = tracer.trace(antenna.position, centre);
  visibility.is_blocked_ahead = ahead.blocked;
  visibility.range_m = ahead.range_m;
  const Eigen::Vector3d sideways = Eigen::Vector3d(centre.y(), -centre.x(), 0.0).normalized();

  double blocked = 0.0;
  double known = 0.0;
  for (const double a : sampling.across) {
    const Eigen::Vector3d origin = antenna.position + a * antenna.position_sigma_m * sideways;
    for (const double e : sampling.upwards) {
      const LookAngles ray{look.azimuth_rad + a * azimuth_sigma,
                           std::clamp(look.elevation_rad + e * rounding_sigma, 0.0, 0.5 * kPi)};
      const Eigen::Vector3d towards = direction(ray, antenna.east_yaw_rad);
      const bool is_central = a == 0.0 && ray.elevation_rad == look.elevation_rad;
      const RayOutcome outcome = is_central ? ahead : tracer.trace(origin, towards);
      const double share =
          outcome.blocked ? 1.0 : std::min(1.0, outcome.vegetation_m / sampling.parameters.permeable_loss);
      blocked += share;
      // What blocks has been seen. A free way is known as far as it has been looked at.
      known += outcome.blocked ? 1.0 : observed.known_fraction(origin, towards, sampling.parameters.known_range);
    }
  }
  const double rays = static_cast<double>(sampling.across.size() * sampling.upwards.size());
  visibility.blocked_fraction = blocked / rays;
  visibility.known_fraction = known / rays;
  return visibility;
}

std::vector<double> skyline(const RayTracer& tracer, const AntennaPose& antenna, int azimuths, double step_rad) {
  std::vector<double> elevations(static_cast<std::size_t>(azimuths), 0.0);
  for (int i = 0; i < azimuths; ++i) {
    const double azimuth = 2.0 * kPi * i / azimuths;
    for (double elevation = 0.5 * kPi - step_rad; elevation > 0.0; elevation -= step_rad) {
      if (!tracer.trace(antenna.position, direction({azimuth, elevation}, antenna.east_yaw_rad)).blocked) continue;
      elevations[static_cast<std::size_t>(i)] = elevation;
      break;
    }
  }
  return elevations;
}

}  // namespace urban_gnss
