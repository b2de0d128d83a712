#include "urban_gnss_localization/ros/event_log.hpp"

#include <ros/console.h>

namespace urban_gnss {
namespace {

const ros::WallDuration kQuiet(5.0);

}  // namespace

void EventLog::log(const std::vector<PipelineEvent>& events) {
  for (const PipelineEvent& event : events) {
    switch (event.level) {
      case PipelineEvent::Level::kInfo: ROS_INFO_STREAM(event.text); break;
      case PipelineEvent::Level::kWarn:
        if (!was_said_lately(event.text)) ROS_WARN_STREAM(event.text);
        break;
      case PipelineEvent::Level::kError: ROS_ERROR_STREAM(event.text); break;
    }
  }
}

bool EventLog::was_said_lately(const std::string& warning) {
  const ros::WallTime now = ros::WallTime::now();
  for (auto it = said_.begin(); it != said_.end();) it = now - it->second < kQuiet ? std::next(it) : said_.erase(it);
  return !said_.emplace(warning, now).second;
}

}  // namespace urban_gnss
