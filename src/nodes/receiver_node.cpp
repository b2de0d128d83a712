// The messages of a receiver's driver in, gps/fix, gps/velocity and gps/satellites out, with one stamp a solution.
// Parameters: ReceiverNodeParameters (docs/parameters.md); the topics of each driver are in docs/receivers.md.

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>
#include <topic_tools/shape_shifter.h>

#include <algorithm>

#include "urban_gnss_localization/receivers/receiver_input.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/node_parameters.hpp"
#include "urban_gnss_localization/ros/node_shell.hpp"
#include "urban_gnss_localization/ros/receiver_messages.hpp"
#include "urban_gnss_localization/ros/receiver_node_parameters.hpp"
#include "urban_gnss_localization/ros/receiver_publishers.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

using namespace urban_gnss;

namespace {

using topic_tools::ShapeShifter;
using ShapeEvent = ros::MessageEvent<const ShapeShifter>;

class ReceiverNode {
 public:
  ReceiverNode(ros::NodeHandle& node, ros::NodeHandle& private_node)
      : parameters_(read_private<ReceiverNodeParameters>(private_node)),
        preset_(find_receiver_preset(parameters_.receiver)),
        input_(preset_),
        publishers_(node),
        diagnostics_(ros::NodeHandle(), private_node) {
    for (const ReceiverTopic& topic : preset_.topics) subscribe(node, topic);
    diagnostics_.setHardwareID(preset_.driver);
    diagnostics_.add("receiver", this, &ReceiverNode::diagnose);
    second_timer_ = node.createWallTimer(ros::WallDuration(1.0),
                                         [this](const ros::WallTimerEvent&) { diagnostics_.force_update(); });
    five_second_timer_ =
        node.createWallTimer(ros::WallDuration(5.0), [this](const ros::WallTimerEvent&) { warn_of_silence(); });
  }

 private:
  void subscribe(ros::NodeHandle& node, const ReceiverTopic& topic) {
    const std::string name = node.resolveName(full_name(parameters_.ns.empty() ? preset_.ns : parameters_.ns, topic));
    const std::string fault = why_not_a_receiver(name);
    if (!fault.empty()) throw std::runtime_error(fault);
    const boost::function<void(const ShapeEvent&)> callback = [this, name, &topic](const ShapeEvent& event) {
      io_.run(name, [&] { on_message(name, topic, event); });
    };
    subscribers_.push_back(
        node.subscribe<ShapeShifter>(name, 1000, callback, ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay()));
  }

  void on_message(const std::string& name, const ReceiverTopic& topic, const ShapeEvent& event) {
    add_message(*event.getConstMessage(), name, topic, to_stamp(event.getReceiptTime()), input_);
    publishers_.publish(input_.take(), parameters_.frame.empty() ? input_.frame_id() : parameters_.frame);
  }

  std::string subscribed() const {
    std::string names;
    for (const ros::Subscriber& each : subscribers_) names += (names.empty() ? "" : ", ") + each.getTopic();
    return names;
  }

  /// Topics of the driver's types that are somewhere else, for people.
  std::string elsewhere() const {
    ros::master::V_TopicInfo all;
    ros::master::getTopics(all);
    std::string names;
    ros::V_string own;
    ros::this_node::getAdvertisedTopics(own);
    for (const ros::master::TopicInfo& info : all) {
      if (std::find(own.begin(), own.end(), info.name) != own.end()) continue;
      for (const ReceiverTopic& topic : preset_.topics) {
        const bool is_so_called = namespace_of(without_leading_slash(info.name), topic).has_value();
        if (is_so_called && is_type_of(topic, info.datatype)) names += " " + info.name;
      }
    }
    return names.empty() ? "" : "; there are" + names + ": receiver_ns:= says where";
  }

  void warn_of_silence() const {
    if (!input_.received().empty()) return;
    ROS_WARN_STREAM("no message of the receiver " << preset_.name << " on " << subscribed() << elsewhere());
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
    using diagnostic_msgs::DiagnosticStatus;
    const ReceiverCounts& counts = input_.counts();
    if (input_.received().empty()) {
      status.summary(DiagnosticStatus::WARN, "no message on " + subscribed());
    } else if (!input_.last_error().empty()) {
      status.summary(DiagnosticStatus::ERROR, input_.last_error());
    } else if (counts.fixes == 0) {
      status.summary(DiagnosticStatus::WARN, "the receiver has no fix");
    } else if (counts.epochs == 0) {
      status.summary(DiagnosticStatus::OK, "fixes without satellites");
    } else {
      status.summary(DiagnosticStatus::OK, "fixes with satellites");
    }
    status.add("receiver", preset_.name);
    add_counts(counts, status);
    for (const auto& [topic, count] : input_.received()) status.add("messages on " + topic, count);
    for (const auto& [topic, count] : input_.unreadable()) status.add("unreadable messages on " + topic, count);
    io_.diagnose(status);
  }

  const ReceiverNodeParameters parameters_;
  const ReceiverPreset& preset_;
  ReceiverInput input_;
  EventLog log_;
  NodeShell io_{log_};
  ReceiverPublishers publishers_;
  std::vector<ros::Subscriber> subscribers_;
  diagnostic_updater::Updater diagnostics_;
  ros::WallTimer second_timer_;
  ros::WallTimer five_second_timer_;
};

}  // namespace

int main(int argc, char** argv) {
  return run_node(argc, argv, "receiver", [](ros::NodeHandle& node, ros::NodeHandle& private_node) {
    return std::make_shared<ReceiverNode>(node, private_node);
  });
}
