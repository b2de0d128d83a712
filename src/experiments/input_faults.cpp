#include "urban_gnss_localization/experiments/input_faults.hpp"

namespace urban_gnss {
namespace {

std::function<Twist2(const Twist2&)> scaled(double speed_factor, double yaw_rate_factor = 1.0) {
  return [=](const Twist2& twist) {
    return Twist2{speed_factor * twist.speed_mps, yaw_rate_factor * twist.yaw_rate_radps};
  };
}

InputFault wheel_fault(std::string name, double duration_s, std::function<Twist2(const Twist2&)> wheels) {
  InputFault fault;
  fault.name = std::move(name);
  fault.duration_s = duration_s;
  fault.wheels = std::move(wheels);
  return fault;
}

InputFault gyro_fault(std::string name, double duration_s, double offset_radps) {
  InputFault fault;
  fault.name = std::move(name);
  fault.duration_s = duration_s;
  fault.gyro_offset_radps = offset_radps;
  return fault;
}

}  // namespace

Twist2 without_left_wheel(const Twist2& twist, double track_width_m) {
  const double right_mps = twist.speed_mps + 0.5 * track_width_m * twist.yaw_rate_radps;
  return {0.5 * right_mps, right_mps / track_width_m};
}

std::vector<InputFault> input_faults(const Scenario& scenario) {
  constexpr double kToTheEnd = std::numeric_limits<double>::infinity();
  InputFault none;
  none.name = "none";
  InputFault slip = wheel_fault("slip_in_turn", 3.0, scaled(1.5, 0.5));
  slip.begin = FaultBegin::kTurn;
  InputFault pose;
  pose.name = "pose_30m_off";
  pose.duration_s = 0.0;
  pose.pose_offset_m = 30.0;
  InputFault late;
  late.name = "fixes_1.5s_late";
  late.begin = FaultBegin::kStart;
  late.fix_delay_s = 1.5;
  InputFault antenna;
  antenna.name = "antenna_2m_off";
  antenna.begin = FaultBegin::kStart;
  antenna.antenna_offset_m = 2.0;
  const auto without_left = [track_width_m = scenario.odometry.track_width](const Twist2& twist) {
    return without_left_wheel(twist, track_width_m);
  };
  const auto faster = [](const Twist2& twist) { return Twist2{twist.speed_mps + 20.0, twist.yaw_rate_radps}; };
  return {none,
          wheel_fault("dead_encoder", 30.0, scaled(0.0, 0.0)),
          wheel_fault("left_wheel_dead", 30.0, without_left),
          wheel_fault("speed_x0.447", kToTheEnd, scaled(0.447)),
          wheel_fault("speed_x3.6", kToTheEnd, scaled(3.6)),
          wheel_fault("speed_reversed", 30.0, scaled(-1.0)),
          gyro_fault("gyro_step", 1.0, 1.0),
          gyro_fault("gyro_spike", 1.0 / scenario.odometry.rate, 20.0),
          wheel_fault("speed_plus_20mps", 1.0, faster),
          slip,
          pose,
          late,
          antenna};
}

}  // namespace urban_gnss
