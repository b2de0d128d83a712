#include "urban_gnss_localization/ros/input_watch.hpp"

#include <ros/console.h>

namespace urban_gnss {

void InputWatch::observe_frame(const std::string& frame) {
  if (has_frame_ && frame != frame_) {
    ROS_WARN_STREAM(topic() << ": frame_id changed from '" << frame_ << "' to '" << frame
                            << "'; are two sources publishing?");
  }
  frame_ = frame;
  has_frame_ = true;
}

void InputWatch::check_publishers() {
  const std::uint32_t count = publishers();
  if (count > 1 && !warned_of_publishers_) {
    ROS_WARN_STREAM(topic() << ": " << count << " publishers; fixes and odometry of two sources do not mix");
  }
  warned_of_publishers_ = count > 1;
}

}  // namespace urban_gnss
