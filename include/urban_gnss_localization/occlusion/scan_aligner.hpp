#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/occlusion/point_cloud.hpp"

namespace urban_gnss {

enum class AlignmentFreedom {
  kPlanar,  ///< x, y and yaw: needs no ground in the clouds, roll and pitch are the guess's
  kFull,    ///< all six
};
EnumNames<AlignmentFreedom> enum_names(AlignmentFreedom);

enum class AlignmentMethod {
  kRobust,  ///< ours: the farther a point is off, the less its weight; its reach shrinks from iteration to iteration
  kPclIcp,  ///< PCL's: every pair within max_distance counts alike
};
EnumNames<AlignmentMethod> enum_names(AlignmentMethod);

struct ScanAlignerParameters {
  AlignmentMethod alignment_method{AlignmentMethod::kRobust};
  AlignmentFreedom freedom{AlignmentFreedom::kPlanar};
  int max_iterations{15};
  int max_points{1500};
  int normal_neighbours{10};
  double max_distance{2.0};
  double final_distance{0.8};
  double inlier_distance{0.2};
  double min_inlier_fraction{0.5};
  double min_overlap{0.25};
  double max_residual{0.15};
  double min_conditioning{0.02};
  double max_correction{2.0};
  double max_correction_angle{0.17};

  void visit(ParameterVisitor& v) {
    v("alignment_method", alignment_method,
      "point-to-plane ICP; robust: ours; pcl_icp: pcl::IterativeClosestPointWithNormals");
    v("freedom", freedom, "degrees of freedom of the alignment; planar: x, y and yaw; full: all six");
    v("max_iterations", max_iterations, between(1, 1000), "", "greatest number of iterations of an alignment");
    v("max_points", max_points, at_least(50), "",
      "greatest number of points of the scan that are aligned, evenly chosen");
    v("normal_neighbours", normal_neighbours, between(4, 50), "",
      "number of points of the map from which a plane is fitted");
    v("max_distance", max_distance, positive(), "m",
      "greatest distance from a point to the nearest point of the map in the first iteration");
    v("final_distance", final_distance, positive(), "m",
      "greatest distance from a point to the nearest point of the map in the last iteration and for the checks");
    v("inlier_distance", inlier_distance, positive(), "m", "greatest distance from an inlier to its plane");
    v("min_inlier_fraction", min_inlier_fraction, between(0.0, 1.0), "",
      "least share of inliers among the points near flat pieces of the map");
    v("min_overlap", min_overlap, between(0.0, 1.0), "", "least share of points near flat pieces of the map");
    v("max_residual", max_residual, positive(), "m", "greatest RMS of the inliers' distances to their planes");
    v("min_conditioning", min_conditioning, between(0.0, 1.0), "",
      "least share of the constraint in any direction; a corridor has none along it");
    v("max_correction", max_correction, positive(), "m", "greatest translation away from the odometry's guess");
    v("max_correction_angle", max_correction_angle, positive(), "rad",
      "greatest rotation away from the odometry's guess");
  }
  void check(std::vector<std::string>& faults) const;
};

enum class AlignmentDecision {
  kAccepted,
  kNotTried,      ///< no alignment was asked for
  kTooFewPoints,  ///< in the scan or in the map
  kNoOverlap,     ///< too few points of the scan are near flat pieces of the map
  kDegenerate,    ///< a direction of motion is not constrained
  kTooFewInliers,
  kLargeResidual,
  kLargeCorrection,
};
EnumNames<AlignmentDecision> enum_names(AlignmentDecision);

struct Alignment {
  AlignmentDecision decision{AlignmentDecision::kNotTried};
  std::string reason;  ///< with the figure that decided; empty where accepted
  /// Sensor to map; the guess itself unless accepted.
  Eigen::Isometry3d pose{Eigen::Isometry3d::Identity()};
  double overlap{0.0};  ///< share of the points near flat pieces of the map
  double inlier_fraction{0.0};
  double residual_m{std::numeric_limits<double>::quiet_NaN()};
  double conditioning{0.0};
  double correction_m{0.0};
  double correction_rad{0.0};
  int iterations{0};

  bool is_accepted() const { return decision == AlignmentDecision::kAccepted; }
};

/// Point-to-plane ICP (Chen & Medioni 1992) of a scan to a map with a check of its health. Whichever method finds the
/// pose, it is judged by the same figures: which points are inliers, and how well each direction is constrained.
/// pcl::IterativeClosestPointWithNormals tells neither, and moves in all six directions: with kPlanar x, y and yaw are
/// taken of what it finds.
class ScanAligner {
 public:
  /// `map` (m, map frame) is copied; non-finite points are left out. Throws ParameterError.
  ScanAligner(const PointCloud& map, const ScanAlignerParameters& parameters);
  ~ScanAligner();

  /// `scan` in m in the sensor's frame, non-finite points are left out; `guess` takes it to the map frame.
  Alignment align(const PointCloud& scan, const Eigen::Isometry3d& guess) const;

 private:
  struct Target;
  std::unique_ptr<Target> target_;
  ScanAlignerParameters parameters_;
};

}  // namespace urban_gnss
