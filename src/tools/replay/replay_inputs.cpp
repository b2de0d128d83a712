#include "replay_inputs.hpp"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>

#include "bag_messages.hpp"
#include "bag_receiver.hpp"
#include "nmea_log.hpp"
#include "urban_gnss_localization/evaluation/stamp_text.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/receiver_messages.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace urban_gnss {
namespace {

using Messages = std::vector<rosbag::MessageInstance>;
using urban_gnss_localization::SatelliteArray;

/// The topics that are read, without their leading slashes.
struct Topics {
  explicit Topics(const ReplayOptions& options)
      : fix(without_leading_slash(options.fix_topic)),
        odom(without_leading_slash(options.odom_topic)),
        imu(without_leading_slash(options.imu_topic)),
        velocity(without_leading_slash(options.velocity_topic)),
        satellites(without_leading_slash(options.satellites_topic)),
        points(without_leading_slash(options.points_topic)),
        truth(without_leading_slash(options.truth_topic)) {}

  /// In the order in which messages of one time are read.
  std::vector<std::string> ordered(bool with_occlusion) const {
    if (!with_occlusion) return {topics::kDatum, topics::kStaticTf, imu, odom, fix, velocity, satellites, truth};
    return {topics::kDatum, topics::kStaticTf, kTf, imu, odom, points, fix, velocity, satellites, truth};
  }

  std::string fix, odom, imu, velocity, satellites, points, truth;
};

/// Throws std::runtime_error, which lists what the bag has, where a topic that is needed has no message.
void require_topics(const rosbag::Bag& bag, const Messages& messages, const ReplayOptions& options, const Topics& names,
                    bool has_receiver) {
  const auto require = [&](bool is_needed, const std::string& option, const std::string& name) {
    const auto is_of_it = [&](const auto& message) { return without_leading_slash(message.getTopic()) == name; };
    if (!is_needed || std::any_of(messages.begin(), messages.end(), is_of_it)) return;
    throw std::runtime_error(options.input + " has no message on " + name + " (" + option + "); it has" +
                             topics_of(bag));
  };
  require(!has_receiver, "--fix-topic", names.fix);
  require(!options.without_odometry, "--odom-topic", names.odom);
  require(options.wants_imu && !options.without_odometry, "--imu-topic", names.imu);
  require(options.wants_velocity && !has_receiver, "--velocity-topic", names.velocity);
  require(options.wants_satellites && !has_receiver, "--satellites-topic", names.satellites);
}

bool has_topic(const rosbag::Bag& bag, const std::string& name) {
  rosbag::View all(bag);
  const auto connections = all.getConnections();
  return std::any_of(connections.begin(), connections.end(), [&](const rosbag::ConnectionInfo* connection) {
    return without_leading_slash(connection->topic) == name;
  });
}

/// Throws std::runtime_error, which names the point clouds that the bag has, where the one that is wanted has none.
void require_clouds(const rosbag::Bag& bag, const ReplayOptions& options, const Topics& names) {
  const std::string wanted = ros::message_traits::DataType<sensor_msgs::PointCloud2>::value();
  std::string clouds;
  rosbag::View all(bag);
  for (const rosbag::ConnectionInfo* connection : all.getConnections()) {
    const bool is_cloud = connection->datatype == wanted;
    if (is_cloud && without_leading_slash(connection->topic) == names.points) return;
    if (is_cloud) clouds += " " + connection->topic;
  }
  throw std::runtime_error(options.input + " has no " + wanted + " on " + names.points + " (--points-topic); " +
                           (clouds.empty() ? "it has none on any topic" : "it has them on" + clouds));
}

void give(const rosbag::MessageInstance& message, const Topics& names, ReplayRun& run) {
  const std::string name = without_leading_slash(message.getTopic());
  if (name == names.odom) {
    run.add_odometry(*expect<nav_msgs::Odometry>(message));
  } else if (name == names.fix) {
    run.add_fix(*expect<sensor_msgs::NavSatFix>(message));
  } else if (name == names.velocity) {
    const auto measured = to_raw_velocity_of(message);
    if (!measured) throw wrong_type(message, kVelocityTypes);
    run.add_velocity(*measured);
  } else if (name == names.satellites) {
    run.add_satellites(to_satellite_epoch(*expect<SatelliteArray>(message)));
  } else if (name == names.imu) {
    run.add_imu(*expect<sensor_msgs::Imu>(message));
  } else if (name == names.points) {
    run.add_cloud(expect<sensor_msgs::PointCloud2>(message));
  } else if (name == kTf) {
    run.add_tf(*expect<tf2_msgs::TFMessage>(message));
  } else if (name == topics::kStaticTf) {
    run.add_static_tf(*expect<tf2_msgs::TFMessage>(message));
  } else if (name == names.truth) {
    run.add_truth(*expect<nav_msgs::Odometry>(message));
  } else {
    run.set_datum(*expect<sensor_msgs::NavSatFix>(message));
  }
}

constexpr auto is_earlier = [](const auto& a, const auto& b) { return a.time < b.time; };

ReceiverRecording read_nmea_recording(const ReplayOptions& options) {
  if (options.receiver != "navsatfix") throw std::runtime_error("--nmea and --receiver: give one of them");
  const auto day = options.nmea_date.empty() ? std::nullopt : std::optional<Day>(parse_date(options.nmea_date));
  const NmeaLog log = read_nmea_log(options.nmea, day);
  for (const std::string& warning : log.output.warnings) std::cerr << options.nmea << ": " << warning << '\n';
  std::cerr << options.nmea << ": " << summary_of(log) << '\n';
  ReceiverRecording recording = to_recording(log, options.nmea);
  if (recording.outputs.empty()) throw std::runtime_error(options.nmea + ": no solution in it can be used");
  return recording;
}

}  // namespace

