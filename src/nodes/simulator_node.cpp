// Simulates a robot and what surrounds it: cmd_vel in; odom, imu/data, gps/fix, gps/satellites, points, ground truth,
// tf, markers and (optionally) the clock out. The world is either a city, read from a scenario file
// (docs/simulator.md), or the field of Nishida et al., section 4.1, whose parameters are PaperFieldParameters and
// MotionParameters (config/paper_field/simulator.yaml). The node's own parameters are below and SimulationFrames.

#include <geometry_msgs/Twist.h>
#include <ros/callback_queue.h>
#include <ros/package.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <tf2_msgs/TFMessage.h>
#include <visualization_msgs/MarkerArray.h>

#include <cmath>
#include <map>

#include "urban_gnss_localization/ros/markers.hpp"
#include "urban_gnss_localization/ros/node_parameters.hpp"
#include "urban_gnss_localization/simulation/city_simulator.hpp"
#include "urban_gnss_localization/simulation/paper_field_simulator.hpp"
#include "urban_gnss_localization/simulation_ros/city_markers.hpp"
#include "urban_gnss_localization/simulation_ros/simulation_messages.hpp"

using namespace urban_gnss;

namespace {

constexpr double kMarkerInterval_s = 0.1;
/// How far the simulation may be behind the wall clock and still catch up; what is more is lost time.
constexpr double kMaxLag_s = 0.5;
constexpr double kMaxCommand = 1000.0;  ///< m/s and rad/s

enum class Field { kPaperField, kCity };
EnumNames<Field> enum_names(Field) { return {{"paper_field", Field::kPaperField}, {"city", Field::kCity}}; }

struct NodeParameters {
  Field field{Field::kPaperField};
  std::string scenario{};
  std::vector<double> datum{33.8903, 130.8394, 0.0};
  bool follow_route{false};
  bool publish_clock{true};
  double real_time_factor{1.0};
  double start_delay{0.0};
  bool wait_for_command{true};
  double command_wait{0.05};
  double command_timeout{0.5};

  void visit(ParameterVisitor& v) {
    v.basic()("field", field, "which simulation: that of Nishida et al., section 4, or a scenario with buildings");
    v.basic()("scenario", scenario, "file of a city's scenario");
    v.basic()("datum", datum, "deg, deg, m", "origin of the paper's field");
    v.basic()("follow_route", follow_route, "drive the scenario's route on the true pose, whatever is commanded");
    v("publish_clock", publish_clock, "simulated time on /clock; the other nodes then need use_sim_time");
    v.basic()("real_time_factor", real_time_factor, positive(), "",
              "seconds of the simulation in a second, at the most");
    v.basic()("start_delay", start_delay, non_negative(), "s",
              "of wall time before the first step, for the nodes that are to have the datum before the first fix");
    v("wait_for_command", wait_for_command, "after each step, wait for the command that answers it");
    v("command_wait", command_wait, positive(), "s", "the longest such wait, of wall time");
    v("command_timeout", command_timeout, positive(), "s",
      "of simulated time without a command after which the robot stands");
  }
  void check(std::vector<std::string>& faults) const {
    if (field == Field::kCity && scenario.empty()) faults.push_back("scenario: a city needs the file of a scenario");
    if (datum.size() != 3) {
      faults.push_back("datum: must be latitude (deg), longitude (deg) and altitude (m)");
      return;
    }
    for (const auto& fault : position_faults({datum[0], datum[1], datum[2]})) faults.push_back("datum: " + fault);
  }
};

struct SeedParameter {
  int seed{-1};

  void visit(ParameterVisitor& v) {
    v.basic()("seed", seed, any_number(), "", "of a scenario; negative for the file's own");
  }
};

class SimulatorNode {
 public:
  SimulatorNode(ros::NodeHandle& node, ros::NodeHandle& private_node) : node_(node) {
    make_world(private_node);
    local_ = std::make_unique<LocalFrame>(datum_);
    tf_publisher_ = node.advertise<tf2_msgs::TFMessage>("/tf", 100);
    marker_publisher_ = node.advertise<visualization_msgs::MarkerArray>(topics::kWorld, 4, true);
    if (parameters_.publish_clock) clock_publisher_ = node.advertise<rosgraph_msgs::Clock>("/clock", 100);
    if (city_ != nullptr) start_city();
    if (!parameters_.follow_route) {
      command_subscriber_ =
          node.subscribe(topics::kCommand, 10, &SimulatorNode::on_command, this, ros::TransportHints().tcpNoDelay());
    }
    const double period_s = simulator_->interval_s() / parameters_.real_time_factor;
    started_ = ros::WallTime::now() + ros::WallDuration(parameters_.start_delay);
    timer_ = node.createWallTimer(ros::WallDuration(period_s), [this](const ros::WallTimerEvent&) { catch_up(); });
  }

