#include "replay.hpp"

#include <rosbag/bag.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>

#include "bag_messages.hpp"
#include "command_line.hpp"
#include "output_file.hpp"
#include "replay_settings.hpp"
#include "urban_gnss_localization/common/progress.hpp"
#include "urban_gnss_localization/evaluation/report_json.hpp"
#include "urban_gnss_localization/evaluation/tum.hpp"
#include "urban_gnss_localization/pipeline/bias_responder.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/sensor_frames.hpp"
#include "urban_gnss_localization/ros/topics.hpp"
#include "urban_gnss_localization/ros/visibility_messages.hpp"

namespace urban_gnss {
namespace {

namespace fs = std::filesystem;
using urban_gnss_localization::SatelliteArray;

/// The pipeline and the bias filter of one run, with what it writes.
class Replay {
 public:
  Replay(const ReplayOptions& options, const ReplaySettings& settings)
      : shell_(settings.localizer.shell),
        pipeline_(shell_.localization, settings.localizer.localizer->make()),
        sensor_frames_(shell_.frames, shell_.wants_antenna_from_tf()),
        bias_responder_(settings.gps_bias.bias.bias) {
    if (!options.output.empty()) {
      const fs::path path(options.output);
      if (path.has_parent_path()) fs::create_directories(path.parent_path());
      bag_.open(options.output, rosbag::bagmode::Write);
    }
  }

  void add_odometry(const nav_msgs::Odometry& message) {
    newest_ = to_stamp(message.header.stamp);
    sensor_frames_.observe_odometry(message.header.frame_id, message.child_frame_id);
    pipeline_.add_odometry(to_odometry_sample(message));
    settle();
  }
  void add_fix(const sensor_msgs::NavSatFix& message) {
    sensor_frames_.observe_fix(message.header.frame_id);
    look_up_sensors();
    pipeline_.add_fix(to_raw_fix(message));
    settle();
  }
  void add_satellites(const SatelliteArray& message) {
    pipeline_.add_satellites(to_stamp(message.header.stamp), to_observations(message));
    settle();
  }
  void add_velocity(const RawVelocity& velocity) {
    pipeline_.add_velocity(velocity);
    settle();
  }
  void add_imu(const sensor_msgs::Imu& message) {
    sensor_frames_.observe_imu(message.header.frame_id);
    look_up_sensors();
    if (const auto sample = to_imu_sample(message)) pipeline_.add_imu(*sample);
  }
  /// What does not move: of the tf of a bag, only that is used.
  void add_static_tf(const tf2_msgs::TFMessage& message) {
    for (geometry_msgs::TransformStamped transform : message.transforms) {
      transform.header.frame_id = without_leading_slash(transform.header.frame_id);
      transform.child_frame_id = without_leading_slash(transform.child_frame_id);
      tf_.setTransform(transform, "bag", true);
    }
  }
  void set_datum(const sensor_msgs::NavSatFix& message) {
    bag_datum_ = to_geodetic(message);
    if (!pipeline_.frame()) pipeline_.set_datum(*bag_datum_);
    settle();
  }
  void add_truth(const nav_msgs::Odometry& message) { truth_.push_back(to_timed_pose(message)); }

  void close() {
    if (bag_.isOpen()) bag_.close();
  }

  const Trajectory& estimate() const { return estimate_; }
  const std::map<std::string, std::size_t>& decisions() const { return decisions_; }
  const LocalizationPipeline& pipeline() const { return pipeline_; }

  /// The truth in the frame of this run's datum.
  std::optional<Trajectory> truth() const {
    if (truth_.empty() || !pipeline_.frame()) return std::nullopt;
    if (!bag_datum_) {
      std::cerr << "replay: the bag has a truth but no gps/datum; the truth is taken to be in the frame of the datum\n";
      return truth_;
    }
    const LocalFrame theirs(*bag_datum_);
    Trajectory moved = truth_;
    for (TimedPose& timed : moved) {
      const Eigen::Vector3d point = pipeline_.frame()->to_local(theirs.to_geodetic({timed.pose.x, timed.pose.y, 0.0}));
      timed.pose.x = point.x();
      timed.pose.y = point.y();
    }
    sort_by_stamp(moved);
    return moved;
  }

