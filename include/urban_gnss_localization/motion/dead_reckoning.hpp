#pragma once

#include <Eigen/Core>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/motion/odometry_errors.hpp"

namespace urban_gnss {

/// Noise of the odometry, and what is systematically wrong with it. Densities are standard deviations after one second.
struct DeadReckoningParameters {
  double odom_speed_noise{0.02};
  double odom_yaw_rate_noise{0.03};
  double odom_position_noise{0.05};
  double odom_heading_noise{0.003};
  bool estimate_odometry_errors{true};
  double odom_scale_sigma{0.02};
  double odom_scale_walk{2e-4};
  double odom_yaw_bias_sigma{0.005};
  double odom_yaw_bias_walk{3e-5};

  void visit(ParameterVisitor& v) {
    v("odom_speed_noise", odom_speed_noise, non_negative(), "", "share of the speed per sqrt(Hz), Sigma_v");
    v("odom_yaw_rate_noise", odom_yaw_rate_noise, non_negative(), "", "share of the yaw rate per sqrt(Hz), Sigma_v");
    v("odom_position_noise", odom_position_noise, non_negative(), "", "m/sqrt(s) per axis while moving, Sigma_N");
    v("odom_heading_noise", odom_heading_noise, non_negative(), "", "rad/sqrt(s) while moving, Sigma_N");
    v("estimate_odometry_errors", estimate_odometry_errors,
      "speed scale and yaw-rate bias as states; false: the paper's (x, y, heading)");
    v("odom_scale_sigma", odom_scale_sigma, non_negative(), "",
      "share of the speed, of the scale's error at the start");
    v("odom_scale_walk", odom_scale_walk, non_negative(), "", "share/sqrt(s), how fast it changes");
    v("odom_yaw_bias_sigma", odom_yaw_bias_sigma, non_negative(), "rad/s", "of the yaw rate's bias at the start");
    v("odom_yaw_bias_walk", odom_yaw_bias_walk, non_negative(), "rad/s/sqrt(s)", "how fast it changes");
  }
};

/// Order of the error states: x (m), y (m), yaw (rad), speed scale (1), yaw-rate bias (rad/s).
inline constexpr int kErrorStates = 5;
using ErrorState = Eigen::Matrix<double, kErrorStates, 1>;
using ErrorCovariance = Eigen::Matrix<double, kErrorStates, kErrorStates>;

/// One step of dead reckoning: Kim et al. eq. (1), with the chord in place of the tangent, and the J and the
/// K Sigma_v K' + Sigma_N of eq. (2), for the pose and the odometry's errors.
struct DeadReckoningStep {
  Pose2 pose;                      ///< moved
  ErrorCovariance transition;      ///< J: how an error before the step shows after it
  ErrorCovariance noise;           ///< of the step
  Eigen::Vector3d yaw_rate_scale;  ///< how an error of the yaw rate's scale (1) shows in the pose after it
};

/// Whether the wheels stand: the odometry then has no error, neither noise nor bias.
bool is_standstill(const Twist2& twist);

/// Dead-reckons `duration_s` >= 0 at the measured twist, corrected by `errors`. Without estimate_odometry_errors their
/// rows of the noise are 0.
DeadReckoningStep dead_reckon(const Pose2& pose, const OdometryErrors& errors, const Twist2& measured,
                              double duration_s, const DeadReckoningParameters& parameters);

/// The same with the noise of the motion model, eq. (5)-(7) of Nishida et al., linearised; parked where the robot is.
DeadReckoningStep dead_reckon(const Pose2& pose, const OdometryErrors& errors, const MotionStep& step,
                              const OdometryErrorParameters& parameters);

/// Covariance of pose and odometry errors at a start whose pose has the given covariance.
ErrorCovariance initial_error_covariance(const Eigen::Matrix3d& pose_covariance,
                                         const DeadReckoningParameters& parameters);
ErrorCovariance initial_error_covariance(const Eigen::Matrix3d& pose_covariance,
                                         const OdometryErrorParameters& parameters);

}  // namespace urban_gnss