 private:
  void make_world(const ros::NodeHandle& private_node) {
    ParameterReader reader = private_parameter_reader(private_node);
    reader.read(frames_).read(parameters_);
    if (parameters_.field == Field::kPaperField) {
      PaperFieldParameters field;
      WithMotion with_motion{field, motion_};
      reader.read(with_motion);
      finish_reading(private_node, reader);
      simulator_ = std::make_unique<PaperFieldSimulator>(field, motion_);
      field_ = field;
      datum_ = {parameters_.datum[0], parameters_.datum[1], parameters_.datum[2]};
      return;
    }
    SeedParameter seed;
    reader.read(seed);
    finish_reading(private_node, reader);
    std::vector<std::string> overrides;
    if (seed.seed >= 0) overrides.push_back("seed=" + std::to_string(seed.seed));
    auto city = std::make_unique<CitySimulator>(load_scenario(parameters_.scenario, overrides));
    city_ = city.get();
    datum_ = city->scenario().datum;
    simulator_ = std::move(city);
  }

  void start_city() {
    const Scenario& scenario = city_->scenario();
    static_tf_publisher_ = node_.advertise<tf2_msgs::TFMessage>("/tf_static", 1, true);
    const ros::Time time = to_ros(city_->now());
    static_tf_publisher_.publish(
        mounting_transforms(scenario.vehicle.antenna(), scenario.lidar.mount(), time, frames_));
    datum_publisher_ = node_.advertise<sensor_msgs::NavSatFix>(topics::kDatum, 1, true);
    datum_publisher_.publish(to_message(datum_, time, frames_.base.map));
    marker_publisher_.publish(world_markers(scenario.world, scenario.route, time, frames_.base.map));
    traffic_publisher_ = node_.advertise<visualization_msgs::MarkerArray>("traffic_markers", 2);
    signal_publisher_ = node_.advertise<visualization_msgs::MarkerArray>("signal_markers", 2);
    ROS_INFO_STREAM(scenario.file << ": " << scenario.world.buildings.size() << " buildings, "
                                  << scenario.world.trees.size() << " trees, seed " << scenario.seed);
  }

  void on_command(const geometry_msgs::Twist& message) {
    // A finite one may be as bad: what it moves the robot by adds up to what no number holds, and stays there.
    if (!(std::abs(message.linear.x) <= kMaxCommand) || !(std::abs(message.angular.z) <= kMaxCommand)) {
      ROS_WARN_STREAM_THROTTLE(5.0, "cmd_vel left out: not finite, or beyond 1000 m/s or rad/s");
      return;
    }
    command_ = {message.linear.x, message.angular.z};
    command_age_s_ = 0.0;
    ++commands_;
  }

  /// As many steps as the wall clock asks for: a scan that takes longer than a step is made up for by the next ones.
  void catch_up() {
    if (wall_s() < 0.0) return;
    if (parameters_.wait_for_command && command_subscriber_.getNumPublishers() > 0) {
      lost_s_ = wall_s() - simulated_s_;  // the commands set the pace
      step();
      return;
    }
    do {
      step();
    } while (ros::ok() && simulated_s_ < wall_s() - lost_s_ - simulator_->interval_s());
    const double lag_s = wall_s() - lost_s_ - simulated_s_;
    if (lag_s <= kMaxLag_s) return;
    lost_s_ += lag_s;
    ROS_WARN_STREAM_THROTTLE(10.0, "slower than asked for: real-time factor "
                                       << parameters_.real_time_factor * simulated_s_ / wall_s() << " so far, not "
                                       << parameters_.real_time_factor);
  }

  /// Wall time since the start, in simulated seconds at the factor asked for.
  double wall_s() const { return (ros::WallTime::now() - started_).toSec() * parameters_.real_time_factor; }

  void step() {
    const double interval = simulator_->interval_s();
    if (command_age_s_ > parameters_.command_timeout) command_ = {};
    command_age_s_ += interval;
    simulated_s_ += interval;
    events_.clear();
    simulator_->step(parameters_.follow_route ? std::nullopt : std::optional<Twist2>(command_), events_);
    const std::uint64_t commands_before = commands_;
    publish();
    if (parameters_.wait_for_command && command_subscriber_.getNumPublishers() > 0) await_command(commands_before);
    if (parameters_.follow_route && simulator_->is_finished() && !said_finished_) {
      said_finished_ = true;
      ROS_INFO("the scenario is at its end; the simulation goes on");
    }
  }

