#include "urban_gnss_localization/experiments/city_drive.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>

#include "urban_gnss_localization/simulation/city_simulator.hpp"

namespace urban_gnss {
namespace {

constexpr Stamp kOdometryGap = std::chrono::seconds(1);

PointCloud to_point_cloud(const LidarScan& scan) {
  PointCloud cloud;
  cloud.reserve(scan.size());
  for (std::size_t i = 0; i < scan.size(); ++i) cloud.emplace_back(scan.x[i], scan.y[i], scan.z[i]);
  return cloud;
}

/// Sorts the simulator's events, and holds back clouds and epochs until odometry has reached them.
class Dispatcher {
 public:
  Dispatcher(const Scenario& scenario, int cloud_every, const std::vector<DriveParticipant*>& participants)
      : sensor_in_base_(Eigen::Isometry3d(Eigen::Translation3d(scenario.lidar.mount()))),
        cloud_every_(scenario.lidar.type == LidarType::kSpinning ? std::max(1, cloud_every) : 1),
        participants_(participants) {}

  void handle(const std::vector<SimulationEvent>& events) {
    for (const SimulationEvent& event : events) {
      stamp_ = event.stamp;
      std::visit([this](const auto& content) { add(content); }, event.content);
    }
    work();
  }

  DriveRecord take_record() { return std::move(record_); }

 private:
  void add(const TruthEvent& truth) { record_.truth.push_back({stamp_, truth.pose}); }
  void add(const OdometryEvent& odometry) {
    record_.odometry.push_back({stamp_, odometry.pose});
    for (DriveParticipant* each : participants_) each->add_odometry({stamp_, odometry.pose, odometry.twist});
  }
  void add(const ImuMessage& imu) {
    for (DriveParticipant* each : participants_) {
      each->add_imu_yaw_rate(stamp_, imu.angular_velocity_radps.z());
      if (imu.yaw_rad) each->add_imu_heading({stamp_, *imu.yaw_rad, std::sqrt(imu.yaw_variance)});
    }
  }
  void add(const LidarScan& scan) {
    if (scans_++ % cloud_every_ == 0) clouds_.emplace_back(stamp_, to_point_cloud(scan));
  }
  void add(const FixEvent& event) {
    if (event.published.publisher != 0) return;
    DriveEpoch& epoch = epoch_at_stamp();
    if (event.published.has_fix && event.published.fix.position.allFinite()) epoch.fix = event.published.fix;
  }
  void add(const FixTruthEvent& truth) { epoch_at_stamp().error_m = truth.error.head<2>(); }
  void add(const SatellitesEvent& event) {
    DriveEpoch& epoch = epoch_at_stamp();
    epoch.satellites = to_observations(event.satellites);
    epoch.angle_resolution_rad = event.angle_resolution_rad;
  }
  void add(const SignalsEvent& event) {
    DriveEpoch& epoch = epoch_at_stamp();
    for (const SignalTruth& signal : event.signals) epoch.has_line_of_sight.push_back(signal.has_line_of_sight);
  }

  DriveEpoch& epoch_at_stamp() {
    if (epochs_.empty() || epochs_.back().stamp != stamp_) {
      epochs_.emplace_back();
      epochs_.back().stamp = stamp_;
    }
    return epochs_.back();
  }

  void work() {
    const Trajectory& odometry = record_.odometry;
    if (odometry.empty()) return;
    const Stamp reached = odometry.back().stamp;
    for (; !clouds_.empty() && clouds_.front().first <= reached; clouds_.pop_front()) {
      const auto& [stamp, cloud] = clouds_.front();
      const auto base = interpolate(odometry, stamp, kOdometryGap);
      if (!base) continue;
      for (DriveParticipant* each : participants_) {
        if (each->wants_clouds()) each->add_cloud(stamp, cloud, sensor_in_base_, base->pose);
      }
    }
    for (; !epochs_.empty() && epochs_.front().stamp <= reached; epochs_.pop_front()) {
      const auto base = interpolate(odometry, epochs_.front().stamp, kOdometryGap);
      if (!base) continue;
      for (DriveParticipant* each : participants_) each->add_epoch(epochs_.front(), base->pose);
    }
  }

  Eigen::Isometry3d sensor_in_base_;
  int cloud_every_;
  std::vector<DriveParticipant*> participants_;
  DriveRecord record_;
  Stamp stamp_{0};  ///< of the event at hand
  int scans_{0};
  std::deque<std::pair<Stamp, PointCloud>> clouds_;
  std::deque<DriveEpoch> epochs_;
};

}  // namespace

DriveRecord drive_city(Scenario scenario, int cloud_every, const std::vector<DriveParticipant*>& participants,
                       const std::function<void(double)>& on_progress) {
  if (std::none_of(participants.begin(), participants.end(), [](const auto* each) { return each->wants_clouds(); })) {
    scenario.lidar.type = LidarType::kNone;
  }
  CitySimulator simulator(scenario);
  Dispatcher dispatcher(scenario, cloud_every, participants);
  std::vector<SimulationEvent> events;
  while (!simulator.is_finished()) {
    events.clear();
    simulator.step(std::nullopt, events);
    dispatcher.handle(events);
    on_progress(simulator.progress());
  }
  return dispatcher.take_record();
}

}  // namespace urban_gnss
