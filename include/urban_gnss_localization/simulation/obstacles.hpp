#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "urban_gnss_localization/geometry/pose2.hpp"

namespace urban_gnss {

/// A box that stands on z = base_m, turned about the vertical.
struct Box {
  Pose2 pose;  ///< of its centre, x along its length; map frame
  double length_m{0.0};
  double width_m{0.0};
  double base_m{0.0};
  double top_m{0.0};
};

struct CarParameters {
  std::vector<Eigen::Vector2d> loop;  ///< m, map frame: polyline that closes from the last point to the first
  double speed_mps{8.0};              ///< may be negative (the other way round, backwards) or 0 (parked)
  double phase_m{0.0};                ///< along the loop at time 0
  double length_m{4.5};
  double width_m{1.8};
  double height_m{1.5};
};

/// A car that drives along a loop for ever, at constant speed and with the heading of the leg it is on.
class Car {
 public:
  /// Throws std::invalid_argument where the loop has fewer than two different points or anything is not finite.
  explicit Car(const CarParameters& parameters);

  Box at(double time_s) const;
  const CarParameters& parameters() const { return parameters_; }

 private:
  CarParameters parameters_;
  std::vector<double> leg_ends_m_;  ///< along the loop
};

/// The part of a ray that is inside a body, m along the ray; enter may be negative where the origin is inside.
struct RayInterval {
  double enter_m{0.0};
  double exit_m{0.0};
};

/// Of the ray from `origin` along the unit vector `direction` (both directions of the line); nothing where it misses.
std::optional<RayInterval> intersect(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, const Box& box);

/// The same for a cylinder that stands upright around `centre` from `base_m` to `top_m`.
std::optional<RayInterval> intersect_cylinder(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                              const Eigen::Vector2d& centre, double radius_m, double base_m,
                                              double top_m);

}  // namespace urban_gnss
