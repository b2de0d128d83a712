#include "urban_gnss_localization/ros/sensor_frames.hpp"

#include <sstream>

#include "urban_gnss_localization/ros/topics.hpp"

namespace urban_gnss {

using Level = PipelineEvent::Level;

namespace {

constexpr int kPatience_fixes = 5;
/// Between two places of one antenna, measured by hand.
constexpr double kSamePlace_m = 0.05;

std::string describe(const Eigen::Vector2d& place) {
  std::ostringstream text;
  text << "x " << place.x() << " m, y " << place.y() << " m";
  return text.str();
}

}  // namespace

void SensorFrames::observe_odometry(const std::string& frame, const std::string& child_frame) {
  if (has_odometry_) return;
  has_odometry_ = true;
  const auto compare = [this](const char* field, const std::string& told, const char* parameter,
                              const std::string& expected, const std::string& effect) {
    if (told.empty() || told == expected) return;
    say(Level::kWarn,
        std::string("odometry: ") + field + " is '" + told + "', " + parameter + " is '" + expected + "': " + effect);
  };
  const std::string& odom = frames_.odom;
  compare("header.frame_id", without_leading_slash(frame), "odom_frame", odom,
          "map -> " + odom + " is broadcast, and is of no use where " + odom + " is not in tf");
  compare("child_frame_id", without_leading_slash(child_frame), "base_link_frame", frames_.base_link,
          "the estimate is that of " + without_leading_slash(child_frame));
}

void SensorFrames::observe(Sensor& sensor, const std::string& frame) {
  // A message without a frame is no news of one that is known.
  if (sensor.was_heard && (frame.empty() || sensor.frame == frame)) return;
  sensor = {frame, true, !frame.empty() && frame != frames_.base_link, false};
}

void SensorFrames::observe_fix(const std::string& frame) {
  if (!asks_for_antenna_) return;
  observe(antenna_, without_leading_slash(frame));
  // A receiver_node does not know the frame of its first fixes, where the driver tells it in another message.
  if (!is_told() && antenna_.frame.empty() && ++fixes_without_frame_ == kPatience_fixes) {
    say(Level::kWarn,
        "fixes have no frame_id: the antenna is taken to be at the base; set antenna_offset if it is elsewhere");
  }
}

void SensorFrames::observe_imu(const std::string& frame) { observe(imu_, without_leading_slash(frame)); }

void SensorFrames::found_antenna(const Eigen::Vector2d& antenna, LocalizationPipeline& pipeline) {
  if (!is_told()) {
    pipeline.set_antenna_offset(antenna);
    say(Level::kInfo, "antenna at " + describe(antenna) + " in " + frames_.base_link);
  } else if ((antenna - told_antenna_).norm() > kSamePlace_m) {
    say(Level::kWarn, "antenna_offset is " + describe(told_antenna_) + ", but by tf " + antenna_.frame + " is at " +
                          describe(antenna) + " in " + frames_.base_link + ": antenna_offset is taken");
  }
}

void SensorFrames::look_up(const tf2::BufferCore& tf, LocalizationPipeline& pipeline) {
  const auto found = [&](Sensor& sensor) {
    if (!sensor.is_missing || !tf.canTransform(frames_.base_link, sensor.frame, ros::Time(0))) return false;
    sensor.is_missing = false;
    return true;
  };
  if (found(antenna_)) {
    const auto offset = tf.lookupTransform(frames_.base_link, antenna_.frame, ros::Time(0)).transform.translation;
    found_antenna({offset.x, offset.y}, pipeline);
  }
  if (found(imu_)) {
    const auto q = tf.lookupTransform(frames_.base_link, imu_.frame, ros::Time(0)).transform.rotation;
    pipeline.set_imu_mounting(Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized());
  }
}

void SensorFrames::complain() {
  if (!is_told() && antenna_.is_missing && !antenna_.was_complained_of) {
    antenna_.was_complained_of = true;
    say(Level::kWarn, "no tf from " + frames_.base_link + " to the fix's frame " + antenna_.frame +
                          ": the antenna is taken to be at the base until there is one");
  }
  if (imu_.is_missing && !imu_.was_complained_of) {
    imu_.was_complained_of = true;
    say(Level::kInfo,
        "no tf from " + frames_.base_link + " to the IMU's frame " + imu_.frame +
            ": where it tells no orientation, its z axis is taken to be up until turning tells otherwise");
  }
}

}  // namespace urban_gnss