 private:
  void look_up_sensors() {
    if (!sensor_frames_.is_complete()) sensor_frames_.look_up(tf_, pipeline_);
  }
  void print(const std::vector<PipelineEvent>& events) const {
    for (const PipelineEvent& event : events) {
      std::cerr << "[" << std::fixed << std::setprecision(3) << to_seconds(newest_) << "] " << event.text << '\n';
    }
  }

  /// Answers the pipeline's questions for the bias, as gps_bias_node does live, and writes what came of it.
  void settle() {
    write_biases(bias_responder_.answer(pipeline_));
    print(sensor_frames_.take_events());
    print(pipeline_.take_events());
    for (const LocalizationOutput& output : pipeline_.take_outputs()) {
      estimate_.push_back({output.stamp, output.estimate.pose, output.estimate.covariance});
      write(topics::kEstimate, output.stamp, to_message(output, shell_.frames));
      tf2_msgs::TFMessage tf;
      tf.transforms.push_back(to_map_to_odom(output, shell_.frames, shell_.transform_time_offset));
      write("tf", output.stamp, tf);
    }
    write_biases(pipeline_.take_bias_estimates());
    const std::vector<FixOutcome> outcomes = pipeline_.take_outcomes();
    for (const FixOutcome& outcome : outcomes) ++decisions_[to_string(outcome.decision)];
    for (const auto& status : to_status_messages(pipeline_, outcomes, to_ros(newest_), shell_.frames.map)) {
      write(topics::kStatus, newest_, status);
    }
  }

  void write_biases(const std::vector<BiasEstimate>& biases) {
    for (const BiasEstimate& bias : biases) {
      write(topics::kBias, bias.stamp, to_message(bias, shell_.frames.map));
    }
  }

  template <class M>
  void write(const std::string& topic, Stamp stamp, const M& message) {
    if (bag_.isOpen()) bag_.write("/" + topic, std::max(to_ros(stamp), ros::TIME_MIN), message);
  }

  LocalizerNodeParameters shell_;
  LocalizationPipeline pipeline_;
  tf2::BufferCore tf_;
  SensorFrames sensor_frames_;
  BiasResponder bias_responder_;
  rosbag::Bag bag_;
  Stamp newest_{0};
  std::optional<GeodeticPosition> bag_datum_;
  Trajectory estimate_;
  Trajectory truth_;
  std::map<std::string, std::size_t> decisions_;
};

void print_summary(const Replay& replay, const nlohmann::json& metrics, double wall_s, double bag_s) {
  std::cout << replay.estimate().size() << " estimates in " << std::fixed << std::setprecision(2) << wall_s << " s ("
            << std::setprecision(0) << bag_s / std::max(wall_s, 1e-3) << " times real time)\n";
  std::cout << "fixes:";
  for (const auto& [decision, count] : replay.decisions()) std::cout << "  " << decision << " " << count;
  std::cout << '\n';
  if (!metrics.contains("errors")) return;
  const auto& position = metrics["errors"]["position_m"];
  if (position["median"].is_null()) return;
  std::cout << std::setprecision(2) << "position error, m: median " << position["median"].get<double>() << ", mean "
            << position["mean"].get<double>() << ", 95 % " << position["p95"].get<double>() << ", max "
            << position["max"].get<double>() << "; the truth was covered to "
            << 100.0 * metrics["errors"]["coverage"].get<double>() << " %\n";
}

/// The topics that are read, without their leading slashes.
struct Topics {
  explicit Topics(const ReplayOptions& options)
      : fix(without_leading_slash(options.fix_topic)),
        odom(without_leading_slash(options.odom_topic)),
        imu(without_leading_slash(options.imu_topic)),
        velocity(without_leading_slash(options.velocity_topic)),
        satellites(without_leading_slash(options.satellites_topic)),
        truth(without_leading_slash(options.truth_topic)) {}

