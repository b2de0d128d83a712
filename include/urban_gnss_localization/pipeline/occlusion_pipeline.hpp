#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/geometry/pose2.hpp"
#include "urban_gnss_localization/gnss/gnss_covariance.hpp"
#include "urban_gnss_localization/motion/imu_sample.hpp"
#include "urban_gnss_localization/occlusion/kd_tree_ray_tracer.hpp"
#include "urban_gnss_localization/occlusion/local_map.hpp"
#include "urban_gnss_localization/occlusion/visibility.hpp"
#include "urban_gnss_localization/occlusion/voxel_ray_tracer.hpp"
#include "urban_gnss_localization/pipeline/epoch_matcher.hpp"
#include "urban_gnss_localization/pipeline/heading_source.hpp"
#include "urban_gnss_localization/pipeline/map_consistency.hpp"

namespace urban_gnss {

/// How closely section IV of Maier and Kleiner is followed.
enum class OcclusionMode {
  kStandard,   ///< as the parameters say
  kAsPrinted,  ///< as_printed()
};
EnumNames<OcclusionMode> enum_names(OcclusionMode);

enum class TracerChoice {
  kVoxel,   ///< ours, the default
  kKdTree,  ///< Algorithm 2; rebuilt from the map where that has changed, slow
};
EnumNames<TracerChoice> enum_names(TracerChoice);

struct OcclusionParameters {
  OcclusionMode mode{OcclusionMode::kStandard};
  TracerChoice tracer{TracerChoice::kVoxel};
  std::vector<double> antenna_offset{0.0, 0.0, 0.0};
  double antenna_sigma{0.3};
  double heading_sigma{0.05};
  double heading_timeout{5.0};
  double satellites_max_age{2.0};
  double map_timeout{60.0};
  int sky_azimuths{72};
  double sky_mask{0.17};

  void visit(ParameterVisitor& v) {
    v.basic()("mode", mode,
              "standard: as tracer and model say; as_printed: as Maier and Kleiner print it: tracer kdtree, one ray, "
              "model paper");
    v.basic()("tracer", tracer, "ray tracer; voxel: ours; kdtree: Algorithm 2 as printed, slow");
    v.basic()("antenna_offset", antenna_offset, "m",
              "x, y and z of the antenna in base_link_frame; zeros: from tf, by the fix's frame_id");
    v("antenna_sigma", antenna_sigma, non_negative(), "m per horizontal axis",
      "standard deviation of the antenna's position in the map");
    v("heading_sigma", heading_sigma, non_negative(), "rad", "least standard deviation assumed for the heading");
    v("heading_timeout", heading_timeout, positive(), "s", "age beyond which a heading is not used");
    v("satellites_max_age", satellites_max_age, positive(), "s", "age beyond which satellites are not used for a fix");
    v("map_timeout", map_timeout, positive(), "s", "time without a cloud after which the map is no longer trusted");
    v("sky_azimuths", sky_azimuths, between(8, 720), "",
      "number of azimuths of the skyline, for fixes without satellites and for the sky plot");
    v("sky_mask", sky_mask, between(0.0, 1.5), "rad",
      "elevation above which the sky counts for fixes without satellites");
  }
  void check(std::vector<std::string>& faults) const;
};

/// All that the occlusion node can be told.
struct OcclusionPipelineParameters {
  OcclusionParameters occlusion;
  VisibilityParameters visibility;
  LocalMapParameters local_map;
  VoxelMapParameters voxels;
  ScanAlignerParameters aligner;
  VoxelRayTracerParameters voxel_tracer;
  KdTreeRayTracerParameters kdtree_tracer;
  GnssCovarianceParameters covariance;
  MapConsistencyParameters consistency;
  ImuHeadingParameters imu_orientation;

  void visit(ParameterVisitor& v) {
    v.include(occlusion);
    v.group("visibility", visibility, "Rays traced to a satellite.");
    v.group("local_map", local_map, "Map of the surroundings, built from the lidar's clouds.");
    v.group("voxels", voxels, "Voxels of the map.");
    v.group("aligner", aligner, "Alignment of a cloud with the map (ICP).");
    v.group("voxel_tracer", voxel_tracer, "Obstruction of a ray through the voxels (tracer voxel).");
    v.group("kdtree_tracer", kdtree_tracer, "Algorithm 2 of Maier and Kleiner (tracer kdtree).");
    v.group("covariance", covariance, "Covariance of a fix, from the visible satellites.");
    v.group("consistency", consistency, "Agreement of map and satellites.");
    v.group("imu_orientation", imu_orientation, "Heading of the IMU, where its messages have an orientation.");
  }
};

/// What section IV leaves of the parameters: Algorithm 2 with one ray to each satellite, eq. (6) and Algorithm 3,
/// whether the receiver claims more or less. What the paper chose a number for (sigma_ure, the filter) or leaves open
/// (kdtree_tracer, the map) stays a parameter, whose default is the paper's number.
OcclusionPipelineParameters as_printed(OcclusionPipelineParameters parameters);

/// How the odometry frame lies in the world, from a localizer or a compass.
struct WorldAlignment {
  Stamp stamp{0};
  Pose2 odom_in_world;        ///< map -> odom; of it the yaw is used, and the place where there is a prior map
  double yaw_sigma_rad{0.0};  ///< not finite or negative: the heading is not known
};

/// Why a cloud did not go into the map.
enum class CloudDecision { kInserted, kNotNewer, kEmpty, kNotFinite, kNotPlaced };
const char* to_string(CloudDecision decision);

struct CloudOutcome {
  CloudDecision decision{CloudDecision::kInserted};
  ScanReport scan;
};

/// One fix with what the surroundings say of it.
struct FixAssessment {
  Stamp stamp{0};
  GnssCovariance covariance;
  std::vector<SatelliteObservation> satellites;
  std::vector<SatelliteVisibility> visibilities;  ///< one for each satellite; of no meaning without map and heading
  AntennaPose antenna;                            ///< in the map of the surroundings
  bool has_map{false};                            ///< map, heading and odometry were there for this fix
  std::string missing;                            ///< what was not, for the user; empty where all was
  double strong_share{std::numeric_limits<double>::quiet_NaN()};  ///< MapConsistency::strong_share()
  std::string doubt;  ///< what does not fit together, for the user; empty where all does
};

/// Clouds, satellites and fixes in, honest covariances out (Maier & Kleiner 2010): the map is built in the odometry
/// frame, whose heading error turns the sky; stamps are those of the messages.
class OcclusionPipeline {
 public:
  /// Requires parameters without faults.
  explicit OcclusionPipeline(const OcclusionPipelineParameters& parameters);
  OcclusionPipeline(const OcclusionPipeline&) = delete;  // its tracer refers to its map
  OcclusionPipeline& operator=(const OcclusionPipeline&) = delete;

