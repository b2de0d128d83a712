#include "urban_gnss_localization/ros/node_shell.hpp"

#include <exception>
#include <iomanip>
#include <sstream>

namespace urban_gnss {
namespace {

/// Of the year 2096: what ROS adds to a stamp must not be beyond what it can hold.
constexpr std::uint32_t kLastSecond = 4000000000U;
constexpr std::uint32_t kNanoseconds = 1000000000U;
const ros::Duration kAhead(3600.0);
const ros::Duration kGoesOn(60.0);
constexpr int kConfirm = 5;
constexpr std::size_t kMostTopics = 1000;  ///< and frames of tf
const ros::WallDuration kErrorLasts(60.0);

}  // namespace

std::string StampCheck::fault(const std::string& topic, const ros::Time& stamp, const ros::Time& now) {
  if (stamp.sec > kLastSecond || stamp.nsec >= kNanoseconds) {
    return "header.stamp " + std::to_string(stamp.sec) + " s " + std::to_string(stamp.nsec) + " ns is no time";
  }
  if (now.isZero() || stamp.toSec() <= now.toSec() + kAhead.toSec()) {  // a simulated clock that nobody drives is 0
    ahead_.erase(topic);
    return {};
  }
  if (ahead_.size() > kMostTopics) ahead_.clear();
  Run& run = ahead_[topic];
  const bool goes_on = run.length > 0 && stamp >= run.last && stamp - run.last < kGoesOn;
  run = {stamp, goes_on ? run.length + 1 : 1};
  if (run.length >= kConfirm) return {};
  std::ostringstream text;
  text << "header.stamp " << stamp.sec << " s is " << std::fixed << std::setprecision(1)
       << (stamp.toSec() - now.toSec()) / kAhead.toSec() << " h ahead of this computer's clock";
  return text.str();
}

std::string NodeShell::stamp_fault(const std::string& topic, const ros::Time& stamp) {
  const std::string fault = stamps_.fault(topic, stamp, ros::Time::now());
  if (!fault.empty()) refuse(topic, fault);
  return fault;
}

void NodeShell::refuse(const std::string& topic, const std::string& fault) {
  ++refused_;
  last_refusal_ = log_line(topic + " left out: " + fault);
  log_.warn(last_refusal_);
}

bool NodeShell::run(const std::string& what, const std::function<void()>& work) {
  std::string fault;
  try {
    work();
    return true;
  } catch (const std::exception& error) {
    fault = error.what();
  } catch (...) {
    fault = "an exception of unknown type";
  }
  ++thrown_;
  note_error(what + " failed: " + fault);
  return false;
}

void NodeShell::hold_back(const std::string& topic, const std::string& fault) {
  ++held_back_;
  note_error(topic + " not published: " + fault);
}

void NodeShell::report(const std::vector<PipelineEvent>& events) {
  for (const PipelineEvent& event : events) {
    if (event.level == PipelineEvent::Level::kError) {
      note_error(event.text);
    } else {
      log_.log({event});
    }
  }
}

void NodeShell::note_error(const std::string& what) {
  last_error_ = log_line(what);
  last_error_time_ = ros::WallTime::now();
  log_.error(last_error_);
}

void NodeShell::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) const {
  const bool is_recent = !last_error_.empty() && ros::WallTime::now() - last_error_time_ < kErrorLasts;
  if (is_recent) status.mergeSummary(diagnostic_msgs::DiagnosticStatus::ERROR, last_error_);
  status.add("messages refused", refused_);
  status.add("last refusal", last_refusal_.empty() ? "none" : last_refusal_);
  status.add("messages not published", held_back_);
  status.add("callbacks that failed", thrown_);
  status.add("last error", last_error_.empty() ? "none" : last_error_);
}

}  // namespace urban_gnss
