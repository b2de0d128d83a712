#pragma once

#include <nav_msgs/Odometry.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>
#include <urban_gnss_localization/Visibility.h>

#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"
#include "urban_gnss_localization/pipeline/occlusion_queue.hpp"
#include "urban_gnss_localization/ros/occlusion_node_parameters.hpp"
#include "urban_gnss_localization/ros/tf_frames.hpp"

namespace urban_gnss {

/// A fix as the localizer gets it.
struct WeighedMessage {
  sensor_msgs::NavSatFix fix;
  std::optional<urban_gnss_localization::Visibility> visibility;  ///< nothing where the fix has no position
};

/// What occlusion_node does live, in front of the localizer of a run: the same queue behind the same conversions.
/// Every cloud and fix is settled as soon as it can be.
class OcclusionStage {
 public:
  /// `odometry_is_tf`: the odometry's poses serve for the transform of base_link_frame in odom_frame, as nobody else
  /// tells it. Throws std::runtime_error where prior_map cannot be read.
  OcclusionStage(const OcclusionNodeSettings& settings, bool odometry_is_tf);

  void add_tf(const tf2_msgs::TFMessage& message, bool is_static);
  void add_odometry(const nav_msgs::Odometry& message);
  void add_cloud(const sensor_msgs::PointCloud2ConstPtr& message);
  void add_satellites(const SatelliteEpoch& epoch);
  void add_imu(const ImuSample& sample, const std::string& frame) { queue_.add_imu(sample, frame); }
  void add_fix(const sensor_msgs::NavSatFix& message);
  /// Where the localizer says that the robot is. `map_to_odom` as it would be broadcast.
  void add_estimate(const LocalizationOutput& output, const geometry_msgs::TransformStamped& map_to_odom);
  /// Nothing comes any more.
  void finish();

  /// The fixes that have been settled since it was asked last.
  std::vector<WeighedMessage> take() { return std::exchange(settled_, {}); }
  std::vector<PipelineEvent> take_events();
  /// What has been done: clouds, fixes and satellites by what became of them.
  nlohmann::json report() const;

 private:
  void work();
  void settle(const sensor_msgs::NavSatFix& message, const FixAssessment* assessment);

  Frames frames_;
  bool odometry_is_tf_;
  tf2::BufferCore tf_;
  TfFrames transforms_;
  OcclusionQueue queue_;
  std::vector<WeighedMessage> settled_;
  std::size_t fixes_with_map_{0};
  std::size_t fixes_widened_{0};
  std::size_t fixes_bad_{0};
  std::size_t fixes_doubted_{0};
  std::map<std::string, std::size_t> satellites_;  ///< judged, by what was said of them
};

}  // namespace urban_gnss
