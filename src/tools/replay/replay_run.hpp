#pragma once

#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "occlusion_stage.hpp"
#include "replay_settings.hpp"
#include "urban_gnss_localization/evaluation/trajectory.hpp"
#include "urban_gnss_localization/pipeline/bias_responder.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"
#include "urban_gnss_localization/receivers/receiver_output.hpp"
#include "urban_gnss_localization/ros/sensor_frames.hpp"

namespace urban_gnss {

/// The pipeline and the bias filter of one run, with what it writes.
class ReplayRun {
 public:
  /// Opens the output bag, where one is asked for. Throws std::runtime_error where it cannot. `odometry_is_tf`: see
  /// OcclusionStage.
  ReplayRun(const ReplayOptions& options, const ReplaySettings& settings, bool odometry_is_tf);

  void add_odometry(const OdometrySample& sample);
  void add_odometry(const nav_msgs::Odometry& message);
  void add_imu(const sensor_msgs::Imu& message);
  void add_fix(const RawFix& fix);
  void add_fix(const sensor_msgs::NavSatFix& message);
  void add_static_tf(const tf2_msgs::TFMessage& message);
  /// What moves; of use only with occlusion.
  void add_tf(const tf2_msgs::TFMessage& message);
  void add_cloud(const sensor_msgs::PointCloud2ConstPtr& message);
  void add_velocity(const RawVelocity& velocity);
  void add_satellites(const SatelliteEpoch& epoch);
  void set_datum(const sensor_msgs::NavSatFix& message);
  void add_truth(const nav_msgs::Odometry& message);
  /// What a receiver's decoder found, in the place of the topics of fix, velocity and satellites.
  void add_receiver(const ReceiverOutput& output, const std::string& antenna_frame);

  /// Nothing comes any more: settles what waits, and closes the output bag.
  void finish();

  const Trajectory& estimate() const { return estimate_; }
  /// s from the first odometry until the first estimate, and until the heading was known to 10 degrees; NaN: never.
  double time_to_start_s() const;
  double time_to_heading_s() const;
  const std::map<std::string, std::size_t>& decisions() const { return decisions_; }
  const LocalizationPipeline& pipeline() const { return pipeline_; }
  /// Nothing without --occlusion.
  const std::optional<OcclusionStage>& occlusion() const { return occlusion_; }
  /// The truth in the frame of this run's datum.
  std::optional<Trajectory> truth() const;

 private:
  /// Answers the pipeline's questions for the bias, as gps_bias_node does live, and writes what came of it.
  void settle();
  /// Gives the localizer what the occlusion stage has settled.
  void take_weighed();
  void give(const sensor_msgs::NavSatFix& message);
  void look_up_sensors();
  void print(const std::vector<PipelineEvent>& events) const;
  void write_biases(const std::vector<BiasEstimate>& biases);
  template <class M>
  void write(const std::string& topic, Stamp stamp, const M& message);

  LocalizerNodeParameters shell_;
  LocalizationPipeline pipeline_;
  tf2::BufferCore tf_;
  SensorFrames sensor_frames_;
  BiasResponder bias_responder_;
  std::optional<OcclusionStage> occlusion_;
  std::set<std::string> said_;  ///< by the occlusion stage, which repeats what lasts
  rosbag::Bag bag_;
  Stamp newest_{0};
  std::optional<Stamp> begin_;  ///< of the first odometry
  std::optional<GeodeticPosition> bag_datum_;
  Trajectory estimate_;
  Trajectory truth_;
  std::map<std::string, std::size_t> decisions_;
};

}  // namespace urban_gnss
