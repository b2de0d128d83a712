#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "urban_gnss_localization/geometry/pose2.hpp"
#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/gnss/fix_decision.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"
#include "urban_gnss_localization/localizers/bias_estimate.hpp"
#include "urban_gnss_localization/motion/motion_doubt.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"

namespace urban_gnss {

/// A fix at the moment it enters a filter.
struct FixMeasurement {
  Eigen::Vector2d position{Eigen::Vector2d::Zero()};        ///< m, map frame
  Eigen::Matrix2d covariance{Eigen::Matrix2d::Identity()};  ///< m^2
  /// Where the antenna was at the fix's stamp, seen from the base as it stands now (m): lever arm and lateness in one.
  Eigen::Vector2d antenna_in_body{Eigen::Vector2d::Zero()};
  double bias_radius_m{0.0};                     ///< r-hat, where a bias filter gave one
  double time_s{0.0};                            ///< of the fix, since any fixed instant
  Stamp stamp{0};                                ///< of the fix, for what is published about it
  std::vector<SatelliteObservation> satellites;  ///< of the fix, where the receiver reports them
};

/// A receiver's velocity, from the Doppler shift of its signals, at the moment it enters a filter.
struct VelocityMeasurement {
  Eigen::Vector2d velocity{Eigen::Vector2d::Zero()};        ///< m/s east and north, of the antenna
  Eigen::Matrix2d covariance{Eigen::Matrix2d::Identity()};  ///< (m/s)^2
  /// By the odometry at the velocity's stamp (m/s), seen from the base as it stands now.
  Eigen::Vector2d antenna_velocity_in_body{Eigen::Vector2d::Zero()};
  double time_s{0.0};  ///< of the velocity, since any fixed instant
};

/// A heading that does not come from fixes, at the moment it enters a filter.
struct HeadingMeasurement {
  double yaw_rad{0.0};    ///< of the base now, in the map frame
  double sigma_rad{0.0};  ///< of an error that may last: many of them are no better than one
};

/// Whether a filter can take the fix: all finite, with a positive definite covariance.
bool is_usable(const FixMeasurement& fix);
/// The same for a velocity.
bool is_usable(const VelocityMeasurement& velocity);
/// The same for a heading.
bool is_usable(const HeadingMeasurement& heading);
/// Whether a filter can move by the step: finite, for a positive time.
bool is_usable(const Twist2& twist, double duration_s);

/// How sure a localizer is of what it publishes. NaN and 0 where a method has no such number.
struct LocalizerHealth {
  double heading_sigma_rad{std::numeric_limits<double>::quiet_NaN()};  ///< circular standard deviation
  std::uint32_t particle_count{0};
  double effective_sample_size{std::numeric_limits<double>::quiet_NaN()};
  double position_spread_m{std::numeric_limits<double>::quiet_NaN()};
  double cluster_mass{std::numeric_limits<double>::quiet_NaN()};
  std::uint32_t cluster_count{0};
  double bias_radius_m{std::numeric_limits<double>::quiet_NaN()};  ///< of the bias that it estimates itself
};

/// A pose filter of odometry and fixes in the map frame. It has no clock and no messages: the pipeline calls it in the
/// order of the stamps.
class Localizer {
 public:
  virtual ~Localizer() = default;

  virtual const char* name() const = 0;
  virtual std::string mode() const = 0;
  /// Whether it is as its paper prints it. The pipeline then keeps what is ours out of its estimate: it is told no
  /// doubt(), is not started anew where fixes contradict it, and its covariance is published as it is.
  virtual bool is_as_printed() const { return false; }

  /// Whether it makes use of a bias filter's radius, so that a fix should wait for it.
  virtual bool wants_bias() const = 0;

  /// Starts anew, the random numbers too, at a pose with covariance (m^2, m rad, rad^2).
  virtual void initialize(const PoseEstimate& start) = 0;

  /// Moves by one step of odometry.
  virtual void move(const Twist2& twist, double duration_s) = 0;
  /// The last step may be wrong by so much more than the odometry's model says. Requires variances >= 0.
  virtual void doubt(const MotionDoubt& /*doubt*/) {}

  /// Takes one fix. The outcome carries the decision with its NIS.
  virtual FixOutcome correct(const FixMeasurement& fix) = 0;

  /// Whether it refuses a fix, or weighs it down, because of its NIS alone; the NIS of its outcomes is then that of a
  /// fix without a bias, unless the decision is kBiasCompensated.
  virtual bool gates() const { return false; }

  /// Whether it makes use of the receiver's velocity.
  virtual bool takes_velocity() const { return false; }
  /// Takes one velocity of the receiver; methods that do not use velocities ignore it.
  virtual void correct_velocity(const VelocityMeasurement& /*velocity*/) {}

  /// Whether it makes use of headings that do not come from fixes.
  virtual bool takes_heading() const { return false; }
  /// Takes a heading, as of a compass; methods that do not use headings ignore it.
  virtual void correct_heading(const HeadingMeasurement& /*heading*/) {}

  /// Whether it makes use of the satellites of a fix.
  virtual bool takes_satellites() const { return false; }

  /// Whether it estimates the bias of the fixes itself.
  virtual bool estimates_bias() const { return false; }
  /// The biases that it found itself since the last call, one a fix; none where it does not estimate them.
  virtual std::vector<BiasEstimate> take_bias_estimates() { return {}; }

  virtual Pose2 pose() const = 0;
  /// The pose with its covariance.
  virtual PoseEstimate estimate() const = 0;
  virtual LocalizerHealth health() const = 0;
};

}  // namespace urban_gnss
