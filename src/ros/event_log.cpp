#include "urban_gnss_localization/ros/event_log.hpp"

#include <ros/ros.h>

namespace urban_gnss {

void log_events(const std::vector<PipelineEvent>& events) {
  for (const PipelineEvent& event : events) {
    switch (event.level) {
      case PipelineEvent::Level::kInfo: ROS_INFO_STREAM(event.text); break;
      case PipelineEvent::Level::kWarn: ROS_WARN_STREAM_THROTTLE(5.0, event.text); break;
      case PipelineEvent::Level::kError: ROS_ERROR_STREAM(event.text); break;
    }
  }
}

}  // namespace urban_gnss
