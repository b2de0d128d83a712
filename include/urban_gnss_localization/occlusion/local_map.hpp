#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/occlusion/point_cloud.hpp"
#include "urban_gnss_localization/occlusion/scan_aligner.hpp"
#include "urban_gnss_localization/occlusion/voxel_map.hpp"

namespace urban_gnss {

struct LocalMapParameters {
  double body_radius{1.0};
  double min_height{0.3};
  double max_scan_range{100.0};
  bool align{true};
  double align_radius{60.0};
  double keyframe_distance{1.0};
  double keyframe_angle{0.17};
  double unplaced_distance{5.0};

  void visit(ParameterVisitor& v) {
    v.basic()("body_radius", body_radius, non_negative(), "m",
              "horizontal distance from base_link_frame within which points are cut as the robot's own body");
    v("min_height", min_height, any_number(), "m", "height above base_link_frame below which points are cut as ground");
    v("max_scan_range", max_scan_range, positive(), "m", "distance from the sensor beyond which points are cut");
    v("align", align, "whether scans are aligned to the map, in place of the odometry alone");
    v("align_radius", align_radius, positive(), "m",
      "radius about the sensor of the part of the map that a scan is aligned to");
    v("keyframe_distance", keyframe_distance, positive(), "m", "distance travelled from one alignment to the next");
    v("keyframe_angle", keyframe_angle, positive(), "rad", "angle turned from one alignment to the next");
    v("unplaced_distance", unplaced_distance, positive(), "m",
      "distance travelled with scans that do not fit the map, after which one is inserted where the odometry puts it");
  }
  void check(std::vector<std::string>& faults) const;
};

/// What became of a scan.
struct ScanReport {
  std::size_t points{0};
  std::size_t not_finite{0};
  std::size_t own_body{0};  ///< the robot itself
  std::size_t cut{0};       ///< robot, ground and beyond the range
  bool is_keyframe{false};
  bool is_placed{true};  ///< otherwise nothing of it was inserted
  Alignment alignment;   ///< kNotTried between keyframes, and where the map is still empty
  InsertReport insertion;
  Eigen::Isometry3d base_in_map{Eigen::Isometry3d::Identity()};  ///< with which it was inserted
};

/// Builds the map of the surroundings from scans (Maier & Kleiner 2010, section IV.A and eq. 5): cut, align at
/// keyframes, insert. A correction that the alignment finds stays in force until the next one. If an alignment is not
/// accepted, neither that scan nor those up to the next keyframe are inserted, and the report says so; after
/// unplaced_distance one is, with the guess and the last correction, so that the map goes on where it cannot be
/// aligned.
///
/// Where an IMU tells the bearing, the guess turns as the bearing does and not as the odometry (section V: "odometry
/// and IMU bearing as an initial guess"). A constant error of the bearing has no effect. Where both turn so differently
/// that an alignment could not undo it (max_correction_angle), the odometry's turn is taken.
class LocalMap {
 public:
  /// Throws ParameterError.
  LocalMap(const LocalMapParameters& parameters, const VoxelMapParameters& voxel_parameters,
           const ScanAlignerParameters& aligner_parameters);

  /// `scan` in m in the sensor's frame; `base_in_map` is the odometry's guess for the time of the scan. Nothing is
  /// inserted where a transform is not finite. `bearing_rad`: the IMU's, at that time.
  ScanReport add_scan(const PointCloud& scan, const Eigen::Isometry3d& sensor_in_base,
                      const Eigen::Isometry3d& base_in_map, std::optional<double> bearing_rad = std::nullopt);

  /// A prior map, in the map frame.
  InsertReport add_prior(const PointCloud& points) { return map_.add_points(points); }

  void clear();

  const VoxelMap& map() const { return map_; }
  /// From the guess's map frame to the map's: identity until an alignment is accepted or a bearing turns the guess.
  const Eigen::Isometry3d& correction() const { return correction_; }

 private:
  PointCloud cut(const PointCloud& scan, const Eigen::Isometry3d& sensor_in_base, ScanReport& report) const;
  bool is_keyframe(const Eigen::Isometry3d& base_in_map) const;
  /// Turns the correction by what the bearing has turned more than the odometry since the last scan.
  void follow(std::optional<double> bearing_rad, const Eigen::Isometry3d& base_in_map);
  /// Notes whether scans from this keyframe on have a place in the map.
  void note_placement(const Alignment& alignment, const Eigen::Isometry3d& base_in_map);

  LocalMapParameters parameters_;
  ScanAlignerParameters aligner_parameters_;
  VoxelMap map_;
  Eigen::Isometry3d correction_{Eigen::Isometry3d::Identity()};
  Eigen::Isometry3d last_keyframe_{Eigen::Isometry3d::Identity()};
  bool has_keyframe_{false};
  std::optional<double> odometry_from_bearing_rad_;  ///< the odometry's yaw minus the bearing, at the last scan
  bool is_placed_{true};
  double unplaced_m_{0.0};  ///< travelled since the first keyframe that was not
};

}  // namespace urban_gnss