  /// The loop is closed at every step, as in the paper, however slow the machine is.
  void await_command(std::uint64_t commands_before) {
    const ros::WallTime until = ros::WallTime::now() + ros::WallDuration(parameters_.command_wait);
    while (ros::ok() && commands_ == commands_before && ros::WallTime::now() < until) {
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.001));
    }
  }

  void publish() {
    if (parameters_.publish_clock) {
      rosgraph_msgs::Clock clock;
      clock.clock = to_ros(simulator_->now());
      clock_publisher_.publish(clock);
    }
    for (const SimulationEvent& event : events_) {
      write_messages(event, *local_, frames_, [this](const std::string& topic, const auto& message) {
        publisher<std::decay_t<decltype(message)>>(topic).publish(message);
      });
      if (city_ != nullptr) publish_markers(event);
    }
    if (simulated_s_ - last_markers_s_ < kMarkerInterval_s) return;
    last_markers_s_ = simulated_s_;
    const ros::Time time = to_ros(simulator_->now());
    if (city_ != nullptr) {
      if (traffic_publisher_.getNumSubscribers() == 0) return;
      traffic_publisher_.publish(traffic_markers(simulator_->truth(), city_->scenario().lidar, city_->cars(),
                                                 city_->elapsed_s(), time, frames_.base.map));
    } else if (marker_publisher_.getNumSubscribers() > 0) {
      marker_publisher_.publish(field_markers(field_.shadow_border, 1.6 * field_.target_ring_radius,
                                              simulator_->truth(), motion_.wheelbase, time, frames_.base.map));
    }
  }

  void publish_markers(const SimulationEvent& event) {
    if (const auto* truth = std::get_if<TruthEvent>(&event.content)) {
      tf2_msgs::TFMessage transforms;  // so that rviz has a map frame also where no localizer runs
      transforms.transforms.push_back(
          to_transform(truth->pose, to_ros(event.stamp), frames_.base.map, frames_.base.base_link + "_truth"));
      tf_publisher_.publish(transforms);
      return;
    }
    const ros::Time time = to_ros(event.stamp);
    if (const auto* signals = std::get_if<SignalsEvent>(&event.content)) {
      if (signal_publisher_.getNumSubscribers() > 0)
        signal_publisher_.publish(signal_markers(*signals, time, frames_.base.map));
    } else if (const auto* fix = std::get_if<FixEvent>(&event.content)) {
      if (fix->published.publisher == 0 && fix->published.has_fix) last_fix_ = fix->published.fix;
    } else if (const auto* truth = std::get_if<FixTruthEvent>(&event.content)) {
      traffic_publisher_.publish(fix_markers(last_fix_, truth->error, time, frames_.base.map));
    }
  }

  /// Publishers are made when their first message comes: a scenario without a lidar has no topic for one.
  template <class Message>
  ros::Publisher& publisher(const std::string& topic) {
    if (topic == "tf") return tf_publisher_;
    const auto known = publishers_.find(topic);
    if (known != publishers_.end()) return known->second;
    return publishers_.emplace(topic, node_.advertise<Message>(topic, 100)).first->second;
  }

  ros::NodeHandle node_;
  NodeParameters parameters_;
  SimulationFrames frames_;
  MotionParameters motion_;     ///< of the paper's field
  PaperFieldParameters field_;  ///< where there is no scenario
  GeodeticPosition datum_;
  std::unique_ptr<Simulator> simulator_;
  const CitySimulator* city_{nullptr};  ///< simulator_, where that is one
  std::unique_ptr<LocalFrame> local_;
  std::vector<SimulationEvent> events_;
  ReceiverFix last_fix_;
  Twist2 command_;
  double command_age_s_{0.0};
  std::uint64_t commands_{0};
  ros::WallTime started_;
  double simulated_s_{0.0};
  double lost_s_{0.0};
  double last_markers_s_{0.0};
  bool said_finished_{false};
  std::map<std::string, ros::Publisher> publishers_;
  ros::Publisher clock_publisher_;
  ros::Publisher tf_publisher_;
  ros::Publisher static_tf_publisher_;
  ros::Publisher datum_publisher_;
  ros::Publisher marker_publisher_;
  ros::Publisher traffic_publisher_;
  ros::Publisher signal_publisher_;
  ros::Subscriber command_subscriber_;
  ros::WallTimer timer_;
};

}  // namespace

int main(int argc, char** argv) {
  return run_node(argc, argv, "simulator", [](ros::NodeHandle& node, ros::NodeHandle& private_node) {
    return std::make_shared<SimulatorNode>(node, private_node);
  });
}
