#include "bag_receiver.hpp"

#include <algorithm>
#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/receiver_messages.hpp"

namespace urban_gnss {
namespace {

using urban_gnss_localization::SatelliteArray;

/// The topics of a receiver in a bag, by their full names.
using TopicsInBag = std::map<std::string, const ReceiverTopic*>;

/// All receivers of the preset's kind in the bag, by their namespaces.
std::map<std::string, TopicsInBag> find_receivers(const BagReader& bag, const ReceiverPreset& preset) {
  std::map<std::string, TopicsInBag> receivers;
  for (const BagConnection& connection : bag.connections()) {
    const std::string full = without_leading_slash(connection.topic);
    for (const ReceiverTopic& topic : preset.topics) {
      const auto ns = namespace_of(full, topic);
      if (ns && is_type_of(topic, connection.type)) receivers[*ns][full] = &topic;
    }
  }
  return receivers;
}

TopicsInBag find_receiver(const BagReader& bag, const ReceiverPreset& preset, const ReplayOptions& options) {
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
    throw std::runtime_error(bag.name() + " has several receivers of the kind " + preset.name +
                             ": say which by --receiver-ns, one of" + names);
  }
  throw std::runtime_error(bag.name() + " has no topic of the receiver " + preset.name +
                           (options.receiver_ns.empty() ? "" : " in " + options.receiver_ns) + "; it has" +
                           bag.topics());
}

}  // namespace

BagReceiver::BagReceiver(const BagReader& bag, const ReplayOptions& options)
    : topics_(find_receiver(bag, find_receiver_preset(options.receiver), options)),
      source_(options.receiver + ":"),
      input_(find_receiver_preset(options.receiver)) {
  for (const ReceiverTopic& topic : find_receiver_preset(options.receiver).topics) {
    for (const auto& [name, found] : topics_) {
      if (found != &topic) continue;
      names_.push_back(name);
      source_ += " " + name;
      left_ += bag.count(name);
    }
  }
}

ReceiverOutput BagReceiver::add(const BagMessage& message) {
  const ReceiverTopic& topic = *topics_.at(without_leading_slash(message.getTopic()));
  add_message(message, message.getTopic(), topic, message.time(), input_);
  if (left_ > 0 && --left_ == 0) input_.finish();
  return input_.take();
}

std::size_t BagReceiver::unreadable() const {
  std::size_t sum = 0;
  for (const auto& [topic, count] : input_.unreadable()) sum += count;
  return sum;
}

ReceiverRecording decode_receiver(const BagReader& bag, const ReplayOptions& options) {
  BagReceiver receiver(bag, options);
  ReceiverRecording recording;
  recording.source = receiver.source();
  BagMessages messages(bag, receiver.names());
  while (const auto message = messages.next()) {
    ReceiverOutput output = receiver.add(*message);
    if (!output.empty()) recording.outputs.push_back({message->time(), std::move(output)});
  }
  recording.counts = receiver.counts();
  recording.antenna_frame = receiver.antenna_frame();
  recording.unreadable = receiver.unreadable();
  return recording;
}

ReceiverRecording read_receiver_topics(const BagReader& bag, const ReplayOptions& options) {
  const std::string fix = without_leading_slash(options.fix_topic);
  const std::string velocity = without_leading_slash(options.velocity_topic);
  const std::string satellites = without_leading_slash(options.satellites_topic);
  ReceiverRecording recording;
  recording.source = "topics: " + fix + " " + velocity + " " + satellites;
  ReceiverCounter counter;
  BagMessages messages(bag, {fix, velocity, satellites});
  while (const auto next = messages.next()) {
    const BagMessage& message = *next;
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
    recording.outputs.push_back({message.time(), std::move(output)});
  }
  recording.counts = counter.counts();
  return recording;
}

}  // namespace urban_gnss
