#pragma once

#include <Eigen/Core>
#include <deque>
#include <optional>
#include <string>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/gnss/heading_initializer.hpp"
#include "urban_gnss_localization/localizers/localizer.hpp"
#include "urban_gnss_localization/motion/odometry_history.hpp"

namespace urban_gnss {

/// What is believed of the receiver's velocity.
struct VelocityParameters {
  bool use_gps_velocity{true};
  double velocity_sigma_default{0.3};
  double velocity_sigma_floor{0.05};

  void visit(ParameterVisitor& v) {
    v("use_gps_velocity", use_gps_velocity,
      "whether gps/velocity is subscribed: for localizers that can use it, and to check the odometry's speed");
    v("velocity_sigma_default", velocity_sigma_default, positive(), "m/s per axis",
      "standard deviation of a velocity for which the receiver declares no covariance");
    v("velocity_sigma_floor", velocity_sigma_floor, positive(), "m/s per axis",
      "standard deviation whose square is added to the declared covariance of a velocity");
  }
};

/// Why a velocity of the receiver cannot be used; empty where it can be.
std::string velocity_fault(const RawVelocity& velocity);

/// A velocity of the receiver beside that of the odometry.
struct MatchedVelocity {
  VelocityPair pair;                ///< for the search of the heading
  VelocityMeasurement measurement;  ///< for the localizer
};

/// Compares a velocity with that of the antenna by the odometry, at the velocity's stamp. `antenna` in the base frame
/// (m). Nothing where the odometry of that stamp is not remembered.
std::optional<MatchedVelocity> match_velocity(const RawVelocity& velocity, const OdometryHistory& history,
                                              const Eigen::Vector2d& antenna);

/// Velocities of the receiver that wait for the odometry of their stamps, each with a covariance that can be worked
/// with: the declared one plus the floor, or the default. Of too many that wait, the oldest are dropped.
class VelocityQueue {
 public:
  /// Requires parameters without faults.
  explicit VelocityQueue(const VelocityParameters& parameters) : parameters_(parameters) {}

  /// Requires a velocity without fault.
  void add(const RawVelocity& velocity);
  /// Takes out the next, if the odometry has come to its stamp.
  std::optional<RawVelocity> take(Stamp latest_odometry);

  void reset() { *this = VelocityQueue(parameters_); }

 private:
  VelocityParameters parameters_;
  std::deque<RawVelocity> waiting_;
};

}  // namespace urban_gnss
