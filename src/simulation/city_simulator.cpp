#include "urban_gnss_localization/simulation/city_simulator.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

namespace urban_gnss {
namespace {

/// Each sensor draws from a seed of its own, so that a change of one leaves the others' noise as it was.
enum Stream : std::uint64_t { kVehicle = 201, kOdometry, kImu, kReceiver, kFaults, kLidar, kCompass };

std::uint64_t stream_seed(int seed, Stream stream) { return make_engine(static_cast<std::uint64_t>(seed), stream)(); }

/// Fine enough for every sensor to deliver when it is due, not later.
double step_interval_s(const Scenario& scenario) {
  return 1.0 / std::max({scenario.odometry.rate, scenario.imu.rate, scenario.receiver.rate});
}

std::size_t steps_of(double duration_s, double interval_s) {
  return static_cast<std::size_t>(std::lround(duration_s / interval_s));
}

SignalTruth signal_truth(const SatelliteReport& report, const ReceivedSatellite& satellite,
                         const Eigen::Vector3d& antenna) {
  SignalTruth truth;
  truth.report = report;
  truth.look = satellite.look;
  truth.has_line_of_sight = !satellite.paths.is_blocked;
  truth.path.push_back(antenna);
  if (!report.is_tracked) return truth;
  // The tracked path is known by its length: the way over the edge, or one of the reflections.
  const auto is_tracked_length = [&](double excess_m) { return std::abs(excess_m - report.excess_m) < 1e-6; };
  if (satellite.paths.has_direct && is_tracked_length(satellite.paths.excess_m)) {
    if (satellite.paths.is_blocked) truth.path.push_back(satellite.paths.edge);
    return truth;
  }
  for (const Reflection& reflection : satellite.paths.reflections) {
    if (!is_tracked_length(reflection.excess_m)) continue;
    truth.path.insert(truth.path.end(), reflection.points.begin(), reflection.points.begin() + reflection.count);
    break;
  }
  return truth;
}

}  // namespace

CitySimulator::CitySimulator(Scenario scenario)
    : scenario_(std::move(scenario)),
      index_(scenario_.world),
      vehicle_(scenario_.vehicle, scenario_.start, stream_seed(scenario_.seed, kVehicle)),
      autopilot_(scenario_.route, scenario_.autopilot),
      odometry_(scenario_.odometry, scenario_.vehicle.drive, scenario_.vehicle.wheelbase,
                stream_seed(scenario_.seed, kOdometry)),
      imu_(scenario_.imu, stream_seed(scenario_.seed, kImu)),
      compass_(scenario_.compass, stream_seed(scenario_.seed, kCompass)),
      sky_(scenario_.sky, scenario_.datum, scenario_.start_time,
           std::filesystem::path(scenario_.file).parent_path().string()),
      tracer_(scenario_.world, index_, scenario_.signals),
      receiver_(scenario_.receiver, stream_seed(scenario_.seed, kReceiver)),
      faults_(scenario_.faults, stream_seed(scenario_.seed, kFaults)),
      lidar_(scenario_.lidar, scenario_.world, index_, stream_seed(scenario_.seed, kLidar)),
      cars_(scenario_.cars.begin(), scenario_.cars.end()),
      epoch_clock_(scenario_.receiver.rate),
      interval_s_(step_interval_s(scenario_)),
      antenna_history_{antenna_state()},
      now_(scenario_.start_time) {}

double CitySimulator::progress() const {
  const double by_time = scenario_.duration_s > 0.0 ? elapsed_s() / scenario_.duration_s : 0.0;
  const double by_route = scenario_.route.loop ? 0.0 : autopilot_.progress();
  return std::min(1.0, std::max(by_time, by_route));
}

bool CitySimulator::is_finished() const {
  return autopilot_.finished() || (scenario_.duration_s > 0.0 && elapsed_s() >= scenario_.duration_s);
}

void CitySimulator::add(Stamp published, SimulationEvent event) { pending_.emplace(published, std::move(event)); }

void CitySimulator::step(const std::optional<Twist2>& command, std::vector<SimulationEvent>& events) {
  vehicle_.step(command ? *command : autopilot_.command(vehicle_.pose(), elapsed_s()), interval_s_);
  // Counted, not summed: a sum of rounded intervals drifts.
  now_ = scenario_.start_time + from_seconds(static_cast<double>(++steps_) * interval_s_);
  antenna_history_.push_back(antenna_state());
  if (antenna_history_.size() > 1 + steps_of(scenario_.receiver.fix_delay, interval_s_)) antenna_history_.pop_front();

  // Before the odometry, whose step it is a part of.
  if (auto imu = imu_.advance(vehicle_.twist().yaw_rate_radps, vehicle_.acceleration(), interval_s_)) {
    if (scenario_.compass.enabled) orient(*imu);
    add(*imu);
  }
  if (const auto odometry = odometry_.advance(vehicle_.twist(), interval_s_)) {
    add(TruthEvent{vehicle_.pose(), vehicle_.twist()});
    add(OdometryEvent{odometry->pose, odometry->twist, odometry->speed_variance, odometry->yaw_rate_variance});
  }
  if (epoch_clock_.is_due(elapsed_s())) {
    epoch_clock_.advance();
    receive(epoch_clock_.period_s());
  }
  LidarScan scan;
  if (lidar_.advance(elapsed_s(), vehicle_.pose(), odometry_.pose(), cars_, scan)) {
    const Stamp stamp = scenario_.start_time + from_seconds(scan.stamp_s);
    add(now_, {stamp, now_, std::move(scan)});
  }

  const auto published = pending_.upper_bound(now_);
  for (auto event = pending_.begin(); event != published; ++event) events.push_back(std::move(event->second));
  pending_.erase(pending_.begin(), published);
}

void CitySimulator::orient(ImuMessage& imu) {
  std::vector<Box> cars;
  for (const Car& car : cars_) cars.push_back(car.at(elapsed_s()));
  const Eigen::Vector2d field = steel_field(scenario_.compass, vehicle_.pose().position(), index_.walls(), cars);
  imu.yaw_rad = compass_.measure(vehicle_.pose().yaw, field, elapsed_s() - compass_read_s_);
  imu.yaw_variance = compass_.claimed_variance();
  compass_read_s_ = elapsed_s();
}

void CitySimulator::receive(double interval_s) {
  const auto [antenna, velocity] = antenna_history_.front();
  sky_.above_horizon(now_ - from_seconds(scenario_.receiver.fix_delay), visible_);
  received_.resize(visible_.size());
  for (std::size_t i = 0; i < visible_.size(); ++i) {
    received_[i].id = visible_[i].id;
    received_[i].look = visible_[i].look;
    received_[i].line_of_sight = line_of_sight(visible_[i].look);
    tracer_.trace(antenna, received_[i].line_of_sight, received_[i].paths);
  }
  ReceiverEpoch epoch = receiver_.epoch(interval_s, antenna, velocity, received_);
  faults_.apply(elapsed_s(), epoch.fix, published_);

  // A serial line keeps the order also where the latency varies by more than the time between two epochs.
  const Stamp published = std::max(now_ + from_seconds(epoch.latency_s), last_published_);
  last_published_ = published;
  SignalsEvent signals;
  for (std::size_t i = 0; i < received_.size(); ++i) {
    signals.signals.push_back(signal_truth(epoch.satellites[i], received_[i], antenna));
  }
  // Before the fix, so that who weighs it has them.
  if (scenario_.receiver.publishes_satellites) {
    add(published,
        {now_, published, SatellitesEvent{std::move(epoch.satellites), scenario_.receiver.angle_resolution}});
  }
  for (const PublishedFix& fix : published_) {
    add(published, {now_, published, FixEvent{fix, epoch.used_count}});
    if (fix.publisher == 0 && fix.has_fix && fix.fix.position.allFinite()) {
      add(published, {now_, published, FixTruthEvent{fix.fix.position - vehicle_.antenna_position(), std::nullopt}});
    }
  }
  add(published, {now_, published, std::move(signals)});
}

}  // namespace urban_gnss
