#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>

#include <atomic>
#include <mutex>
#include <thread>

#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/event_log.hpp"
#include "urban_gnss_localization/ros/gpsd_node_parameters.hpp"
#include "urban_gnss_localization/ros/node_parameters.hpp"
#include "urban_gnss_localization/ros/receiver_publishers.hpp"
#include "urban_gnss_localization/ros/tcp_lines.hpp"

namespace urban_gnss {
namespace {

/// Publishes what gpsd reports as fixes, velocities and satellites, and goes back to a gpsd that was restarted.
class GpsdNode {
 public:
  GpsdNode(ros::NodeHandle& node, ros::NodeHandle& private_node)
      : parameters_(read_private<GpsdNodeParameters>(private_node)),
        decoder_(parameters_.gpsd),
        publishers_(node),
        diagnostics_(ros::NodeHandle(), private_node) {
    diagnostics_.setHardwareID(server());
    diagnostics_.add("gpsd", this, &GpsdNode::diagnose);
    second_timer_ = node.createWallTimer(ros::WallDuration(1.0),
                                         [this](const ros::WallTimerEvent&) { diagnostics_.force_update(); });
    five_second_timer_ = node.createWallTimer(ros::WallDuration(5.0), [this](const ros::WallTimerEvent&) {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (is_connected_ && is_silent()) ROS_WARN_STREAM("waiting for solutions of gpsd at " << server());
    });
    reader_ = std::thread([this] { read_until_stopped(); });
  }
  ~GpsdNode() {
    is_stopped_ = true;
    reader_.join();
  }

 private:
  std::string server() const { return parameters_.host + ":" + std::to_string(parameters_.port); }

  void read_until_stopped() {
    while (!is_stopped_) {
      try {
        if (lines_.is_open() || connect()) read_next();
      } catch (const std::exception& error) {  // one line is lost, not the node
        ROS_ERROR_STREAM("a report of gpsd failed: " << log_line(error.what()));
      }
    }
  }

  void read_next() {
    const auto line = lines_.read_line(parameters_.settle_time);
    const std::lock_guard<std::mutex> lock(mutex_);
    if (line) {
      decoder_.add(*line, to_stamp(ros::Time::now()));
    } else {
      decoder_.settle();
    }
    ReceiverOutput output = decoder_.take();
    make_sound(output);
    publish(output);
    if (!lines_.is_open()) {
      is_connected_ = false;
      decoder_.reset();
      ROS_WARN_STREAM("gpsd at " << server() << " has ended the connection; trying again every "
                                 << parameters_.reconnect_period << " s");
    }
  }

  /// One attempt, and the pause after one that failed.
  bool connect() {
    const std::string fault = lines_.open(parameters_.host, parameters_.port);
    if (!fault.empty()) {
      ROS_WARN_STREAM_THROTTLE(5.0, "no gpsd at " << server() << " (" << fault << "); trying again every "
                                                  << parameters_.reconnect_period << " s");
      const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(parameters_.reconnect_period);
      while (!is_stopped_ && ros::WallTime::now() < end) ros::WallDuration(0.05).sleep();
      return false;
    }
    lines_.send("?WATCH={\"enable\":true,\"json\":true}\n");
    const std::lock_guard<std::mutex> lock(mutex_);
    is_connected_ = true;
    ++connections_;
    ROS_INFO_STREAM("connected to gpsd at " << server());
    return true;
  }

  void publish(const ReceiverOutput& output) {
    publishers_.publish(output, parameters_.frame);
    counter_.add(output);
    if (!output.fixes.empty()) last_ = ros::WallTime::now();
  }

  /// Requires the lock.
  bool is_silent() const {
    constexpr double kSilence_s = 5.0;
    return last_.isZero() || (ros::WallTime::now() - last_).toSec() > kSilence_s;
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
    using diagnostic_msgs::DiagnosticStatus;
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!is_connected_) {
      status.summary(DiagnosticStatus::ERROR, "no gpsd at " + server());
    } else if (is_silent()) {
      status.summary(DiagnosticStatus::WARN, "gpsd reports no solutions: has it a device? (gpsd -n, cgps)");
    } else if (decoder_.mode() < 2) {
      status.summary(DiagnosticStatus::WARN, "the receiver has no fix");
    } else if (counter_.counts().epochs == 0) {
      status.summary(DiagnosticStatus::WARN, "fixes without satellites (GSV of NMEA, NAV-SAT of u-blox are off?)");
    } else {
      status.summary(DiagnosticStatus::OK, "fixes with satellites");
    }
    status.add("server", server());
    status.add("release", decoder_.release());
    status.add("device", decoder_.device());
    status.add("mode", decoder_.mode());
    status.add("connections", connections_);
    add_counts(counter_.counts(), status);
  }

  const GpsdNodeParameters parameters_;
  TcpLines lines_;    ///< the reader's
  std::mutex mutex_;  ///< of all below that the reader and diagnose() share
  GpsdDecoder decoder_;
  bool is_connected_{false};
  std::size_t connections_{0};
  ReceiverCounter counter_;
  ros::WallTime last_;

  ReceiverPublishers publishers_;
  diagnostic_updater::Updater diagnostics_;
  ros::WallTimer second_timer_;
  ros::WallTimer five_second_timer_;
  std::atomic<bool> is_stopped_{false};
  std::thread reader_;
};

}  // namespace
}  // namespace urban_gnss

int main(int argc, char** argv) {
  return urban_gnss::run_node(argc, argv, "gpsd", [](ros::NodeHandle& node, ros::NodeHandle& private_node) {
    return std::make_shared<urban_gnss::GpsdNode>(node, private_node);
  });
}
