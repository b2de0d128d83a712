#include "urban_gnss_localization/ros/tf_frames.hpp"

#include <tf2/exceptions.h>

#include "urban_gnss_localization/ros/conversions.hpp"

namespace urban_gnss {

std::optional<Eigen::Isometry3d> TfFrames::find(const std::string& parent, const std::string& child, Stamp stamp) {
  const auto found = look_up(parent, child, to_ros(stamp));
  return found ? std::optional<Eigen::Isometry3d>(found->pose) : std::nullopt;
}

std::optional<FrameSource::Transform> TfFrames::newest(const std::string& parent, const std::string& child) {
  return look_up(parent, child, ros::Time(0));
}

std::optional<FrameSource::Transform> TfFrames::look_up(const std::string& parent, const std::string& child,
                                                        const ros::Time& time) {
  try {
    const geometry_msgs::TransformStamped found = buffer_.lookupTransform(parent, child, time);
    const auto& t = found.transform.translation;
    const auto& r = found.transform.rotation;
    Transform transform;
    transform.stamp = to_stamp(found.header.stamp);
    transform.pose.translate(Eigen::Vector3d(t.x, t.y, t.z));
    transform.pose.rotate(Eigen::Quaterniond(r.w, r.x, r.y, r.z));
    return transform;
  } catch (const tf2::TransformException& error) {
    fault_ = error.what();
    return std::nullopt;
  }
}

}  // namespace urban_gnss
