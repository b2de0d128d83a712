#pragma once

#include <complex>
#include <optional>

#include "urban_gnss_localization/motion/odometry_history.hpp"

namespace urban_gnss {

/// Which of two sources of motion those that saw it from outside agree with.
enum class MotionSide { kUndecided, kPose, kTwist };

/// Vectors that a receiver measured (displacements between fixes, or velocities), beside those of two odometries, which
/// each may be turned by any angle and scaled by up to a third. The one that leaves less of the measured is right, once
/// the likelihood says so clearly.
class MotionWitness {
 public:
  void add(const std::complex<double>& measured, const std::complex<double>& by_pose,
           const std::complex<double>& by_twist);
  MotionSide side() const;
  /// Whether the pose's leave little of the measured, whatever the twist's leave.
  bool fits_pose() const;

 private:
  struct Fit {
    double square{0.0};
    std::complex<double> product;

    void add(const std::complex<double>& measured, const std::complex<double>& told);
    void fade(double factor);
    /// Of the measured squares, what the best turn and scale leave.
    double left(double measured_square) const;
  };
  double count_{0.0};
  double measured_square_{0.0};
  Fit pose_;
  Fit twist_;
};

/// The paths by an odometry's pose and by its twist, for whoever saw the robot move.
class PathWitness {
 public:
  /// A step by each; stamps ascend.
  void add_step(Stamp stamp, const Twist2& by_pose, const Twist2& by_twist);
  /// A fix (m, map frame), of a stamp that the steps have come to.
  void add_fix(Stamp stamp, const Eigen::Vector2d& position);
  /// A velocity of the receiver (m/s, east and north).
  void add_velocity(Stamp stamp, const Eigen::Vector2d& velocity);
  /// Forgets what was compared, not the paths.
  void begin_anew();
  MotionSide side() const;
  bool fits_pose() const { return velocities_.fits_pose() || fixes_.fits_pose(); }

 private:
  struct Fix {
    Stamp stamp;
    Eigen::Vector2d position;
    Eigen::Vector2d by_pose, by_twist;
  };
  OdometryHistory by_pose_{10.0};
  OdometryHistory by_twist_{10.0};
  std::optional<Fix> last_fix_;
  std::optional<Stamp> last_velocity_;
  MotionWitness fixes_;
  MotionWitness velocities_;
};

}  // namespace urban_gnss
