#pragma once

#include <Eigen/Core>

#include "urban_gnss_localization/motion/odometry_errors.hpp"

namespace urban_gnss {

/// Order of the error states: x (m), y (m), yaw (rad), speed scale (1), yaw-rate bias (rad/s).
inline constexpr int kErrorStates = 5;
using ErrorState = Eigen::Matrix<double, kErrorStates, 1>;
using ErrorCovariance = Eigen::Matrix<double, kErrorStates, kErrorStates>;

/// Which way a step of constant twist goes.
enum class StepPath {
  kChord,    ///< along the chord of its arc, which is exact
  kTangent,  ///< along the heading before the step: Kim et al. eq. (1) as printed
};

/// One step of dead reckoning: Kim et al. eq. (1), and the J and the K Sigma_v K' + Sigma_N of eq. (2), for the pose
/// and the odometry's errors.
struct DeadReckoningStep {
  Pose2 pose;                      ///< moved
  ErrorCovariance transition;      ///< J: how an error before the step shows after it
  ErrorCovariance noise;           ///< of the step
  Eigen::Vector3d yaw_rate_scale;  ///< how an error of the yaw rate's scale (1) shows in the pose after it
};

/// Dead-reckons one step of the measured twist, corrected by `errors`, with the noise of the motion model, eq. (5)-(7)
/// of Nishida et al., linearised, and with the walks of `parameters`. The Sigma_v of Kim et al. is the motion model's
/// with odom_alpha1 for the speed and odom_alpha4 for the yaw rate alone; their Sigma_N are position_walk and
/// heading_walk. At a standstill the pose stays, and only parked_walk is added.
DeadReckoningStep dead_reckon(const Pose2& pose, const OdometryErrors& errors, const MotionStep& step,
                              const OdometryErrorParameters& parameters, StepPath path = StepPath::kChord);

/// Covariance of pose and odometry errors at a start whose pose has the given covariance.
ErrorCovariance initial_error_covariance(const Eigen::Matrix3d& pose_covariance,
                                         const OdometryErrorParameters& parameters);

}  // namespace urban_gnss
