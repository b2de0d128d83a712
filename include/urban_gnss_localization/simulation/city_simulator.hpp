#pragma once

#include <deque>
#include <map>
#include <vector>

#include "urban_gnss_localization/simulation/scenario.hpp"
#include "urban_gnss_localization/simulation/simulator.hpp"
#include "urban_gnss_localization/simulation/wall_index.hpp"

namespace urban_gnss {

/// Drives a scenario: a vehicle with its sensors among buildings, satellites above. The same scenario (seed included)
/// and commands give the same events.
class CitySimulator : public Simulator {
 public:
  /// Throws what Sky and RouteFollower throw.
  explicit CitySimulator(Scenario scenario);
  CitySimulator(const CitySimulator&) = delete;  // its parts refer to its world
  CitySimulator& operator=(const CitySimulator&) = delete;

  void step(const std::optional<Twist2>& command, std::vector<SimulationEvent>& events) override;

  double interval_s() const override { return interval_s_; }
  Stamp now() const override { return now_; }
  const Pose2& truth() const override { return vehicle_.pose(); }
  double progress() const override;
  bool is_finished() const override;

  const Scenario& scenario() const { return scenario_; }
  const std::vector<Car>& cars() const { return cars_; }
  double elapsed_s() const { return to_seconds(now_ - scenario_.start_time); }

 private:
  struct AntennaState {
    Eigen::Vector3d position;  ///< m, map frame
    Eigen::Vector3d velocity;  ///< m/s, map frame
  };
  AntennaState antenna_state() const { return {vehicle_.antenna_position(), vehicle_.antenna_velocity()}; }
  void receive(double interval_s);
  /// Puts the compass's heading into the IMU's message.
  void orient(ImuMessage& imu);
  void add(Stamp published, SimulationEvent event);
  template <class Content>
  void add(Content content) {
    add(now_, {now_, now_, std::move(content)});
  }

  Scenario scenario_;
  WallIndex index_;
  Vehicle vehicle_;
  RouteFollower autopilot_;
  WheelOdometry odometry_;
  ImuSensor imu_;
  Compass compass_;
  double compass_read_s_{0.0};  ///< when, since the start
  Sky sky_;
  SignalTracer tracer_;
  Receiver receiver_;
  FixFaults faults_;
  Lidar lidar_;
  std::vector<Car> cars_;
  SampleClock epoch_clock_;
  double interval_s_;
  std::deque<AntennaState> antenna_history_;  ///< of the receiver's fix_delay: the first is what it measures now
  long steps_{0};
  Stamp now_;
  std::multimap<Stamp, SimulationEvent> pending_;  ///< by the time of their publication
  Stamp last_published_{0};                        ///< of the receiver
  std::vector<VisibleSatellite> visible_;
  std::vector<ReceivedSatellite> received_;
  std::vector<PublishedFix> published_;
};

}  // namespace urban_gnss
