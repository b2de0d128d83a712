#pragma once

#include <ros/ros.h>
#include <tf2_msgs/TFMessage.h>
#include <tf2_ros/buffer.h>

#include <map>
#include <string>

#include "urban_gnss_localization/pipeline/stamp_monitor.hpp"
#include "urban_gnss_localization/ros/node_shell.hpp"

namespace urban_gnss {

/// Listens to /tf and /tf_static in the node's own thread. A tf2_ros::TransformListener believes every stamp: one of
/// the future silences a frame until then, one beyond all time ends the process. Here each transform comes in by the
/// shell, one odd stamp is left out, and where a frame goes on in the past the buffer, which holds the future, is
/// cleared.
class TransformInput {
 public:
  /// Keeps the shell.
  TransformInput(ros::NodeHandle& node, NodeShell& shell);

  const tf2_ros::Buffer& buffer() const { return buffer_; }
  tf2_ros::Buffer& buffer() { return buffer_; }
  /// Forgets all that is not static.
  void clear();

 private:
  void add(const tf2_msgs::TFMessage& message, bool is_static);
  /// Whether it is to be taken.
  bool admits(const geometry_msgs::TransformStamped& transform);

  NodeShell& shell_;
  tf2_ros::Buffer buffer_;
  std::map<std::string, StampMonitor> frames_;  ///< by the child's name
  ros::Subscriber tf_subscriber_;
  ros::Subscriber static_subscriber_;
};

}  // namespace urban_gnss
