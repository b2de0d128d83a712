#include "urban_gnss_localization/ros/transform_input.hpp"

#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace urban_gnss {
namespace {

constexpr double kJump_s = 1.0;
constexpr std::size_t kLongestName = 255;
constexpr std::size_t kMostFrames = 1000;

}  // namespace

TransformInput::TransformInput(ros::NodeHandle& node, NodeShell& shell) : shell_(shell) {
  const auto listen = [&](const char* topic, std::uint32_t queue, bool is_static) {
    return shell_.subscribe_any<tf2_msgs::TFMessage>(
        node, topic, queue, [this, is_static](const tf2_msgs::TFMessageConstPtr& message) { add(*message, is_static); },
        ros::TransportHints().tcpNoDelay());
  };
  tf_subscriber_ = listen("/tf", 1000, false);
  static_subscriber_ = listen("/tf_static", 100, true);
}

void TransformInput::clear() {
  buffer_.clear();
  frames_.clear();
}

void TransformInput::add(const tf2_msgs::TFMessage& message, bool is_static) {
  for (geometry_msgs::TransformStamped transform : message.transforms) {
    transform.header.frame_id = without_leading_slash(transform.header.frame_id);
    transform.child_frame_id = without_leading_slash(transform.child_frame_id);
    const std::string fault =
        transform.header.frame_id.size() > kLongestName || transform.child_frame_id.size() > kLongestName
            ? "a frame's name has more than 255 characters"
            : message_fault(transform);
    const char* topic = is_static ? "/tf_static" : "/tf";
    if (!fault.empty()) {
      shell_.refuse(topic, transform.child_frame_id.substr(0, 50) + ": " + fault);
    } else if (is_static || admits(transform)) {
      buffer_.setTransform(transform, "tf", is_static);
    }
  }
}

bool TransformInput::admits(const geometry_msgs::TransformStamped& transform) {
  const std::string& child = transform.child_frame_id;
  if (frames_.size() >= kMostFrames && frames_.count(child) == 0) {
    shell_.refuse("/tf", "there are 1000 frames already");
    return false;
  }
  if (!shell_.stamp_fault("/tf of " + child, transform.header.stamp).empty()) return false;
  StampMonitor& stamps = frames_.emplace(child, StampMonitor(kJump_s)).first->second;
  const Stamp stamp = to_stamp(transform.header.stamp);
  const auto last = stamps.last();
  switch (stamps.judge(stamp)) {
    case StampVerdict::kNew: return true;
    case StampVerdict::kNotNewer: return last != stamp;
    case StampVerdict::kOdd: shell_.refuse("/tf of " + child, describe_oddness(stamp, *last)); return false;
    case StampVerdict::kWentAhead: return true;
    case StampVerdict::kWentBack: break;
  }
  shell_.refuse("/tf", "the buffer holds the future of " + child + ": it is cleared");
  clear();
  return true;
}

}  // namespace urban_gnss
