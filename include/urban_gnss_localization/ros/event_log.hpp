#pragma once

#include <ros/time.h>

#include <map>
#include <string>
#include <vector>

#include "urban_gnss_localization/pipeline/pipeline_event.hpp"

namespace urban_gnss {

/// Says on the console what happened. A warning that is repeated to the letter is said once in five seconds; another
/// one is never held back by it.
class EventLog {
 public:
  void log(const std::vector<PipelineEvent>& events);

 private:
  bool was_said_lately(const std::string& warning);

  std::map<std::string, ros::WallTime> said_;
};

}  // namespace urban_gnss
