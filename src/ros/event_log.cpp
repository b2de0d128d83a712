#include "urban_gnss_localization/ros/event_log.hpp"

#include <ros/console.h>

#include <algorithm>

#include "urban_gnss_localization/common/control_characters.hpp"

namespace urban_gnss {
namespace {

constexpr std::size_t kLongest = 200;
constexpr std::size_t kMostLines = 20;
const ros::WallDuration kQuiet(4.5);

bool is_of_a_number(char character) { return (character >= '0' && character <= '9') || character == '.'; }

}  // namespace

std::string log_line(const std::string& text) {
  std::string line = text.substr(0, kLongest);
  std::replace_if(line.begin(), line.end(), is_control, '?');
  if (text.size() > kLongest) line += "... (" + std::to_string(text.size() - kLongest) + " more)";
  return line;
}

void EventLog::log(const std::vector<PipelineEvent>& events) {
  for (const PipelineEvent& event : events) write(event);
}

void EventLog::write(const PipelineEvent& event) {
  std::string line = log_line(event.text);
  switch (event.level) {
    case PipelineEvent::Level::kInfo: ROS_INFO_STREAM(line); break;
    case PipelineEvent::Level::kWarn:
      if (is_due(line)) ROS_WARN_STREAM(line);
      break;
    case PipelineEvent::Level::kError:
      if (is_due(line)) ROS_ERROR_STREAM(line);
      break;
  }
}

bool EventLog::is_due(std::string& line) {
  const ros::WallTime now = ros::WallTime::now();
  if (now - window_began_ >= kQuiet) {
    for (auto it = said_.begin(); it != said_.end();) {
      const bool is_over = now - it->second.when >= kQuiet && it->second.held_back == 0;
      it = is_over || said_.size() > kMostLines ? said_.erase(it) : std::next(it);
    }
    if (held_back_in_window_ > 0) ROS_WARN_STREAM(held_back_in_window_ << " more lines were held back");
    window_began_ = now;
    written_in_window_ = held_back_in_window_ = 0;
  }
  std::string kind = line;
  kind.erase(std::remove_if(kind.begin(), kind.end(), is_of_a_number), kind.end());
  const auto found = said_.find(kind);
  if (found != said_.end() && now - found->second.when < kQuiet) {
    ++found->second.held_back;
    return false;
  }
  if (written_in_window_ >= kMostLines) {
    ++held_back_in_window_;
    return false;
  }
  ++written_in_window_;
  Said& said = said_[kind];
  if (said.held_back > 0) line += " (and " + std::to_string(said.held_back) + " like it before)";
  said = {now, 0};
  return true;
}

}  // namespace urban_gnss
