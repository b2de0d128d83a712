#include "urban_gnss_localization/ros/input_watch.hpp"

namespace urban_gnss {
namespace {

constexpr std::size_t kLongestName = 50;  ///< that is written

}  // namespace

bool InputWatch::observe_frame(const std::string& frame) {
  if (frame.empty()) return false;
  const bool has_changed = !frame_.empty() && frame != frame_;
  if (has_changed) {
    const auto name = [](const std::string& id) { return "'" + id.substr(0, kLongestName) + "'"; };
    log_.warn(topic() + ": frame_id changed from " + name(frame_) + " to " + name(frame) +
              "; are two sources publishing?");
  }
  frame_ = frame;
  return has_changed;
}

void InputWatch::check_publishers() {
  const std::uint32_t count = publishers();
  if (count > 1 && !warned_of_publishers_) {
    log_.warn(topic() + ": " + std::to_string(count) + " publishers; fixes and odometry of two sources do not mix");
  }
  warned_of_publishers_ = count > 1;
}

}  // namespace urban_gnss
