#pragma once

#include <ros/node_handle.h>
#include <ros/subscriber.h>

#include <string>

#include "urban_gnss_localization/ros/event_log.hpp"

namespace urban_gnss {

/// Watches one subscribed topic for two faults of a graph: two publishers at once, and a frame that changes. Reports
/// each change once.
class InputWatch {
 public:
  /// Keeps the log.
  explicit InputWatch(EventLog& log) : log_(log) {}

  void set_subscriber(const ros::Subscriber& subscriber) { subscriber_ = subscriber; }
  std::string topic() const { return subscriber_.getTopic(); }
  std::uint32_t publishers() const { return subscriber_.getNumPublishers(); }

  /// To be called with each message's frame.
  void observe_frame(const std::string& frame) { say(fault_of_frame(frame)); }
  /// To be called now and then.
  void check_publishers() { say(fault_of_publishers(publishers())); }

  /// What is to be said of the next message's frame; empty where nothing is. A frame that is empty says nothing: a
  /// receiver's driver may not know it yet.
  std::string fault_of_frame(const std::string& frame);
  /// The same of the number of publishers.
  std::string fault_of_publishers(std::uint32_t count);

 private:
  void say(const std::string& warning);

  EventLog& log_;
  ros::Subscriber subscriber_;
  std::string frame_;
  bool warned_of_publishers_{false};
};

}  // namespace urban_gnss
