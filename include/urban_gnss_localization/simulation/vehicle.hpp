#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/geometry/pose2.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"

namespace urban_gnss {

enum class Drive {
  kBicycle,       ///< driven rear axle, steered front wheel
  kDifferential,  ///< two driven wheels; turns on the spot
};
EnumNames<Drive> enum_names(Drive);

/// A road robot of the size of a small car.
struct VehicleParameters {
  Drive drive{Drive::kBicycle};
  double wheelbase{2.5};
  double max_speed{20.0};
  double max_acceleration{2.0};
  double max_deceleration{4.0};
  double max_steering{0.6};
  double max_steering_rate{0.8};
  double max_yaw_rate{1.5};
  double max_yaw_acceleration{3.0};
  double actuation_alpha1{1e-6};
  double actuation_alpha2{1e-6};
  double actuation_alpha3{2.5e-9};
  double actuation_alpha4{1e-6};
  double actuation_alpha5{1e-8};
  double actuation_alpha6{1e-6};
  double actuation_noise_interval{1.0};
  double antenna_x{1.0};
  double antenna_y{0.0};
  double antenna_z{1.8};

  void visit(ParameterVisitor& v) {
    v("drive", drive, "");
    v("wheelbase", wheelbase, positive(), "m", "for bicycle");
    v("max_speed", max_speed, positive(), "m/s", "forwards and backwards");
    v("max_acceleration", max_acceleration, positive(), "", "m/s^2");
    v("max_deceleration", max_deceleration, positive(), "", "m/s^2");
    v("max_steering", max_steering, between(0.01, 1.5), "rad", "for bicycle");
    v("max_steering_rate", max_steering_rate, positive(), "rad/s", "for bicycle");
    v("max_yaw_rate", max_yaw_rate, positive(), "rad/s", "for differential");
    v("max_yaw_acceleration", max_yaw_acceleration, positive(), "", "rad/s^2, for differential");
    v("actuation_alpha1", actuation_alpha1, non_negative(), "",
      "The actuation noise of Nishida et al., eq. (5)-(7), with the meaning that MotionParameters gives its "
      "odom_alpha1..6; on speed and steering angle for bicycle, on speed and yaw rate for differential");
    v("actuation_alpha2", actuation_alpha2, non_negative(), "", "");
    v("actuation_alpha3", actuation_alpha3, non_negative(), "", "");
    v("actuation_alpha4", actuation_alpha4, non_negative(), "", "");
    v("actuation_alpha5", actuation_alpha5, non_negative(), "", "");
    v("actuation_alpha6", actuation_alpha6, non_negative(), "", "");
    v("actuation_noise_interval", actuation_noise_interval, positive(), "", "s");
    v("antenna_x", antenna_x, any_number(), "m",
      "GNSS antenna in base_link, which lies on the ground below the rear (bicycle) or only (differential) axle");
    v("antenna_y", antenna_y, any_number(), "", "");
    v("antenna_z", antenna_z, non_negative(), "", "");
  }

  Eigen::Vector3d antenna() const { return {antenna_x, antenna_y, antenna_z}; }
  /// The noise parameters in the form in which the motion model takes them.
  MotionParameters motion() const;
};

/// The constant twist that moves `from` to `to` in `duration_s` > 0: the inverse of move(), for |yaw change| < pi. Of a
/// motion that no twist gives, the sideways part is left out.
Twist2 twist_between(const Pose2& from, const Pose2& to, double duration_s);

/// The true robot. It follows commanded twists as far as its drive can, with the actuation noise of eq. (5)-(8).
class Vehicle {
 public:
  /// Starts at rest at `start` (map frame), wheels straight. Requires parameters without faults.
  Vehicle(const VehicleParameters& parameters, const Pose2& start, std::uint64_t seed);

  /// Moves for `dt_s` > 0. Speed approaches the command's within the acceleration limits. The bicycle's wheel turns
  /// towards the command's curvature, so that a late speed does not change the path, and stays where it is for a
  /// command to stand; the differential drive's yaw rate approaches the command's. A command that is not finite brakes
  /// to a stand.
  void step(const Twist2& command, double dt_s);

  const VehicleParameters& parameters() const { return parameters_; }
  /// base_link in the map frame.
  const Pose2& pose() const { return pose_; }
  /// What truly moved it in the last step, actuation noise included: move() by it is the whole motion. Zero before the
  /// first.
  const Twist2& twist() const { return twist_; }
  /// Without actuation noise: smooth, at the end of the last step.
  const Twist2& nominal_twist() const { return nominal_; }
  double steering_rad() const { return steering_rad_; }
  /// Forward and leftward acceleration of base_link in base_link, m/s^2, mean over the last step, of the nominal
  /// motion: the white noise of eq. (5) has no derivative.
  const Eigen::Vector2d& acceleration() const { return acceleration_mps2_; }

  /// A point of base_link (m) in the map frame.
  Eigen::Vector3d point(const Eigen::Vector3d& in_base_link) const;
  /// Its true velocity in the map frame, m/s, from twist().
  Eigen::Vector3d velocity(const Eigen::Vector3d& in_base_link) const;
  Eigen::Vector3d antenna_position() const { return point(parameters_.antenna()); }
  Eigen::Vector3d antenna_velocity() const { return velocity(parameters_.antenna()); }

 private:
  Twist2 follow(const Twist2& command, double dt_s);

  VehicleParameters parameters_;
  MotionParameters motion_;
  RandomEngine engine_;
  Pose2 pose_;
  Twist2 twist_;
  Twist2 nominal_;
  double steering_rad_{0.0};
  Eigen::Vector2d acceleration_mps2_{Eigen::Vector2d::Zero()};
};

}  // namespace urban_gnss
