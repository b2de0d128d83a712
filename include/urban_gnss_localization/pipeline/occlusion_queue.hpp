#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/gnss/satellite_epoch.hpp"
#include "urban_gnss_localization/pipeline/frame_source.hpp"
#include "urban_gnss_localization/pipeline/occlusion_pipeline.hpp"
#include "urban_gnss_localization/pipeline/pipeline_event.hpp"
#include "urban_gnss_localization/pipeline/stamp_monitor.hpp"

namespace urban_gnss {

struct OcclusionQueueParameters {
  double tf_timeout{0.5};
  int cloud_queue{5};
  double time_jump{1.0};

  void visit(ParameterVisitor& v) {
    v("tf_timeout", tf_timeout, non_negative(), "s",
      "time, by the fixes' stamps, that a cloud or a fix waits for its transform");
    v("cloud_queue", cloud_queue, between(1, 1000), "",
      "greatest number of clouds that wait; beyond it the oldest is dropped");
    v("time_jump", time_jump, positive(), "s",
      "difference by which a stamp must be older than the last for its clock to count as set back");
  }
};

/// Names of the frames that the queue looks up.
struct OcclusionFrames {
  std::string map{"map"};
  std::string odom{"odom"};
  std::string base_link{"base_link"};
};

struct QueuedCloud {
  Stamp stamp{0};
  std::string frame;                 ///< of the lidar
  std::function<PointCloud()> read;  ///< asked for the points in its turn; throws std::invalid_argument
};

struct QueuedFix {
  Stamp stamp{0};
  std::string frame;                       ///< of the antenna
  bool has_position{true};                 ///< false: there is nothing to weigh
  std::optional<Eigen::Matrix2d> claimed;  ///< m^2, east and north; nothing where the receiver claims none
  /// Told once what came of the fix; null where it has no position. It must not call the queue.
  std::function<void(const FixAssessment*)> settle;
};

/// What the queue has done, since it was made.
struct OcclusionTally {
  std::size_t clouds{0};
  std::size_t clouds_in_map{0};
  std::map<std::string, std::size_t> clouds_left_out;  ///< by the reason
  std::size_t alignments_tried{0};
  std::size_t alignments_accepted{0};
  std::string last_alignment{"none"};
  std::size_t fixes_weighed{0};
  std::map<std::string, std::size_t> fixes_without;  ///< of those, by what was missing
  std::size_t fixes_without_position{0};
  std::size_t fixes_left_out{0};  ///< not newer than the one before, or with a stamp far from it

  std::size_t all_clouds_left_out() const;
};

/// What stands between the sensors and the occlusion pipeline, live and offline: clouds and fixes wait here for their
/// transforms, fixes for their satellites. Acts on stamps alone, and on the order in which things come.
class OcclusionQueue {
 public:
  /// Requires parameters without faults. `transforms` must outlive the queue.
  OcclusionQueue(const OcclusionPipelineParameters& pipeline, const OcclusionQueueParameters& parameters,
                 OcclusionFrames frames, FrameSource& transforms);

  /// A map that was there before, m east, north and up of the map frame's origin; goes in with the first heading.
  void set_prior_map(PointCloud points) { prior_ = std::move(points); }

  /// Only keeps the cloud for work(): of those that wait the oldest is dropped where they are too many.
  void add_cloud(QueuedCloud cloud);
  void add_satellites(const SatelliteEpoch& epoch);
  /// `frame` of the IMU: its place in base_link tells how it is mounted. Until that is known, its axes are the base's.
  void add_imu(const ImuSample& sample, const std::string& frame);
  /// Keeps the fix for work(). One that is not newer than the one before it is left out, and is not settled; one whose
  /// stamp is odd is held back until others go on from there (StampMonitor).
  void add_fix(QueuedFix fix);
  /// How well the localizer knows the heading, rad^2; the heading itself is that of map -> odom.
  void set_yaw_variance(double variance);

  /// Puts one cloud into the map, where one can be, and settles the fixes that need not wait. Whether a cloud was
  /// settled: there may be more.
  bool work();
  /// Whether a cloud or a fix waits for work(), which may be for its transform.
  bool has_waiting() const { return !clouds_.empty() || !fixes_.empty(); }
  /// Only settles the fixes that need not wait, by the map as it is: a cloud takes up to a tenth of a second, and
  /// changes the map by a metre of the way.
  void settle_fixes();
  /// Nothing comes any more: settles all that waits.
  void finish();
  /// Empties the map but for the prior one.
  void clear_map();

  const OcclusionPipeline& pipeline() const { return pipeline_; }
  const OcclusionTally& tally() const { return tally_; }
  /// Of the last fix that was weighed.
  const std::string& missing() const { return missing_; }
  const std::string& doubt() const { return doubt_; }
  VisibilitySource source() const { return source_; }
  Stamp newest_fix() const { return newest_; }
  /// What people should hear of. Of each kind no more than one in ten seconds, by the stamps.
  std::vector<PipelineEvent> take_events() { return std::exchange(events_, {}); }

 private:
  void keep(QueuedFix fix);
  void start_anew();
  void forget_former_clock();
  bool is_overdue(Stamp stamp) const;
  void update_alignment();
  bool insert(const QueuedCloud& cloud);
  void leave_out(const QueuedCloud& cloud, const std::string& reason, const std::string& detail);
  void note(const QueuedCloud& cloud, const ScanReport& scan);
  void note_alignment(const QueuedCloud& cloud, const ScanReport& scan);
  bool assess(const QueuedFix& fix);
  void place_antenna(const QueuedFix& fix);
  void say(PipelineEvent::Level level, const std::string& kind, Stamp stamp, const std::string& text);

  OcclusionQueueParameters parameters_;
  OcclusionFrames frames_;
  FrameSource& transforms_;
  OcclusionPipeline pipeline_;
  bool antenna_known_;
  bool imu_mounting_known_{false};
  Stamp next_mounting_{0};  ///< from when on it is looked for again
  PointCloud prior_;
  bool prior_is_in_{false};
  StampMonitor fix_stamps_;
  StampMonitor cloud_stamps_;
  std::vector<QueuedFix> odd_fixes_;  ///< held back
  std::deque<QueuedCloud> clouds_;
  std::deque<QueuedFix> fixes_;
  Stamp newest_{0};         ///< of the fixes: one of the future is a set-back clock at the next, a cloud's would stay
  Stamp former_newest_{0};  ///< that of before the clock was set back
  bool is_finished_{false};
  double yaw_sigma_{0.0};  ///< NaN where the localizer does not know the heading
  std::string missing_;
  std::string doubt_;
  VisibilitySource source_{VisibilitySource::kNone};
  OcclusionTally tally_;
  std::map<std::string, Stamp> said_;
  std::vector<PipelineEvent> events_;
};

}  // namespace urban_gnss
