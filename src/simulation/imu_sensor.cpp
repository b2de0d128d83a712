#include "urban_gnss_localization/simulation/imu_sensor.hpp"

#include <cmath>

namespace urban_gnss {
namespace {

constexpr std::uint64_t kImuStream = 221;

Eigen::Vector3d draw_normals(RandomEngine& engine) {
  const double x = draw_normal(engine);
  const double y = draw_normal(engine);
  const double z = draw_normal(engine);
  return {x, y, z};
}

double error_variance(double noise_density, double bias_sigma, double bias_walk, double rate, double time_s) {
  return noise_density * noise_density * rate + bias_sigma * bias_sigma + bias_walk * bias_walk * time_s;
}

}  // namespace

ImuSensor::ImuSensor(const ImuParameters& parameters, std::uint64_t seed)
    : parameters_(parameters),
      engine_(make_engine(seed, kImuStream)),
      clock_(parameters.rate),
      gyro_bias_radps_(parameters.gyro_bias_sigma * draw_normals(engine_)),
      acceleration_bias_mps2_(parameters.acceleration_bias_sigma * draw_normals(engine_)) {}

std::optional<ImuMessage> ImuSensor::advance(double yaw_rate_radps, const Eigen::Vector2d& acceleration_mps2,
                                             double dt_s) {
  const double end_s = time_s_ + dt_s;
  std::optional<ImuMessage> last;
  const auto integrate_to = [&](double until_s) {
    yaw_rad_ += yaw_rate_radps * (until_s - time_s_);
    velocity_change_mps_ += acceleration_mps2 * (until_s - time_s_);
    time_s_ = until_s;
  };
  while (clock_.is_due(end_s)) {
    integrate_to(clock_.due_within(end_s));
    last = message();
    clock_.advance();
  }
  integrate_to(end_s);
  return last;
}

ImuMessage ImuSensor::message() {
  const ImuParameters& p = parameters_;
  const double rate = p.rate;
  const double root_hz = std::sqrt(rate);
  ImuMessage message;
  message.stamp_s = clock_.due_s();
  message.angular_velocity_radps = gyro_bias_radps_ + p.gyro_noise_density * root_hz * draw_normals(engine_);
  message.angular_velocity_radps.z() += yaw_rad_ * rate;
  message.acceleration_mps2 = acceleration_bias_mps2_ + p.acceleration_noise_density * root_hz * draw_normals(engine_);
  message.acceleration_mps2.head<2>() += velocity_change_mps_ * rate;
  message.acceleration_mps2.z() += kGravity_mps2;
  message.angular_velocity_variance =
      error_variance(p.gyro_noise_density, p.gyro_bias_sigma, p.gyro_bias_walk, rate, message.stamp_s);
  message.acceleration_variance = error_variance(p.acceleration_noise_density, p.acceleration_bias_sigma,
                                                 p.acceleration_bias_walk, rate, message.stamp_s);

  gyro_bias_radps_ += p.gyro_bias_walk / root_hz * draw_normals(engine_);
  acceleration_bias_mps2_ += p.acceleration_bias_walk / root_hz * draw_normals(engine_);
  yaw_rad_ = 0.0;
  velocity_change_mps_.setZero();
  return message;
}

}  // namespace urban_gnss
