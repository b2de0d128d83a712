#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>

#include <boost/function.hpp>
#include <boost/shared_ptr.hpp>
#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "urban_gnss_localization/ros/event_log.hpp"
#include "urban_gnss_localization/ros/message_faults.hpp"

namespace urban_gnss {

/// The clock by which a stamp is implausible. Stamps of the past are never: a bag is played.
class StampCheck {
 public:
  /// Why a stamp of the topic cannot be one; empty where it can. One that is more than an hour ahead of `now` can be
  /// only where several go on from one another: then `now` is wrong.
  std::string fault(const std::string& topic, const ros::Time& stamp, const ros::Time& now);

 private:
  struct Run {
    ros::Time last;
    int length{0};
  };
  std::map<std::string, Run> ahead_;
};

/// What stands between ROS and a node: every message comes in through it, every message goes out through it, and
/// nothing that is thrown gets past it. It counts what it holds back, says so, and is an ERROR in the diagnostics for a
/// minute after something went out wrong or was thrown. Of one thread.
class NodeShell {
 public:
  explicit NodeShell(EventLog& log) : log_(log) {}

  template <class Message>
  using Take = std::function<void(const boost::shared_ptr<const Message>&)>;
  template <class Message>
  using Refuse = std::function<void(const Message&, const std::string& why)>;

  /// Messages whose header.stamp cannot be one are held back; `refuse` is told of each.
  template <class Message>
  ros::Subscriber subscribe(ros::NodeHandle& node, const std::string& topic, std::uint32_t queue, Take<Message> take,
                            const ros::TransportHints& hints = {}, Refuse<Message> refuse = {}) {
    return subscribe_any<Message>(
        node, topic, queue,
        [this, topic, take, refuse](const boost::shared_ptr<const Message>& message) {
          const std::string fault = stamp_fault(topic, message->header.stamp);
          if (fault.empty()) {
            take(message);
          } else if (refuse) {
            refuse(*message, fault);
          }
        },
        hints);
  }
  /// Messages whose stamp means nothing.
  template <class Message>
  ros::Subscriber subscribe_any(ros::NodeHandle& node, const std::string& topic, std::uint32_t queue,
                                Take<Message> take, const ros::TransportHints& hints = {}) {
    const boost::function<void(const boost::shared_ptr<const Message>&)> callback =
        [this, topic, take](const boost::shared_ptr<const Message>& message) { run(topic, [&] { take(message); }); };
    return node.subscribe<Message>(topic, queue, callback, ros::VoidConstPtr(), hints);
  }
  ros::WallTimer every(ros::NodeHandle& node, double period_s, const std::string& what,
                       const std::function<void()>& work) {
    return node.createWallTimer(ros::WallDuration(period_s),
                                [this, what, work](const ros::WallTimerEvent&) { run(what, work); });
  }
  template <class Request, class Response>
  ros::ServiceServer serve(ros::NodeHandle& node, const std::string& name,
                           const std::function<void(Request&, Response&)>& answer) {
    const boost::function<bool(Request&, Response&)> callback = [this, name, answer](Request& request,
                                                                                     Response& response) {
      return run(name, [&] { answer(request, response); });
    };
    return node.advertiseService<Request, Response>(name, callback);
  }

  /// Whether the stamp of a message can be one; counted and said where it cannot. Returns why.
  std::string stamp_fault(const std::string& topic, const ros::Time& stamp);
  /// A message is held back for what is wrong with it: counted and said.
  void refuse(const std::string& topic, const std::string& fault);
  /// Runs it. Whether nothing was thrown.
  bool run(const std::string& what, const std::function<void()>& work);

  /// Whether the message may go out (message_fault()); counted and said where not.
  template <class Message>
  bool lets_out(const std::string& topic, const Message& message) {
    const std::string fault = message_fault(message);
    if (!fault.empty()) hold_back(topic, fault);
    return fault.empty();
  }
  template <class Message>
  bool publish(const ros::Publisher& publisher, const Message& message) {
    if (!lets_out(publisher.getTopic(), message)) return false;
    publisher.publish(message);
    return true;
  }
  /// As a shared pointer, which reaches subscribers in the same process without a copy.
  template <class Message>
  bool publish_shared(const ros::Publisher& publisher, const boost::shared_ptr<const Message>& message) {
    if (!lets_out(publisher.getTopic(), *message)) return false;
    publisher.publish(message);
    return true;
  }

  /// Logs them; errors are some in the diagnostics, too.
  void report(const std::vector<PipelineEvent>& events);
  /// Something went wrong within: an ERROR in the diagnostics.
  void note_error(const std::string& what);
  /// Adds the counts, and an ERROR to the summary.
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) const;

 private:
  void hold_back(const std::string& topic, const std::string& fault);

  EventLog& log_;
  StampCheck stamps_;
  std::size_t refused_{0};
  std::size_t held_back_{0};
  std::size_t thrown_{0};
  std::string last_refusal_;
  std::string last_error_;
  ros::WallTime last_error_time_;
};

}  // namespace urban_gnss
