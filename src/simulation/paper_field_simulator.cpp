#include "urban_gnss_localization/simulation/paper_field_simulator.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {
namespace {

constexpr double kSpeed_mps = 10.0;  ///< section 4.1

Route route_of(const PaperFieldParameters& field) {
  Route route;
  route.loop = true;
  const std::vector<double> targets = field.targets();
  for (std::size_t i = 0; i + 1 < targets.size(); i += 2) {
    route.waypoints.push_back({{targets[i], targets[i + 1]}, kSpeed_mps, 0.0});
  }
  return route;
}

/// The paper's robot turns at 10 m/s on a ring of 15 m: limits of a road robot do not hold for it.
RouteFollowerParameters autopilot_parameters() {
  RouteFollowerParameters parameters;
  parameters.max_lateral_acceleration = 100.0;
  parameters.acceleration = 100.0;
  parameters.deceleration = 100.0;
  return parameters;
}

}  // namespace

PaperFieldSimulator::PaperFieldSimulator(const PaperFieldParameters& field, const MotionParameters& motion,
                                         double duration_s)
    : field_(field, motion),
      motion_(motion),
      autopilot_(route_of(field), autopilot_parameters()),
      duration_s_(duration_s) {}

double PaperFieldSimulator::progress() const {
  return duration_s_ > 0.0 ? std::min(1.0, to_seconds(now_ - kStart) / duration_s_) : autopilot_.progress();
}

bool PaperFieldSimulator::is_finished() const { return duration_s_ > 0.0 && to_seconds(now_ - kStart) >= duration_s_; }

void PaperFieldSimulator::step(const std::optional<Twist2>& command, std::vector<SimulationEvent>& events) {
  const double interval = interval_s();
  const Twist2 twist = command ? *command : autopilot_.command(field_.truth(), to_seconds(now_ - kStart));
  // What the odometry reports is the input: the robot's own noise is what it cannot see.
  const BicycleInput input = bicycle_input(twist, motion_.wheelbase);
  field_.step(input);
  const SimulatedFix fix = field_.fix();
  now_ = kStart + from_seconds(static_cast<double>(++steps_) * interval);

  const Twist2 reported{input.speed_mps, yaw_rate(input, motion_.wheelbase)};
  odometry_ = move(odometry_, reported, interval);
  const MotionStep noise = make_motion_step(reported, interval, motion_);
  const auto add = [&](auto content) { events.push_back({now_, now_, std::move(content)}); };
  add(OdometryEvent{odometry_, reported, std::pow(noise.speed_sigma, 2), std::pow(noise.yaw_rate_sigma, 2)});
  add(TruthEvent{field_.truth(), reported});
  FixEvent event;
  event.published.fix.position << fix.position, 0.0;
  // A receiver does not know that it is in the shadow: it claims the accuracy of direct reception everywhere.
  const double claimed = std::pow(std::max(field_.parameters().fix_direct_sigma, 1e-3), 2);
  event.published.fix.covariance = Eigen::Vector3d(claimed, claimed, 4.0 * claimed).asDiagonal();
  add(event);
  FixTruthEvent truth;
  truth.error << fix.position - field_.truth().position(), 0.0;
  truth.in_shadow = fix.in_shadow;
  add(truth);
}

}  // namespace urban_gnss
