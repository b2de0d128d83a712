#include "bag_receiver.hpp"

#include <algorithm>
#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

#include "bag_messages.hpp"
#include "urban_gnss_localization/receivers/receiver_input.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/receiver_messages.hpp"

namespace urban_gnss {
namespace {

using urban_gnss_localization::SatelliteArray;

/// The topics of a receiver in a bag, by their full names.
using TopicsInBag = std::map<std::string, const ReceiverTopic*>;

/// All receivers of the preset's kind in the bag, by their namespaces.
std::map<std::string, TopicsInBag> find_receivers(const rosbag::Bag& bag, const ReceiverPreset& preset) {
  std::map<std::string, TopicsInBag> receivers;
  rosbag::View all(bag);
  for (const rosbag::ConnectionInfo* connection : all.getConnections()) {
    const std::string full = without_leading_slash(connection->topic);
    for (const ReceiverTopic& topic : preset.topics) {
      const auto ns = namespace_of(full, topic);
      if (ns && is_type_of(topic, connection->datatype)) receivers[*ns][full] = &topic;
    }
  }
  return receivers;
}

TopicsInBag find_receiver(const rosbag::Bag& bag, const ReceiverPreset& preset, const ReplayOptions& options) {
  const std::map<std::string, TopicsInBag> receivers = find_receivers(bag, preset);
  const std::string wanted = without_leading_slash(options.receiver_ns);
  if (!options.receiver_ns.empty()) {
    const auto found = receivers.find(wanted.empty() ? "/" : wanted);
    if (found != receivers.end()) return found->second;
  } else if (!receivers.empty()) {
    std::size_t most = 0;
    for (const auto& [ns, topics] : receivers) most = std::max(most, topics.size());
    std::vector<std::string> best;
    for (const auto& [ns, topics] : receivers) {
      if (topics.size() == most) best.push_back(ns);
    }
    if (best.size() == 1) return receivers.at(best.front());
    std::string names;
    for (const std::string& ns : best) names += " " + ns;
    throw std::runtime_error(options.input + " has several receivers of the kind " + preset.name +
                             ": say which by --receiver-ns, one of" + names);
  }
  throw std::runtime_error(options.input + " has no topic of the receiver " + preset.name +
                           (options.receiver_ns.empty() ? "" : " in " + options.receiver_ns) + "; it has" +
                           topics_of(bag));
}

}  // namespace

ReceiverRecording decode_receiver(const rosbag::Bag& bag, const ReplayOptions& options) {
  const ReceiverPreset& preset = find_receiver_preset(options.receiver);
  const TopicsInBag topics = find_receiver(bag, preset, options);
  std::vector<std::string> names;
  ReceiverRecording recording;
  recording.source = preset.name + ":";
  for (const ReceiverTopic& topic : preset.topics) {
    for (const auto& [name, found] : topics) {
      if (found != &topic) continue;
      names.push_back(name);
      recording.source += " " + name;
    }
  }
  ReceiverInput input(preset);
  Stamp last(0);
  const auto take = [&] {
    ReceiverOutput output = input.take();
    if (!output.empty()) recording.outputs.push_back({last, std::move(output)});
  };
  for (const rosbag::MessageInstance& message : ordered_messages(bag, names)) {
    last = to_stamp(message.getTime());
    const ReceiverTopic& topic = *topics.at(without_leading_slash(message.getTopic()));
    add_message(message, message.getTopic(), topic, last, input);
    take();
  }
  input.finish();
  take();
  recording.counts = input.counts();
  recording.antenna_frame = input.frame_id();
  for (const auto& [topic, count] : input.unreadable()) recording.unreadable += count;
  return recording;
}

ReceiverRecording read_receiver_topics(const rosbag::Bag& bag, const ReplayOptions& options) {
  const std::string fix = without_leading_slash(options.fix_topic);
  const std::string velocity = without_leading_slash(options.velocity_topic);
  const std::string satellites = without_leading_slash(options.satellites_topic);
  ReceiverRecording recording;
  recording.source = "topics: " + fix + " " + velocity + " " + satellites;
  ReceiverCounter counter;
  for (const rosbag::MessageInstance& message : ordered_messages(bag, {fix, velocity, satellites})) {
    const std::string name = without_leading_slash(message.getTopic());
    ReceiverOutput output;
    if (name == fix) {
      output.fixes.push_back(to_raw_fix(*expect<sensor_msgs::NavSatFix>(message)));
    } else if (name == velocity) {
      const auto measured = to_raw_velocity_of(message);
      if (!measured) throw wrong_type(message, kVelocityTypes);
      output.velocities.push_back(*measured);
    } else {
      output.satellites.push_back(to_satellite_epoch(*expect<SatelliteArray>(message)));
    }
    counter.add(output);
    recording.outputs.push_back({to_stamp(message.getTime()), std::move(output)});
  }
  recording.counts = counter.counts();
  return recording;
}

}  // namespace urban_gnss
