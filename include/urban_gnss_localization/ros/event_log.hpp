#pragma once

#include <ros/time.h>

#include <map>
#include <string>
#include <vector>

#include "urban_gnss_localization/pipeline/pipeline_event.hpp"

namespace urban_gnss {

/// Writes events to the console. The same warning is written at most once in five seconds; other warnings are never
/// held back.
class EventLog {
 public:
  void log(const std::vector<PipelineEvent>& events);

 private:
  bool was_said_lately(const std::string& warning);

  std::map<std::string, ros::WallTime> said_;
};

}  // namespace urban_gnss
