#pragma once

#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "urban_gnss_localization/ros/topics.hpp"

namespace urban_gnss {

/// The messages of the bag in a fixed order: by the time they were recorded, then by what they are (as in `names`).
inline std::vector<rosbag::MessageInstance> ordered_messages(const rosbag::Bag& bag,
                                                             const std::vector<std::string>& names) {
  rosbag::View view(bag, [&](const rosbag::ConnectionInfo* connection) {
    return std::find(names.begin(), names.end(), without_leading_slash(connection->topic)) != names.end();
  });
  const std::vector<rosbag::MessageInstance> as_read(view.begin(), view.end());
  struct Key {
    ros::Time time;
    std::ptrdiff_t rank;
    std::size_t index;
  };
  std::vector<Key> keys;
  keys.reserve(as_read.size());
  for (std::size_t i = 0; i < as_read.size(); ++i) {
    const auto name = std::find(names.begin(), names.end(), without_leading_slash(as_read[i].getTopic()));
    keys.push_back({as_read[i].getTime(), name - names.begin(), i});
  }
  std::stable_sort(keys.begin(), keys.end(),
                   [](const Key& a, const Key& b) { return a.time != b.time ? a.time < b.time : a.rank < b.rank; });
  std::vector<rosbag::MessageInstance> messages;
  messages.reserve(keys.size());
  for (const Key& key : keys) messages.push_back(as_read[key.index]);
  return messages;
}

/// What the bag has, one topic with its type a line, each after a line break.
inline std::string topics_of(const rosbag::Bag& bag) {
  std::string text;
  rosbag::View all(bag);
  for (const rosbag::ConnectionInfo* connection : all.getConnections()) {
    text += "\n  " + connection->topic + " (" + connection->datatype + ")";
  }
  return text;
}

inline std::runtime_error wrong_type(const rosbag::MessageInstance& message, const std::string& expected) {
  return std::runtime_error(message.getTopic() + ": is " + message.getDataType() + ", must be " + expected);
}

/// The message as an M. Throws std::runtime_error where it is of another type.
template <class M>
boost::shared_ptr<M> expect(const rosbag::MessageInstance& message) {
  const auto typed = message.instantiate<M>();
  if (!typed) throw wrong_type(message, ros::message_traits::DataType<M>::value());
  return typed;
}

}  // namespace urban_gnss