  /// A cloud in the sensor's frame (m), with the robot's pose in the odometry frame at the cloud's own stamp. One that
  /// is older than the last by more than map_timeout is taken: the last one's stamp was wrong. A cloud that holds only
  /// ground says that there are no obstacles.
  CloudOutcome add_cloud(Stamp stamp, const PointCloud& cloud, const Eigen::Isometry3d& sensor_in_base,
                         const Eigen::Isometry3d& base_in_odom);
  /// A map that was there before, in the world's axes; turned into the odometry frame by `odom_in_world`.
  InsertReport add_prior(const PointCloud& points, const Pose2& odom_in_world);
  /// The antenna's place in base_link, m, over antenna_offset.
  void set_antenna(const Eigen::Vector3d& place);
  /// Ignored where its pose is not finite.
  void set_alignment(const WorldAlignment& alignment);
  /// The IMU in its own frame. Its heading turns the guess of a scan's pose, and the sky where it is surer than that of
  /// the alignment (Maier & Kleiner, sections III-A and V).
  void add_imu(const ImuSample& sample);
  /// How the IMU is mounted: its frame in the base frame, as tf says it. Requires a unit quaternion.
  void set_imu_mounting(const Eigen::Quaterniond& base_from_imu) { imu_.set_mounting(base_from_imu); }
  /// The same of an IMU that tells nothing but the robot's heading.
  void add_imu_heading(const HeadingSample& heading) { heading_.add(heading); }
  /// Angles that are not finite are left out. `angle_resolution_rad`: step that the receiver rounds to; 0 if unknown.
  /// The latest ones are kept: a fix is weighed by those that are nearest to it in time.
  void set_satellites(Stamp stamp, std::vector<SatelliteObservation> satellites, double angle_resolution_rad);
  /// Whether the satellites of a fix with this stamp are still to come, by what came to the fix before it.
  bool awaits_satellites(Stamp fix_stamp) const { return epochs_.awaits(fix_stamp); }

  /// A fix with the covariance that its receiver claims (m^2, east and north), and the robot's pose in the odometry
  /// frame at its stamp, where that is known.
  FixAssessment assess(Stamp stamp, const std::optional<Eigen::Matrix2d>& claimed,
                       const std::optional<Eigen::Isometry3d>& base_in_odom);

  /// Starts anew: map, satellites, heading, memory of fixes. For a clock that was set back.
  void reset();
  void clear_map();

  /// What the IMU's heading says anew since the last call.
  std::vector<PipelineEvent> take_events() { return std::exchange(events_, {}); }

  const LocalMap& local_map() const { return local_map_; }
  /// As the mode leaves them.
  const OcclusionPipelineParameters& parameters() const { return parameters_; }
  const RayTracer& tracer() const;
  /// Blocked elevations around the antenna (skyline()), for each of sky_azimuths steps.
  std::vector<double> skyline_at(const AntennaPose& antenna) const;

 private:
  std::optional<AntennaPose> antenna_at(Stamp stamp, const std::optional<Eigen::Isometry3d>& base_in_odom,
                                        std::string& missing) const;
  /// How the odometry frame lies in the world at `stamp`, by the alignment or the IMU, whichever is surer; nothing
  /// where neither is known.
  std::optional<WorldAlignment> alignment_at(Stamp stamp, const std::optional<Eigen::Isometry3d>& base_in_odom) const;
  /// Compares the IMU's heading with that of the alignment.
  void compare_heading(Stamp stamp, const Eigen::Isometry3d& base_in_odom);
  SkyObservation observe_sky(const AntennaPose& antenna) const;
  /// The satellites that a fix is weighed by; null where there are none, or they are too old.
  const SatelliteEpoch* satellites_for(Stamp fix) const;

  OcclusionPipelineParameters parameters_;
  LocalMap local_map_;
  VoxelRayTracer voxel_tracer_;
  VisibilitySampling sampling_;
  mutable std::unique_ptr<KdTreeRayTracer> kd_tracer_;  ///< of the map as it is; made when asked for
  GnssCovarianceModel covariance_;
  MapConsistency consistency_;
  Eigen::Vector3d antenna_in_base_;
  std::optional<Stamp> last_cloud_;
  std::optional<WorldAlignment> alignment_;
  ImuLeveller imu_;
  HeadingSource heading_;
  bool has_prior_{false};
  EpochMatcher epochs_;
  std::vector<PipelineEvent> events_;
};

}  // namespace urban_gnss
