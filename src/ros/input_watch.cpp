#include "urban_gnss_localization/ros/input_watch.hpp"

#include <utility>

namespace urban_gnss {
namespace {

constexpr std::size_t kLongestName = 50;  ///< that is written

}  // namespace

void InputWatch::say(const std::string& warning) {
  if (!warning.empty()) log_.warn(topic() + ": " + warning);
}

std::string InputWatch::fault_of_frame(const std::string& frame) {
  const auto name = [](const std::string& id) { return "'" + id.substr(0, kLongestName) + "'"; };
  if (frame.empty()) return {};
  const std::string before = std::exchange(frame_, frame);
  if (before.empty() || frame == before) return {};
  return "frame_id changed from " + name(before) + " to " + name(frame) + "; are two sources publishing?";
}

std::string InputWatch::fault_of_publishers(std::uint32_t count) {
  const bool was_said = std::exchange(warned_of_publishers_, count > 1);
  if (count <= 1 || was_said) return {};
  return std::to_string(count) + " publishers; fixes and odometry of two sources do not mix";
}

}  // namespace urban_gnss
