#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/simulation/obstacles.hpp"
#include "urban_gnss_localization/simulation/wall_index.hpp"

namespace urban_gnss {

/// The magnetometer behind the orientation that an IMU publishes.
struct CompassParameters {
  bool enabled{true};
  double noise{0.01};
  double offset{0.0};
  double offset_sigma{0.05};
  double wander_sigma{0.0};
  double wander_time{60.0};
  double steel_field{0.3};
  double steel_reach{2.0};

  void visit(ParameterVisitor& v) {
    v("enabled", enabled, "whether the IMU publishes an orientation");
    v("noise", noise, non_negative(), "rad", "white, of each message");
    v("offset", offset, any_number(), "rad", "constant error of the heading, counter-clockwise: declination, mounting");
    v("offset_sigma", offset_sigma, non_negative(), "rad", "of a constant error that is drawn: the robot's own iron");
    v("wander_sigma", wander_sigma, non_negative(), "rad", "of an error that wanders (first-order Gauss-Markov)");
    v("wander_time", wander_time, positive(), "s", "its correlation time");
    v("steel_field", steel_field, non_negative(), "",
      "field of a wall or a car at its surface, of the Earth's horizontal field; 0: no steel");
    v("steel_reach", steel_reach, positive(), "m", "distance in which that field falls to 1/e");
  }
};

/// The field of walls and cars at a place, in units of the Earth's horizontal field, east and north: each is magnetised
/// along its normal, one way or the other, and its field falls with exp(-distance / reach). It is the same whenever the
/// robot comes by.
Eigen::Vector2d steel_field(const CompassParameters& parameters, const Eigen::Vector2d& place,
                            const std::vector<Wall>& walls, const std::vector<Box>& cars);

/// Tells the heading by the magnetic field, as an IMU's orientation does: an error that is constant, one that wanders,
/// the angle by which steel turns the field, and noise.
class Compass {
 public:
  /// Requires parameters without faults.
  Compass(const CompassParameters& parameters, std::uint64_t seed);

  /// rad, counter-clockwise from east, for the true yaw; `field`: steel_field() there. `elapsed_s` >= 0: since the
  /// last.
  double measure(double yaw_rad, const Eigen::Vector2d& field, double elapsed_s);
  /// rad^2, what the unit claims: noise and constant error.
  double claimed_variance() const;

 private:
  CompassParameters parameters_;
  RandomEngine engine_;
  double offset_rad_;
  double wander_rad_;
};

}  // namespace urban_gnss
