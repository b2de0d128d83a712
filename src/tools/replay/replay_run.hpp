#pragma once

#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "files/input_files.hpp"
#include "files/output_bag.hpp"
#include "files/output_file.hpp"
#include "occlusion_stage.hpp"
#include "replay_settings.hpp"
#include "text_counts.hpp"
#include "urban_gnss_localization/evaluation/trajectory.hpp"
#include "urban_gnss_localization/pipeline/bias_responder.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"
#include "urban_gnss_localization/receivers/receiver_output.hpp"
#include "urban_gnss_localization/ros/sensor_frames.hpp"

namespace urban_gnss {

/// What is known of a recording before it is read.
struct RecordingFacts {
  std::size_t truths{0};       ///< messages; without a truth no pose is kept
  std::size_t odometries{0};   ///< messages
  bool odometry_is_tf{false};  ///< see OcclusionStage
};

/// The pipeline and the bias filter of one run, with what it writes.
class ReplayRun {
 public:
  /// Opens the output bag and the trajectory, where they are asked for. Throws std::runtime_error where it cannot.
  ReplayRun(const ReplayOptions& options, const ReplaySettings& settings, const InputFiles& files,
            const RecordingFacts& recording);

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

  /// Nothing comes any more: settles what waits, and puts what was written into its place.
  void finish();

  std::size_t estimates() const { return estimates_; }
  /// Where there is a truth.
  const Trajectory& estimate() const { return estimate_; }
  /// s from the first odometry until the first estimate, and until the heading was known to 10 degrees; NaN: never.
  double time_to_start_s() const { return since_begin_s(first_estimate_); }
  double time_to_heading_s() const { return since_begin_s(first_heading_); }
  const std::map<std::string, std::size_t>& decisions() const { return decisions_; }
  /// "rejected_stale: 18.0 s older than …", by their kind.
  const TextCounts& rejections() const { return rejections_; }
  const LocalizationPipeline& pipeline() const { return pipeline_; }
  /// Nothing without --occlusion.
  const std::optional<OcclusionStage>& occlusion() const { return occlusion_; }
  /// The truth in the frame of this run's datum.
  std::optional<Trajectory> take_truth();

 private:
  /// Answers the pipeline's questions for the bias, as gps_bias_node does live, and writes what came of it.
  void settle();
  /// Gives the localizer what the occlusion stage has settled.
  void take_weighed();
  void give(const sensor_msgs::NavSatFix& message);
  void take(const LocalizationOutput& output);
  double since_begin_s(const std::optional<Stamp>& stamp) const;
  void look_up_sensors();
  void print(const std::vector<PipelineEvent>& events);
  /// Of each fix, and by the time, as the live node does: what was healthy may not be without a fix.
  void write_status(const std::vector<FixOutcome>& outcomes);
  void write_biases(const std::vector<BiasEstimate>& biases);
  /// Once, and where it changes.
  void write_datum(Stamp stamp);
  template <class M>
  void write(const std::string& topic, Stamp stamp, const M& message);

  LocalizerNodeParameters shell_;
  LocalizationPipeline pipeline_;
  tf2::BufferCore tf_;
  CorrectionSlew slew_;
  SensorFrames sensor_frames_;
  BiasResponder bias_responder_;
  std::optional<OcclusionStage> occlusion_;
  std::unique_ptr<OutputBag> bag_;
  std::unique_ptr<OutputFile> tum_;
  bool has_truth_;
  Stamp newest_{0};
  Stamp last_status_{0};
  std::optional<Stamp> begin_;  ///< of the first odometry
  std::optional<Stamp> first_estimate_;
  std::optional<Stamp> first_heading_;
  std::size_t estimates_{0};
  std::optional<GeodeticPosition> bag_datum_;
  std::optional<GeodeticPosition> written_datum_;
  Trajectory estimate_;
  Trajectory truth_;
  std::map<std::string, std::size_t> decisions_;
  TextCounts rejections_;
  TextCounts events_;
};

}  // namespace urban_gnss
