#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/simulation/sample_clock.hpp"

namespace urban_gnss {

/// Standard gravity, m/s^2 (3rd CGPM, 1901).
constexpr double kGravity_mps2 = 9.80665;

/// A MEMS unit of the middle class after start-up calibration.
struct ImuParameters {
  double rate{100.0};
  double gyro_noise_density{2e-4};
  double gyro_bias_sigma{0.002};
  double gyro_bias_walk{2e-5};
  double acceleration_noise_density{2e-3};
  double acceleration_bias_sigma{0.05};
  double acceleration_bias_walk{2e-4};

  void visit(ParameterVisitor& v) {
    v("rate", rate, between(0.0, 1000.0), "", "Hz; 0: no IMU");
    v("gyro_noise_density", gyro_noise_density, non_negative(), "", "rad/s/sqrt(Hz)");
    v("gyro_bias_sigma", gyro_bias_sigma, non_negative(), "rad/s", "of each axis's bias at the start");
    v("gyro_bias_walk", gyro_bias_walk, non_negative(), "", "rad/s/sqrt(s)");
    v("acceleration_noise_density", acceleration_noise_density, non_negative(), "", "m/s^2/sqrt(Hz)");
    v("acceleration_bias_sigma", acceleration_bias_sigma, non_negative(), "m/s^2", "of each axis's bias at the start");
    v("acceleration_bias_walk", acceleration_bias_walk, non_negative(), "", "m/s^2/sqrt(s)");
  }
};

/// Axes of base_link (x forward, y left, z up).
struct ImuMessage {
  double stamp_s{0.0};  ///< since the start
  Eigen::Vector3d angular_velocity_radps{Eigen::Vector3d::Zero()};
  Eigen::Vector3d acceleration_mps2{Eigen::Vector3d::Zero()};  ///< specific force: +g on z at rest
  double angular_velocity_variance{0.0};                       ///< (rad/s)^2, of each axis
  double acceleration_variance{0.0};                           ///< (m/s^2)^2, of each axis
  std::optional<double> yaw_rad{};                             ///< by the unit's compass, where it has one (Compass)
  double yaw_variance{0.0};                                    ///< rad^2, that it claims
};

/// An inertial unit in base_link of a planar robot (roll = pitch = 0).
///
/// Each axis measures the mean over the time since the last message, plus a bias that starts Gaussian and walks, plus
/// white noise. The variances are those of the error of one message over all runs: noise density^2 * rate + initial
/// bias variance + walk^2 * time.
class ImuSensor {
 public:
  /// Requires parameters without faults.
  ImuSensor(const ImuParameters& parameters, std::uint64_t seed);

  /// The robot truly moved for `dt_s` > 0 with this yaw rate, rad/s, and forward and leftward acceleration, m/s^2
  /// (Vehicle::twist(), Vehicle::acceleration()). A message falls due every 1/rate s, also within a step; where several
  /// fall due in one step the last is returned.
  std::optional<ImuMessage> advance(double yaw_rate_radps, const Eigen::Vector2d& acceleration_mps2, double dt_s);

  /// What a localizer cannot know.
  const Eigen::Vector3d& gyro_bias_radps() const { return gyro_bias_radps_; }
  const Eigen::Vector3d& acceleration_bias_mps2() const { return acceleration_bias_mps2_; }

 private:
  ImuMessage message();

  ImuParameters parameters_;
  RandomEngine engine_;
  SampleClock clock_;
  double time_s_{0.0};
  Eigen::Vector3d gyro_bias_radps_;
  Eigen::Vector3d acceleration_bias_mps2_;
  double yaw_rad_{0.0};                                           ///< turned since the last message
  Eigen::Vector2d velocity_change_mps_{Eigen::Vector2d::Zero()};  ///< integral of the acceleration since then
};

}  // namespace urban_gnss
