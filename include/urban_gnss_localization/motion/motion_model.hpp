#pragma once

#include <Eigen/Core>
#include <cmath>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/geometry/pose2.hpp"

namespace urban_gnss {

/// Speed and yaw rate (counter-clockwise) of the robot's base.
struct Twist2 {
  double speed_mps{0.0};  ///< forwards
  double yaw_rate_radps{0.0};
  double lateral_mps{0.0};  ///< to the left: of a holonomic robot, or of a base that is not on the axle

  /// Of the motion over ground, whatever its direction.
  double ground_speed_mps() const { return std::hypot(speed_mps, lateral_mps); }
};

/// Nishida et al. eq. (2): speed of the driven rear axle and angle of the steered front wheel (counter-clockwise).
struct BicycleInput {
  double speed_mps{0.0};
  double steering_rad{0.0};
};

/// Eq. (4): yaw rate of the bicycle model, rad/s. `wheelbase_m` > 0.
double yaw_rate(const BicycleInput& input, double wheelbase_m);

/// The steering angle that turns a bicycle at the measured twist: the inverse of eq. (4). At a standstill, where every
/// angle gives the same motion, it is 0.
BicycleInput bicycle_input(const Twist2& twist, double wheelbase_m);

/// Eq. (3) in chord form, regular at yaw rate 0: the pose after moving for `duration_s` at constant twist. The yaw is
/// wrapped.
Pose2 move(const Pose2& pose, const Twist2& twist, double duration_s);
/// The constant twist that moves from one pose to the other: the inverse of move(). Requires duration_s > 0 and a turn
/// below pi.
Twist2 twist_between(const Pose2& from, const Pose2& to, double duration_s);

/// Which pair of inputs the noise of eq. (5)-(7) is put on.
enum class MotionModel {
  kBicycle,   ///< speed and steering angle, as in the paper
  kVelocity,  ///< speed and yaw rate: any robot whose odometry gives a twist
};
EnumNames<MotionModel> enum_names(MotionModel);

/// The motion noise of eq. (5)-(7). With i the second input (steering angle for kBicycle, yaw rate for kVelocity), the
/// variances of one step of `odom_noise_interval` are
///   speed    odom_alpha1 v^2 + odom_alpha2 i^2   (m/s)^2
///   input i  odom_alpha3 v^2 + odom_alpha4 i^2   rad^2 or (rad/s)^2
///   yaw rate odom_alpha5 v^2 + odom_alpha6 i^2   (rad/s)^2
/// times `odom_noise_scale`, where v is the speed over ground and its noise acts along the direction of motion. A step
/// of another length gets the variance that diffuses as much per second.
struct MotionParameters {
  MotionModel motion_model{MotionModel::kVelocity};
  double wheelbase{1.0};
  double odom_alpha1{1e-3};
  double odom_alpha2{1e-3};
  double odom_alpha3{1e-5};
  double odom_alpha4{1e-3};
  double odom_alpha5{1e-5};
  double odom_alpha6{1e-3};
  double odom_noise_scale{1.0};
  double odom_noise_interval{1.0};

  void visit(ParameterVisitor& v) {
    v("motion_model", motion_model,
      "inputs with noise: speed and yaw rate (velocity), or speed and steering angle (bicycle)");
    v("wheelbase", wheelbase, positive(), "m", "wheelbase l of the bicycle model, eq. (4)");
    v("odom_alpha1", odom_alpha1, non_negative(), "", "variance of the speed per squared speed, eq. (5)");
    v("odom_alpha2", odom_alpha2, non_negative(), "",
      "variance of the speed per squared yaw rate (velocity) or steering angle (bicycle)");
    v("odom_alpha3", odom_alpha3, non_negative(), "",
      "variance of the yaw rate or steering angle per squared speed, eq. (6)");
    v("odom_alpha4", odom_alpha4, non_negative(), "",
      "variance of the yaw rate or steering angle per squared yaw rate or steering angle");
    v("odom_alpha5", odom_alpha5, non_negative(), "(rad/s)^2/(m/s)^2",
      "variance of the additional yaw rate per squared speed, eq. (7)");
    v("odom_alpha6", odom_alpha6, non_negative(), "",
      "variance of the additional yaw rate per squared yaw rate or steering angle");
    v("odom_noise_scale", odom_noise_scale, non_negative(), "", "factor on odom_alpha1 to odom_alpha6");
    v("odom_noise_interval", odom_noise_interval, positive(), "s",
      "length of the time step to which odom_alpha1 to odom_alpha6 apply");
  }
};

/// A struct of parameters with those of the motion noise, in a group of their own.
template <class P>
struct WithMotion {
  P& parameters;
  MotionParameters& motion;

  void visit(ParameterVisitor& v) {
    v.include(parameters);
    v.group("motion", motion, "Noise of the motion, Nishida et al. eq. (5) to (8).");
  }
};
template <class P>
WithMotion(P&, MotionParameters&) -> WithMotion<P>;

/// One step of odometry with the standard deviations of its noise: what the noisy motion of eq. (8) needs.
struct MotionStep {
  Twist2 twist;  ///< noise-free, constant over the step
  double duration_s{0.0};
  MotionModel model{MotionModel::kVelocity};
  double wheelbase_m{1.0};
  double steering_rad{0.0};             ///< for kBicycle
  double speed_sigma{0.0};              ///< m/s, along `direction`
  Eigen::Vector2d direction{1.0, 0.0};  ///< of the motion over ground, forwards and left; (1, 0) also backwards
  double input_sigma{0.0};              ///< rad (kBicycle: steering) or rad/s (kVelocity: yaw rate)
  double yaw_rate_sigma{0.0};           ///< rad/s, the disturbance of eq. (7)
};

MotionStep make_motion_step(const Twist2& twist, double duration_s, const MotionParameters& parameters);

/// Standard normal draws for one noisy step.
struct MotionNoise {
  double speed{0.0};
  double input{0.0};
  double yaw_rate{0.0};
};

inline MotionNoise draw_motion_noise(RandomEngine& engine) {
  MotionNoise noise;
  noise.speed = draw_normal(engine);
  noise.input = draw_normal(engine);
  noise.yaw_rate = draw_normal(engine);
  return noise;
}

/// What the odometry is wrong by: true speed = (1 + speed_scale) measured, true yaw rate = (1 + yaw_rate_scale)
/// measured
/// + yaw_rate_bias.
struct OdometryErrors {
  double speed_scale{0.0};          ///< 1
  double yaw_rate_bias_radps{0.0};  ///< rad/s
  double yaw_rate_scale{0.0};       ///< 1
};

/// The measured twist, freed of its errors.
inline Twist2 corrected(const Twist2& measured, const OdometryErrors& errors) {
  return {measured.speed_mps + errors.speed_scale * measured.speed_mps,
          measured.yaw_rate_radps + errors.yaw_rate_scale * measured.yaw_rate_radps + errors.yaw_rate_bias_radps,
          measured.lateral_mps + errors.speed_scale * measured.lateral_mps};
}

/// Eq. (5)-(8): one noisy step of one pose, whose noise-free part is the corrected twist. The particle filter's array
/// form must agree with it (a test compares them).
Pose2 move_noisily(const Pose2& pose, const MotionStep& step, const MotionNoise& noise,
                   const OdometryErrors& errors = {});

}  // namespace urban_gnss
