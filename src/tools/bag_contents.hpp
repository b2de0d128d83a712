#pragma once

#include <algorithm>
#include <filesystem>
#include <functional>
#include <iomanip>
#include <memory>
#include <ostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "files/output_bag.hpp"
#include "urban_gnss_localization/evaluation/stamp_text.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"

namespace urban_gnss {

/// As to_ros, but what does not fit is an error of the file.
inline ros::Time to_ros_or_throw(Stamp stamp) {
  const ros::Time time = to_ros(stamp);
  if (stamp <= Stamp(0) || to_stamp(time) != stamp) {
    throw std::runtime_error("stamp " + format_stamp(stamp) + " s does not fit a ROS time");
  }
  return time;
}

/// Messages of many topics on their way into one bag.
class BagContents {
 public:
  /// `name` is the topic's without its leading slash; bags have absolute names, as rosbag record writes them.
  template <class Message>
  void add(const std::string& name, Stamp stamp, const Message& message) {
    const std::string topic = "/" + name;
    auto shared = std::make_shared<const Message>(message);
    entries_.push_back(
        {stamp, [topic, shared](OutputBag& bag, Stamp time) { bag.write(topic, to_ros_or_throw(time), *shared); }});
    const auto known = std::find_if(topics_.begin(), topics_.end(), [&](const Topic& t) { return t.name == topic; });
    if (known == topics_.end()) {
      topics_.push_back({topic, 1, stamp, stamp});
    } else {
      ++known->count;
      known->first = std::min(known->first, stamp);
      known->last = std::max(known->last, stamp);
    }
  }

  /// Messages of one stamp are written in the order in which they were added, each a nanosecond after the one before
  /// it: who reads a bag gets messages of equal times in an order that rosbag does not define. Only the bag's times
  /// are moved, not the messages' own stamps.
  void write(const std::filesystem::path& path, const InputFiles& inputs) {
    std::stable_sort(entries_.begin(), entries_.end(),
                     [](const Entry& a, const Entry& b) { return a.stamp < b.stamp; });
    OutputBag bag(path, inputs);
    Stamp last(0);
    for (const Entry& entry : entries_) {
      last = std::max(entry.stamp, last + Stamp(1));
      entry.write(bag, last);
    }
    bag.close();
  }

  void print_summary(std::ostream& out) const {
    out << std::left << std::setw(24) << "topic" << std::right << std::setw(9) << "messages" << std::setw(18)
        << "from, s" << std::setw(18) << "to, s" << '\n';
    out << std::fixed << std::setprecision(3);
    for (const Topic& topic : topics_) {
      out << std::left << std::setw(24) << topic.name << std::right << std::setw(9) << topic.count << std::setw(18)
          << to_seconds(topic.first) << std::setw(18) << to_seconds(topic.last) << '\n';
    }
  }

 private:
  struct Entry {
    Stamp stamp;
    std::function<void(OutputBag&, Stamp)> write;
  };
  struct Topic {
    std::string name;
    std::size_t count;
    Stamp first;
    Stamp last;
  };
  std::vector<Entry> entries_;
  std::vector<Topic> topics_;
};

}  // namespace urban_gnss
