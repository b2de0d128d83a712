#pragma once

#include <ros/time.h>

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "urban_gnss_localization/pipeline/pipeline_event.hpp"

namespace urban_gnss {

/// The text as a line of a log: cut after 200 characters, with a ? for each control character.
std::string log_line(const std::string& text);

/// Writes to the console, by the wall clock, so that it also does where the simulated time stands. Warnings and errors
/// that differ by their numbers at most are written once in 4.5 seconds, with how many were held back; and no more than
/// 20 of all kinds are.
class EventLog {
 public:
  void log(const std::vector<PipelineEvent>& events);
  void info(const std::string& text) { log({{PipelineEvent::Level::kInfo, text}}); }
  void warn(const std::string& text) { log({{PipelineEvent::Level::kWarn, text}}); }
  void error(const std::string& text) { log({{PipelineEvent::Level::kError, text}}); }

 private:
  struct Said {
    ros::WallTime when;
    std::size_t held_back{0};
  };
  void write(const PipelineEvent& event);
  /// Whether the line is to be written now; appends how many were not.
  bool is_due(std::string& line);

  std::map<std::string, Said> said_;  ///< by what remains without the numbers
  ros::WallTime window_began_;
  std::size_t written_in_window_{0};
  std::size_t held_back_in_window_{0};
};

}  // namespace urban_gnss
