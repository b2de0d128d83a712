// How long a live localizer takes from a fix to the odometry/filtered that has it. dev/latency.py runs it:
//
//   latency_probe SECONDS    drives straight ahead, and prints the times
//   latency_probe            repeats `own` as `repeated`: what the way through any node takes
//
// Odometry comes at 50 Hz and fixes at 5 Hz. A fix goes out with the stamp of the odometry that follows at once.

#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/NavSatFix.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace {

using Clock = std::chrono::steady_clock;

constexpr double kSpeed_mps = 2.0;
constexpr int kRate_hz = 50;
constexpr int kPerFix = 10;
constexpr int kWarmUp_s = 15;  // until the localizer has started
constexpr double kMetresPerDegree = 111320.0;
constexpr std::uint32_t kQueue = 100;

const ros::TransportHints kNoDelay = ros::TransportHints().tcpNoDelay();

nav_msgs::Odometry odometry_at(const ros::Time& stamp, double x) {
  nav_msgs::Odometry message;
  message.header.stamp = stamp;
  message.header.frame_id = "odom";
  message.child_frame_id = "base_link";
  message.pose.pose.position.x = x;
  message.pose.pose.orientation.w = 1.0;
  message.twist.twist.linear.x = kSpeed_mps;
  return message;
}

sensor_msgs::NavSatFix fix_at(const ros::Time& stamp, double x) {
  sensor_msgs::NavSatFix message;
  message.header.stamp = stamp;
  message.header.frame_id = "gps";
  message.longitude = x / kMetresPerDegree;
  message.position_covariance = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 4.0};
  message.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_KNOWN;
  return message;
}

/// When messages were sent, and how long each took (ms), by what they are.
class Times {
 public:
  void send(const ros::Publisher& publisher, const nav_msgs::Odometry& message, const std::string& kind) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      sent_[message.header.stamp] = {kind, Clock::now()};
    }
    publisher.publish(message);
  }
  void receive(const nav_msgs::Odometry& message) {
    const Clock::time_point now = Clock::now();
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = sent_.find(message.header.stamp);
    if (found == sent_.end()) return;
    const auto& [kind, began] = found->second;
    taken_[kind].push_back(std::chrono::duration<double, std::milli>(now - began).count());
    sent_.erase(found);
  }
  void forget() {
    const std::lock_guard<std::mutex> lock(mutex_);
    taken_.clear();
  }
  void print() {
    std::printf("%-28s %8s %8s %8s %8s\n", "ms", "median", "99 %", "largest", "count");
    for (auto& [kind, values] : taken_) {
      std::sort(values.begin(), values.end());
      const auto at = [&values = values](double share) {
        return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
      };
      std::printf("%-28s %8.3f %8.3f %8.3f %8zu\n", kind.c_str(), at(0.5), at(0.99), values.back(), values.size());
    }
  }

 private:
  std::mutex mutex_;
  std::map<ros::Time, std::pair<std::string, Clock::time_point>> sent_;
  std::map<std::string, std::vector<double>> taken_;
};

void repeat(ros::NodeHandle& node) {
  const ros::Publisher repeated = node.advertise<nav_msgs::Odometry>("repeated", kQueue);
  const ros::Subscriber own = node.subscribe<nav_msgs::Odometry>(
      "own", kQueue, [&repeated](const nav_msgs::OdometryConstPtr& message) { repeated.publish(*message); }, nullptr,
      kNoDelay);
  ros::spin();
}

void drive(ros::NodeHandle& node, int seconds) {
  const ros::Publisher odometry = node.advertise<nav_msgs::Odometry>("odom", kQueue);
  const ros::Publisher fixes = node.advertise<sensor_msgs::NavSatFix>("gps/fix", kQueue);
  const ros::Publisher own = node.advertise<nav_msgs::Odometry>("own", kQueue);
  Times times;
  std::vector<ros::Subscriber> subscribers;
  for (const char* topic : {"odometry/filtered", "repeated"}) {
    subscribers.push_back(node.subscribe<nav_msgs::Odometry>(
        topic, kQueue, [&times](const nav_msgs::OdometryConstPtr& message) { times.receive(*message); }, nullptr,
        kNoDelay));
  }
  ros::AsyncSpinner spinner(1);
  spinner.start();
  const auto is_complete = [&] {
    return odometry.getNumSubscribers() > 0 && fixes.getNumSubscribers() > 0 && own.getNumSubscribers() > 0 &&
           subscribers[0].getNumPublishers() > 0 && subscribers[1].getNumPublishers() > 0;
  };
  while (ros::ok() && !is_complete()) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  const Clock::time_point began = Clock::now();
  constexpr std::chrono::microseconds kStep(1000000 / kRate_hz);
  for (int step = 0; ros::ok() && step < (kWarmUp_s + seconds) * kRate_hz; ++step) {
    std::this_thread::sleep_until(began + step * kStep);
    if (step == kWarmUp_s * kRate_hz) times.forget();
    const ros::Time stamp = ros::Time::now();
    const double x = kSpeed_mps * step / kRate_hz;
    const bool has_fix = step % kPerFix == 0;
    if (has_fix) fixes.publish(fix_at(stamp, x));
    times.send(odometry, odometry_at(stamp, x), has_fix ? "localizer: fix and odometry" : "localizer: odometry alone");
    std::this_thread::sleep_until(began + step * kStep + kStep / 2);
    times.send(own, odometry_at(ros::Time::now(), x), "repeater: odometry");
  }
  std::this_thread::sleep_for(std::chrono::seconds(1));
  spinner.stop();
  times.print();
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, argc > 1 ? "latency_probe" : "latency_repeater");
  ros::NodeHandle node;
  if (argc > 1) {
    drive(node, std::stoi(argv[1]));
  } else {
    repeat(node);
  }
  return 0;
}