  /// In the order in which messages of one time are read.
  std::vector<std::string> ordered() const {
    return {topics::kDatum, topics::kStaticTf, imu, odom, fix, velocity, satellites, truth};
  }

  std::string fix, odom, imu, velocity, satellites, truth;
};

using Messages = std::vector<rosbag::MessageInstance>;

/// Throws std::runtime_error, which lists what the bag has, where a topic that is needed has no message.
void require_topics(const rosbag::Bag& bag, const Messages& messages, const ReplayOptions& options,
                    const Topics& names) {
  const auto require = [&](bool is_needed, const std::string& option, const std::string& name) {
    const auto is_of_it = [&](const auto& message) { return without_leading_slash(message.getTopic()) == name; };
    if (!is_needed || std::any_of(messages.begin(), messages.end(), is_of_it)) return;
    std::string present;
    rosbag::View all(bag);
    for (const rosbag::ConnectionInfo* connection : all.getConnections()) {
      present += "\n  " + connection->topic + " (" + connection->datatype + ")";
    }
    throw std::runtime_error(options.input + " has no message on " + name + " (" + option + "); it has" + present);
  };
  require(true, "--fix-topic", names.fix);
  require(true, "--odom-topic", names.odom);
  require(options.wants_imu, "--imu-topic", names.imu);
  require(options.wants_velocity, "--velocity-topic", names.velocity);
  require(options.wants_satellites, "--satellites-topic", names.satellites);
}

void add_message(const rosbag::MessageInstance& message, const Topics& names, Replay& replay) {
  const std::string name = without_leading_slash(message.getTopic());
  if (name == names.odom) {
    replay.add_odometry(*expect<nav_msgs::Odometry>(message));
  } else if (name == names.fix) {
    replay.add_fix(*expect<sensor_msgs::NavSatFix>(message));
  } else if (name == names.velocity) {
    const auto measured = to_raw_velocity_of(message);
    if (!measured) throw wrong_type(message, kVelocityTypes);
    replay.add_velocity(*measured);
  } else if (name == names.satellites) {
    replay.add_satellites(*expect<SatelliteArray>(message));
  } else if (name == names.imu) {
    replay.add_imu(*expect<sensor_msgs::Imu>(message));
  } else if (name == topics::kStaticTf) {
    replay.add_static_tf(*expect<tf2_msgs::TFMessage>(message));
  } else if (name == names.truth) {
    replay.add_truth(*expect<nav_msgs::Odometry>(message));
  } else {
    replay.set_datum(*expect<sensor_msgs::NavSatFix>(message));
  }
}

nlohmann::json metrics_of(const ReplayOptions& options, const ReplaySettings& settings, const Replay& replay) {
  const LocalizationReport report = replay.pipeline().report();
  nlohmann::json metrics = {{"bag", fs::path(options.input).filename().string()},
                            {"localizer", replay.pipeline().localizer().name()},
                            {"mode", replay.pipeline().localizer().mode()},
                            {"seed", settings.seed},
                            {"estimates", replay.estimate().size()},
                            {"decisions", replay.decisions()},
                            {"fixes_with_ranges", report.fixes_with_ranges},
                            {"velocities_used", report.velocities_used}};
  metrics["final_state"] = to_string(report.state);
  if (const auto& frame = replay.pipeline().frame()) {
    metrics["datum"] = {frame->datum().latitude_deg, frame->datum().longitude_deg, frame->datum().altitude_m};
  }
  if (const auto reference = replay.truth()) {
    metrics["errors"] = to_json(errors_at_truth(*reference, replay.estimate()).summary);
  }
  return metrics;
}

void write_results(const ReplayOptions& options, const nlohmann::json& metrics, const Replay& replay) {
  if (!options.json_file.empty()) {
    write_file(options.json_file, [&](std::ostream& out) { out << metrics.dump(2) << '\n'; });
  }
  if (!options.tum_file.empty()) {
    write_file(options.tum_file, [&](std::ostream& out) { write_tum(out, replay.estimate()); });
  }
}

void run(const ReplayOptions& options, const LocalizerRegistry& localizers) {
  const ReplaySettings settings = read_settings(options, localizers);
  if (!fs::exists(options.input)) throw std::runtime_error(options.input + ": no such bag");
  rosbag::Bag bag(options.input, rosbag::bagmode::Read);
  const Topics names(options);
  const Messages messages = ordered_messages(bag, names.ordered());
  require_topics(bag, messages, options, names);

  Replay replay(options, settings);
  Progress progress(messages.size(), "messages");
  const auto start = std::chrono::steady_clock::now();
  std::size_t done = 0;
  for (const rosbag::MessageInstance& message : messages) {
    add_message(message, names, replay);
    progress.report(++done);
  }
  progress.finish();
  replay.close();
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

  const nlohmann::json metrics = metrics_of(options, settings, replay);
  write_results(options, metrics, replay);
  const double bag_s = messages.empty() ? 0.0 : (messages.back().getTime() - messages.front().getTime()).toSec();
  print_summary(replay, metrics, wall_s, bag_s);
  if (replay.estimate().empty()) {
    throw std::runtime_error("no estimate: still waiting for " + replay.pipeline().waiting_for());
  }
}

void print_variants(const LocalizerRegistry& localizers) {
  for (const LocalizerVariant& variant : localizers.variants()) std::cout << variant.name << '\n';
}

}  // namespace

int replay_main(int argc, char** argv, const LocalizerRegistry& localizers) {
  ReplayOptions options;
  CommandLine line("replay",
                   "Runs a bag through a localizer offline; the same input, parameters and seed give the same output.");
  CLI::App& app = line.app();
  auto* input = app.add_option("bag", options.input, "the bag to read");
  bool only_names = false;
  app.add_flag("--list-variants", only_names, "print the names under which localizers are compared, and end");
  app.add_option("--localizer", options.localizer, localizers.names() + ", or a name of --list-variants");
  app.add_option("--robot", options.robot, "differential, ackermann, holonomic or car: what is known of its wheels");
  app.add_option("--params", options.params, "YAML with the nodes' parameters; repeatable, later files win");
  line.add_set("--set", options.overrides, "a parameter of the localizer, or after gps_bias. of the bias filter");
  app.add_option("--output", options.output, "bag to write: odometry/filtered, gps/bias, status, tf");
  app.add_option("--fix-topic", options.fix_topic, "sensor_msgs/NavSatFix");
  app.add_option("--odom-topic", options.odom_topic, "nav_msgs/Odometry");
  const auto* velocity_topic = app.add_option(
      "--velocity-topic", options.velocity_topic,
      "the receiver's velocity, east and north: " + std::string(kVelocityTypes) + ", where the bag has it; \"\": none");
  const auto* imu_topic = app.add_option("--imu-topic", options.imu_topic,
                                         "sensor_msgs/Imu whose yaw rate is used instead of the odometry's, where the "
                                         "bag has it; \"\": none");
  const auto* satellites_topic = app.add_option("--satellites-topic", options.satellites_topic,
                                                "urban_gnss_localization/SatelliteArray, whose residuals tell the "
                                                "ranges of a fix, where the bag has it; \"\": none");
  app.add_option("--truth-topic", options.truth_topic, "nav_msgs/Odometry, for the errors only");
  app.add_option("--datum", options.datum,
                 "LAT,LON,ALT (deg, deg, m); default: the bag's gps/datum, or the first fixes")
      ->delimiter(',')
      ->expected(3);
  app.add_option("--seed", options.seed, "seed of the random numbers; default: as in the parameters");
  line.add_json(options.json_file);
  app.add_option("--tum", options.tum_file, "write the trajectory here (TUM format, ENU about the datum)");
  return line.run(argc, argv, [&] {
    if (only_names) return print_variants(localizers);
    if (input->count() == 0) throw std::runtime_error("which bag? See --help");
    options.wants_velocity = velocity_topic->count() > 0 && !options.velocity_topic.empty();
    options.wants_satellites = satellites_topic->count() > 0 && !options.satellites_topic.empty();
    options.wants_imu = imu_topic->count() > 0 && !options.imu_topic.empty();
    run(options, localizers);
  });
}

}  // namespace urban_gnss
