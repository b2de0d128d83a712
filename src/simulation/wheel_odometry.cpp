#include "urban_gnss_localization/simulation/wheel_odometry.hpp"

#include <cmath>
#include <limits>

#include "urban_gnss_localization/simulation/gauss_markov.hpp"

namespace urban_gnss {
namespace {

// Slip and wandering have streams of their own, so that other noise is the same with and without them.
enum Stream : std::uint64_t { kOdometryStream = 211, kSlipStream = 212, kWanderStream = 213 };

double square(double value) { return value * value; }

double draw_exponential(double mean, RandomEngine& engine) { return -mean * std::log1p(-draw_uniform(engine)); }

double quantise(double value, double resolution) {
  return resolution > 0.0 ? resolution * std::round(value / resolution) : value;
}

}  // namespace

double WheelOdometry::Encoder::read() {
  const double total = tick_m_ > 0.0 ? tick_m_ * std::floor(travelled_m_ / tick_m_) : travelled_m_;
  const double since_last = total - read_m_;
  read_m_ = total;
  return since_last;
}

WheelOdometry::WheelOdometry(const WheelOdometryParameters& parameters, Drive drive, double wheelbase_m,
                             std::uint64_t seed)
    : parameters_(parameters),
      drive_(drive),
      wheelbase_m_(wheelbase_m),
      engine_(make_engine(seed, kOdometryStream)),
      slip_engine_(make_engine(seed, kSlipStream)),
      wander_engine_(make_engine(seed, kWanderStream)),
      clock_(parameters.rate),
      left_(parameters.tick),
      right_(parameters.tick) {
  speed_scale_error_ = parameters_.speed_scale_sigma * draw_normal(engine_);
  yaw_rate_scale_error_ = parameters_.yaw_rate_scale_sigma * draw_normal(engine_);
  bias_radps_ = parameters_.yaw_rate_bias_sigma * draw_normal(engine_);
  speed_scale_wander_ = draw_normal(wander_engine_);
  yaw_rate_wander_ = draw_normal(wander_engine_);
  // Where a wheel stands within a tick at the start is unknown.
  left_.turn(parameters_.tick * draw_uniform(engine_));
  right_.turn(parameters_.tick * draw_uniform(engine_));
  slip_change_s_ = parameters_.slip_interval > 0.0 ? draw_exponential(parameters_.slip_interval, slip_engine_)
                                                   : std::numeric_limits<double>::infinity();
}

std::optional<WheelOdometryMessage> WheelOdometry::advance(const Twist2& truth, double dt_s) {
  const double end_s = time_s_ + dt_s;
  std::optional<WheelOdometryMessage> last;
  while (clock_.is_due(end_s)) {
    const double due_s = clock_.due_within(end_s);
    turn_wheels(truth, due_s - time_s_);
    time_s_ = due_s;
    last = message();
    clock_.advance();
  }
  turn_wheels(truth, end_s - time_s_);
  time_s_ = end_s;
  return last;
}

void WheelOdometry::turn_wheels(const Twist2& truth, double dt_s) {
  advance_slip();
  if (!(dt_s > 0.0) || (truth.speed_mps == 0.0 && truth.yaw_rate_radps == 0.0)) return;
  has_moved_ = true;
  const double distance = speed_scale() * truth.speed_mps * dt_s;
  const double yaw = (yaw_rate_scale() * truth.yaw_rate_radps + bias_radps_ + yaw_rate_wander_radps()) * dt_s;
  distance_m_ += distance;
  yaw_rad_ += yaw;
  if (!is_slipping_) return;
  if (drive_ == Drive::kBicycle) {
    left_slip_m_ += parameters_.slip_share * distance;
  } else {
    const double difference = 0.5 * parameters_.track_width * yaw;
    if (slips_left_) left_slip_m_ += parameters_.slip_share * (distance - difference);
    if (!slips_left_) right_slip_m_ += parameters_.slip_share * (distance + difference);
  }
}

void WheelOdometry::advance_slip() {
  while (slip_change_s_ <= time_s_) {
    is_slipping_ = !is_slipping_;
    if (is_slipping_) slips_left_ = draw_uniform(slip_engine_) < 0.5;
    slip_change_s_ +=
        is_slipping_ ? parameters_.slip_duration : draw_exponential(parameters_.slip_interval, slip_engine_);
  }
}

WheelOdometryMessage WheelOdometry::message() {
  const double period_s = clock_.period_s();
  const double root_s = std::sqrt(period_s);
  // Drawn also at a stand, so that the draws do not depend on how the robot is driven.
  const double distance_noise = parameters_.speed_noise_density * root_s * draw_normal(engine_);
  const double yaw_noise = parameters_.yaw_rate_noise_density * root_s * draw_normal(engine_);
  const double bias_step = parameters_.yaw_rate_bias_walk * root_s * draw_normal(engine_);

  WheelOdometryMessage message;
  message.stamp_s = clock_.due_s();
  if (has_moved_) {
    const double distance = distance_m_ + distance_noise;
    const double yaw = yaw_rad_ + yaw_noise;
    message.twist = drive_ == Drive::kBicycle ? read_bicycle(distance, yaw) : read_differential(distance, yaw);
  }
  set_variances(message);
  pose_ = move(pose_, message.twist, period_s);
  message.pose = pose_;

  bias_radps_ += bias_step;
  step_gauss_markov(speed_scale_wander_, period_s, parameters_.speed_scale_wander_time, wander_engine_);
  step_gauss_markov(yaw_rate_wander_, period_s, parameters_.yaw_rate_wander_time, wander_engine_);
  has_moved_ = false;
  distance_m_ = yaw_rad_ = left_slip_m_ = right_slip_m_ = 0.0;
  return message;
}

Twist2 WheelOdometry::read_bicycle(double distance_m, double yaw_rad) {
  const double rate = parameters_.rate;
  BicycleInput input = bicycle_input({distance_m * rate, yaw_rad * rate}, wheelbase_m_);
  input.steering_rad = quantise(input.steering_rad, parameters_.steering_resolution);
  left_.turn(distance_m + left_slip_m_);
  input.speed_mps = left_.read() * rate;
  return {input.speed_mps, yaw_rate(input, wheelbase_m_)};
}

Twist2 WheelOdometry::read_differential(double distance_m, double yaw_rad) {
  const double difference = 0.5 * parameters_.track_width * yaw_rad;
  left_.turn(distance_m - difference + left_slip_m_);
  right_.turn(distance_m + difference + right_slip_m_);
  const double left = left_.read() * parameters_.rate;
  const double right = right_.read() * parameters_.rate;
  return {0.5 * (left + right), (right - left) / parameters_.track_width};
}

double WheelOdometry::slip_probability() const {
  if (!(parameters_.slip_interval > 0.0)) return 0.0;
  return parameters_.slip_duration / (parameters_.slip_interval + parameters_.slip_duration);
}

void WheelOdometry::set_variances(WheelOdometryMessage& message) const {
  const WheelOdometryParameters& p = parameters_;
  const double v = message.twist.speed_mps;
  const double w = message.twist.yaw_rate_radps;
  const double tick_variance = square(p.tick * p.rate) / 6.0;  // (m/s)^2, of one encoder
  const double slip_variance = slip_probability() * square(p.slip_share);
  message.speed_variance =
      square(p.speed_noise_density) * p.rate + square(p.speed_scale_sigma * v) + square(p.speed_scale_wander_sigma * v);
  message.yaw_rate_variance = square(p.yaw_rate_noise_density) * p.rate + square(p.yaw_rate_scale_sigma * w) +
                              square(p.yaw_rate_bias_sigma) + square(p.yaw_rate_bias_walk) * message.stamp_s +
                              square(p.yaw_rate_wander_sigma);
  if (drive_ == Drive::kBicycle) {
    const double tangent = std::tan(bicycle_input(message.twist, wheelbase_m_).steering_rad);
    message.speed_variance += tick_variance + slip_variance * v * v;
    message.yaw_rate_variance += square(tangent / wheelbase_m_) * tick_variance + slip_variance * w * w +
                                 square(v / wheelbase_m_ * (1.0 + tangent * tangent) * p.steering_resolution) / 12.0;
  } else {
    const double wheel_square = v * v + square(0.5 * p.track_width * w);  // mean of both wheels' squared speed
    message.speed_variance += 0.5 * tick_variance + 0.25 * slip_variance * wheel_square;
    message.yaw_rate_variance += (2.0 * tick_variance + slip_variance * wheel_square) / square(p.track_width);
  }
}

}  // namespace urban_gnss
