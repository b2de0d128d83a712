#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"
#include "urban_gnss_localization/occlusion/observed_space.hpp"
#include "urban_gnss_localization/occlusion/ray_tracer.hpp"

namespace urban_gnss {

/// Where the antenna is in the map of the surroundings, and how the sky is turned against it.
struct AntennaPose {
  Eigen::Vector3d position{Eigen::Vector3d::Zero()};  ///< m, map of the surroundings
  double position_sigma_m{0.0};                       ///< per horizontal axis
  /// Yaw of east in the map of the surroundings, rad: 0 where that map's axes are east and north.
  double east_yaw_rad{0.0};
  double east_yaw_sigma_rad{0.0};
};

struct VisibilityParameters {
  int azimuth_samples{5};
  int elevation_samples{3};
  double known_range{40.0};
  double permeable_loss{10.0};

  void visit(ParameterVisitor& v) {
    v("azimuth_samples", azimuth_samples, between(1, 101), "",
      "number of rays over the uncertainty of a satellite's azimuth");
    v("elevation_samples", elevation_samples, between(1, 101), "",
      "number of rays over the uncertainty of a satellite's elevation");
    v("known_range", known_range, positive(), "m",
      "length of the way to a satellite that the lidar must have observed for the way to be known");
    v("permeable_loss", permeable_loss, positive(), "m", "length of vegetation that blocks a signal as a wall does");
  }
};

/// What the map says of the way to one satellite.
struct SatelliteVisibility {
  double blocked_fraction{0.0};  ///< of the rays; vegetation counts as the share of permeable_loss that it is
  double known_fraction{0.0};    ///< of the way that has been looked at, or blocked
  bool is_blocked_ahead{false};  ///< the outcome of the central ray alone
  /// m, of the central ray to what blocks it; infinite where nothing does
  double range_m{std::numeric_limits<double>::infinity()};
};

/// Midpoints of `count` slices of equal probability of the standard normal distribution, ascending.
std::vector<double> normal_quantiles(int count);

/// VisibilityParameters with what follows from them, for all satellites.
struct VisibilitySampling {
  VisibilitySampling(const VisibilityParameters& p)  // NOLINT(google-explicit-constructor): nothing but these
      : parameters(p), across(normal_quantiles(p.azimuth_samples)), upwards(normal_quantiles(p.elevation_samples)) {}

  VisibilityParameters parameters;
  std::vector<double> across;   ///< quantiles, of the azimuth
  std::vector<double> upwards;  ///< likewise, of the elevation
};

/// Rays to a satellite, spread over the uncertainty of its direction: the heading's error is an error of the azimuth;
/// the rest is the antenna's place and the receiver's rounding (a step of `angle_resolution_rad`). `look` must be
/// finite. A displacement of the antenna turns nothing at infinity, but near walls it decides; every ray starts from a
/// place displaced across it by the quantile that its azimuth has.
SatelliteVisibility assess_visibility(const RayTracer& tracer, const ObservedSpace& observed,
                                      const AntennaPose& antenna, const LookAngles& look, double angle_resolution_rad,
                                      const VisibilitySampling& sampling);

/// The skyline in `azimuths` equal steps of azimuth (clockwise from north): the elevation, rad, up to which rays are
/// blocked, searched in steps of `step_rad`; 0 where none is. For the sky plot.
std::vector<double> skyline(const RayTracer& tracer, const AntennaPose& antenna, int azimuths, double step_rad);

}  // namespace urban_gnss
