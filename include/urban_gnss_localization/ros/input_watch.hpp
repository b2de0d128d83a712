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

  /// To be called with each message's frame; whether it has changed. An empty one says nothing: a receiver's driver may
  /// not know it yet.
  bool observe_frame(const std::string& frame);
  /// To be called now and then.
  void check_publishers();

 private:
  EventLog& log_;
  ros::Subscriber subscriber_;
  std::string frame_;
  bool warned_of_publishers_{false};
};

}  // namespace urban_gnss