ReplayInputs::ReplayInputs(const ReplayOptions& options) {
  if (!options.input.empty()) {
    if (!std::filesystem::exists(options.input)) throw std::runtime_error(options.input + ": no such bag");
    bag_.open(options.input, rosbag::bagmode::Read);
  }
  read_receiver(options);
  if (bag_.isOpen()) read_topics(options);
  if (options.without_odometry) read_odometry_of_receiver();
  if (receiver_) {
    require_overlap();
    for (const TimedOutput& each : receiver_->outputs) {
      inputs_.push_back({each.time, [this, &output = each.output](ReplayRun& run) {
                           run.add_receiver(output, receiver_->antenna_frame);
                         }});
    }
  }
  std::stable_sort(inputs_.begin(), inputs_.end(), is_earlier);
  cut_out(options);
}

void ReplayInputs::cut_out(const ReplayOptions& options) {
  if (inputs_.empty()) return;
  const Stamp first = inputs_.front().time;
  const auto is_outside = [&](const ReplayInput& input) {
    const double into_s = to_seconds(input.time - first);
    return (into_s < options.start_s && !input.is_latched) || into_s > options.start_s + options.duration_s;
  };
  inputs_.erase(std::remove_if(inputs_.begin(), inputs_.end(), is_outside), inputs_.end());
  const auto is_of_part = [](const ReplayInput& input) { return !input.is_latched; };
  if (std::none_of(inputs_.begin(), inputs_.end(), is_of_part)) {
    throw std::runtime_error(options.input + ": has no message after --start");
  }
}

void ReplayInputs::read_receiver(const ReplayOptions& options) {
  if (!options.nmea.empty()) {
    receiver_ = read_nmea_recording(options);
  } else if (find_receiver_preset(options.receiver).make != nullptr) {
    receiver_ = decode_receiver(bag_, options);
  } else if (options.without_odometry) {
    receiver_ = read_receiver_topics(bag_, options);
  }
}

void ReplayInputs::read_topics(const ReplayOptions& options) {
  const auto shared_names = std::make_shared<const Topics>(options);  // one for all messages
  const Topics& names = *shared_names;
  std::vector<std::string> wanted = names.ordered(options.occlusion);
  const auto leave_out = [&](const std::string& name) {
    wanted.erase(std::remove(wanted.begin(), wanted.end(), name), wanted.end());
  };
  if (receiver_) {
    for (const std::string& name : {names.fix, names.velocity, names.satellites}) leave_out(name);
  }
  if (options.without_odometry) {
    for (const std::string& name : {names.odom, names.imu}) leave_out(name);
  }
  if (options.occlusion) {
    require_clouds(bag_, options, names);
    if (!receiver_ && !has_topic(bag_, names.satellites)) {
      std::cerr << options.input << " has no topic " << names.satellites
                << " (--satellites-topic): fixes are weighed by the blocked share of the sky\n";
    }
  }
  const std::string fused = receiver_ ? "" : why_not_a_receiver(names.fix);
  if (!fused.empty()) throw std::runtime_error("--fix-topic: " + fused);
  const Messages messages = ordered_messages(bag_, wanted);
  require_topics(bag_, messages, options, names, receiver_.has_value());
  for (const rosbag::MessageInstance& message : messages) {
    const std::string topic = without_leading_slash(message.getTopic());
    const bool is_latched = topic == topics::kDatum || topic == topics::kStaticTf;
    inputs_.push_back({to_stamp(message.getTime()),
                       [message, shared_names](ReplayRun& run) { give(message, *shared_names, run); }, is_latched});
  }
}

void ReplayInputs::read_odometry_of_receiver() {
  for (const TimedOdometry& each : odometry_of(*receiver_)) {
    inputs_.push_back({each.time, [sample = each.sample](ReplayRun& run) { run.add_odometry(sample); }});
  }
}

/// Throws std::runtime_error where bag and receiver are of different times.
void ReplayInputs::require_overlap() const {
  if (inputs_.empty() || receiver_->outputs.empty()) return;
  const auto [first, last] = std::minmax_element(inputs_.begin(), inputs_.end(), is_earlier);
  const auto [from, to] = std::minmax_element(receiver_->outputs.begin(), receiver_->outputs.end(), is_earlier);
  if (first->time <= to->time && from->time <= last->time) return;
  throw std::runtime_error(receiver_->source + " is of " + format_stamp(from->time) + " to " + format_stamp(to->time) +
                           " s, the rest of " + format_stamp(first->time) + " to " + format_stamp(last->time) +
                           " s: nothing is of the same time (a wrong date?)");
}

bool ReplayInputs::has_transforms_from(const std::string& frame) const {
  rosbag::View view(bag_, [](const rosbag::ConnectionInfo* connection) {
    return without_leading_slash(connection->topic) == kTf &&
           connection->datatype == ros::message_traits::DataType<tf2_msgs::TFMessage>::value();
  });
  return std::any_of(view.begin(), view.end(), [&](const rosbag::MessageInstance& message) {
    const auto& transforms = message.instantiate<tf2_msgs::TFMessage>()->transforms;
    return std::any_of(transforms.begin(), transforms.end(),
                       [&](const auto& each) { return without_leading_slash(each.header.frame_id) == frame; });
  });
}

double ReplayInputs::duration_s() const {
  return inputs_.empty() ? 0.0 : to_seconds(inputs_.back().time - inputs_.front().time);
}

}  // namespace urban_gnss
