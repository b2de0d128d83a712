#pragma once

#include <tf2/buffer_core.h>

#include <string>
#include <vector>

#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"

namespace urban_gnss {

/// The frames that messages name, live and in bags: tells a pipeline by tf where the antenna is and how the IMU is
/// mounted, and people, once each, of frames that are not what the parameters say. A leading slash, as tf had it, is no
/// part of a name.
class SensorFrames {
 public:
  /// `asks_for_antenna`: tf is asked where the antenna is. That is its place where `told_antenna` (m, in base_link, of
  /// the parameters) is zero; else the told one stays, and one that is elsewhere by tf is said. Requires frames without
  /// faults.
  SensorFrames(Frames frames, bool asks_for_antenna, const Eigen::Vector2d& told_antenna)
      : frames_(std::move(frames)), asks_for_antenna_(asks_for_antenna), told_antenna_(told_antenna) {}

  void observe_odometry(const std::string& frame, const std::string& child_frame);
  void observe_fix(const std::string& frame);
  void observe_imu(const std::string& frame);

  /// Looks up what is not known yet.
  void look_up(const tf2::BufferCore& tf, LocalizationPipeline& pipeline);
  /// Whether there is nothing more to look up, of the sensors that have been heard.
  bool is_complete() const { return !antenna_.is_missing && !imu_.is_missing; }
  /// Says what is still missing, once.
  void complain();

  std::vector<PipelineEvent> take_events() { return std::exchange(events_, {}); }

 private:
  struct Sensor {
    std::string frame;
    bool was_heard{false};
    bool is_missing{false};  ///< it is wanted and was not found
    bool was_complained_of{false};
  };
  void observe(Sensor& sensor, const std::string& frame);
  bool is_told() const { return told_antenna_.norm() > 0.0; }
  void found_antenna(const Eigen::Vector2d& antenna, LocalizationPipeline& pipeline);
  void say(PipelineEvent::Level level, const std::string& text) { events_.push_back({level, text}); }

  Frames frames_;
  bool asks_for_antenna_;
  Eigen::Vector2d told_antenna_;
  bool has_odometry_{false};
  Sensor antenna_;
  int fixes_without_frame_{0};
  Sensor imu_;
  std::vector<PipelineEvent> events_;
};

}  // namespace urban_gnss
