#pragma once

#include <Eigen/Core>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/geometry/pose2.hpp"
#include "urban_gnss_localization/gnss/correlated_errors.hpp"
#include "urban_gnss_localization/gnss/fix.hpp"

namespace urban_gnss {

/// When the heading found from motion is good enough, and when not to wait for it any longer.
struct HeadingInitializerParameters {
  double initialization_heading_sigma{0.2};
  double initialization_timeout{60.0};
  double initialization_window{60.0};
  double initialization_heading_walk{0.01};
  ErrorCorrelation fix_errors{kFixErrors};

  void visit(ParameterVisitor& v) {
    v("initialization_heading_sigma", initialization_heading_sigma, open_between(0.0, 1.0), "rad",
      "standard deviation of the heading below which the localizer starts from motion");
    v("initialization_timeout", initialization_timeout, positive(), "s",
      "time after the first fix at which the localizer starts without a heading");
    v("initialization_window", initialization_window, positive(), "s",
      "length of the window of fixes from which the start is found");
    v("initialization_heading_walk", initialization_heading_walk, non_negative(), "rad/sqrt(s)",
      "random walk of the odometry's heading within the window");
    v.group("initialization_fix_errors", fix_errors, "How long the errors of the fixes in the window last.");
  }
  void check(std::vector<std::string>& faults) const;
};

/// The velocity of the receiver's antenna, by the odometry and by the receiver, at one time.
struct VelocityPair {
  Stamp stamp{0};
  Eigen::Vector2d odometry{Eigen::Vector2d::Zero()};        ///< m/s, in the odometry's frame
  double yaw_rad{0.0};                                      ///< of the base in that frame
  Eigen::Vector2d measured{Eigen::Vector2d::Zero()};        ///< m/s, east and north
  Eigen::Matrix2d covariance{Eigen::Matrix2d::Identity()};  ///< (m/s)^2, of the measured one
};

/// The initial pose from motion alone, without a magnetometer: the rotation and translation that lay the path of
/// the odometry on the fixes, and its velocities on the receiver's where there are any, in the sense of least squares.
///
/// 1. Every fix is remembered with the odometry's pose at the fix's own stamp, for `initialization_window`; every
///    velocity with the odometry's.
/// 2. A Cauchy-weighted alignment, with the median residual as the scale of each kind, tells which fixes and which
///    velocities agree with each other; one that is a kilometre off has no say. Nor have all velocities together
///    where their speed along the odometry's is not its own: then one of the two is noise.
/// 3. The alignment is repeated over those that agree, each weighted by 1 / its variance per axis: the declared one, or
///    larger by what the residuals of its kind say.
/// 4. The yaw's information (1 / rad²) is the sum of these weights times squared lever arms about the centroid (fixes)
///    and times squared speeds (velocities); the centroid's variance is 1 / the sum of the fixes' weights.
///
/// The errors of fixes are correlated by distance and time (ErrorCorrelation), those of velocities over 1 s: a
/// reflection stays for some of them. A bias that the fixes share is not seen; it stays in the position and is not in
/// the covariance. The odometry's heading is taken to be right for the alignment; that it walks makes the yaw's
/// variance larger.
class HeadingInitializer {
 public:
  /// Requires parameters without faults.
  explicit HeadingInitializer(HeadingInitializerParameters parameters);

  /// `odometry_pose_at_fix` is the pose in the odometry's frame, at the fix's stamp, of the point whose position the
  /// fix is: the base, or the antenna if its offset is composed with the base's pose. Ignored where something is not
  /// finite, the odometry is absurdly far from its origin (1e8 m), the variance is not positive or the stamp is not
  /// newer than the last.
  void add(const Pose2& odometry_pose_at_fix, const LocalFix& fix);

  /// Ignored where something is not finite, the variance is not positive, the stamp is not newer than the last
  /// velocity's, or the odometry is slower than 0.3 m/s: the jitter of a parked robot's has no direction.
  void add_velocity(const VelocityPair& pair);

  /// The pose in the map frame, of the same point as in add(), at the last fix's stamp; its position is the
  /// alignment's, not that fix's. Nothing until the yaw's standard deviation is below the limit and at least 4 fixes
  /// agree. Either at least 4 velocities agree and tell the yaw as well as that by themselves, or the robot has been
  /// farther than 2 standard deviations of a fix from where the window begins (a distance, not a length of path: the
  /// jitter of a parked robot's odometry adds up to a long path).
  std::optional<PoseEstimate> estimate() const;

  /// Whether most fixes of the window agree with each other and the odometry. Reflections bend the path of the fixes.
  bool is_rigid() const;
  /// And as well as their covariances say: then they are good, and an estimate far from them is wrong.
  bool is_good() const;

  /// A start without a heading: the position at the last fix, yaw 0 with the variance of a uniform one (pi²/3). The
  /// position is that of the latest fix that agrees with the others, and its covariance is enlarged by the way
  /// travelled since then; where fewer than 4 agree it is that of the last fix. Throws std::logic_error where there is
  /// no fix.
  PoseEstimate without_heading() const;

  /// The fixes since start or reset span `initialization_timeout`.
  bool timed_out() const;

  /// Forgets every fix and velocity, and starts the time-out anew.
  void reset();

  /// What is missing, for people, e.g. "heading: moved 2.1 of 10.0 m"; empty where there is an estimate.
  std::string waiting_for() const;

 private:
  struct Sample {
    Pose2 odometry;
    LocalFix fix;
  };
  struct Alignment {
    Eigen::Vector2d odometry_centroid;
    Eigen::Vector2d map_centroid;
    double yaw;                   ///< rad, of the odometry's frame in the map frame
    double speed_factor;          ///< of the receiver's velocities along the odometry's, over the odometry's
    double information;           ///< 1 / m^2, sum of the fixes' weights
    double lever_information;     ///< 1 / rad^2, sum of the fixes' weights times squared lever arms
    double velocity_information;  ///< 1 / rad^2, sum of the velocities' weights times squared speeds
  };
  /// An alignment over the samples that agree.
  struct Consensus {
    Alignment alignment;
    std::size_t latest;            ///< index of the last fix that agrees
    double noise_sigma;            ///< m, of a fix per axis
    double declared_sigma;         ///< m, the same as declared
    double agreeing;               ///< share of the fixes, 0 to 1
    double position_variance;      ///< m^2, per axis, of the centroid
    double yaw_variance;           ///< rad^2
    double velocity_yaw_variance;  ///< rad^2, of the velocities alone
  };
  Alignment align(const std::vector<double>& fix_weights, const std::vector<double>& velocity_weights) const;
  /// Lengths of what an alignment leaves, m and m/s.
  std::vector<double> fix_residuals(const Alignment& alignment) const;
  std::vector<double> velocity_residuals(const Alignment& alignment) const;
  std::optional<Consensus> consensus() const;
  /// By which the mean of the velocities' correlated errors varies more than that of independent ones.
  double velocity_inflation() const;
  /// The same of the fixes.
  double fix_inflation() const;
  /// rad^2, of the heading at the last fix relative to that of the whole window.
  double odometry_yaw_variance() const;
  double distance_moved() const;
  bool is_known_by_velocities(const Consensus& found) const;
  bool is_converged(const Consensus& found) const;

  HeadingInitializerParameters parameters_;
  std::deque<Sample> samples_;
  std::deque<VelocityPair> velocities_;
  std::optional<Stamp> first_stamp_;
};

}  // namespace urban_gnss
