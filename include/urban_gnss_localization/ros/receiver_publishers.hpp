#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>

#include <string>

#include "urban_gnss_localization/receivers/receiver_input.hpp"

namespace urban_gnss {

/// gps/fix, gps/velocity and gps/satellites of a receiver, whatever it was read from.
class ReceiverPublishers {
 public:
  explicit ReceiverPublishers(ros::NodeHandle& node);

  /// Publishes all of it, in the antenna's `frame`, and logs the warnings.
  void publish(const ReceiverOutput& output, const std::string& frame) const;

 private:
  ros::Publisher fix_;
  ros::Publisher velocity_;
  ros::Publisher satellites_;
};

/// A line for each count.
void add_counts(const ReceiverCounts& counts, diagnostic_updater::DiagnosticStatusWrapper& status);

}  // namespace urban_gnss
