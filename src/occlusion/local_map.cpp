#include "urban_gnss_localization/occlusion/local_map.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "urban_gnss_localization/common/vector_math.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/geometry/isometry.hpp"

namespace urban_gnss {
namespace {

/// Which points of a scan are cut.
struct CutLimits {
  std::array<float, 12> to_base;  ///< rows of the transform from the sensor
  float body_m;
  float min_height_m;
  float max_range_m;
};

/// What becomes of a few points one after the other.
struct CutPiece {
  static constexpr std::size_t kSize = 256;

  std::array<std::int32_t, kSize> is_kept;  ///< 1 or 0
  std::int32_t not_finite;
  std::int32_t own_body;
};

/// Judges `count` points, CutPiece::kSize at most. `xyz` in m in the sensor's frame.
URBAN_GNSS_VECTORISED void judge(const float* xyz, std::size_t count, const CutLimits limits, CutPiece& piece) {
  const auto& [xx, xy, xz, x0, yx, yy, yz, y0, zx, zy, zz, z0] = limits.to_base;
  std::int32_t not_finite = 0;
  std::int32_t own_body = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const float x = xyz[3 * i];
    const float y = xyz[3 * i + 1];
    const float z = xyz[3 * i + 2];
    const float base_x = xx * x + xy * y + xz * z + x0;
    const float base_y = yx * x + yy * y + yz * z + y0;
    const float base_z = zx * x + zy * y + zz * z + z0;
    const auto is_finite = static_cast<std::int32_t>((x - x == 0.0F) & (y - y == 0.0F) & (z - z == 0.0F));
    const auto is_own_body = static_cast<std::int32_t>(std::sqrt(base_x * base_x + base_y * base_y) < limits.body_m);
    const auto is_cut = static_cast<std::int32_t>((base_z < limits.min_height_m) |
                                                  (std::sqrt(x * x + (y * y + z * z)) > limits.max_range_m));
    piece.is_kept[i] = is_finite & ~(is_own_body | is_cut);
    not_finite += 1 - is_finite;
    own_body += is_finite & is_own_body;
  }
  piece.not_finite = not_finite;
  piece.own_body = own_body;
}

}  // namespace

void LocalMapParameters::check(std::vector<std::string>& faults) const {
  if (body_radius >= max_scan_range) faults.push_back("body_radius: must be less than max_scan_range");
}

LocalMap::LocalMap(const LocalMapParameters& parameters, const VoxelMapParameters& voxel_parameters,
                   const ScanAlignerParameters& aligner_parameters)
    : parameters_(parameters), aligner_parameters_(aligner_parameters), map_(voxel_parameters) {
  require_usable("local map", parameters);
  require_usable("scan aligner", aligner_parameters);
}

void LocalMap::clear() {
  map_.clear();
  correction_.setIdentity();
  has_keyframe_ = false;
  odometry_from_bearing_rad_.reset();
  is_placed_ = true;
  unplaced_m_ = 0.0;
}

ScanReport LocalMap::add_scan(const PointCloud& scan, const Eigen::Isometry3d& sensor_in_base,
                              const Eigen::Isometry3d& base_in_map, std::optional<double> bearing_rad) {
  ScanReport report;
  report.points = scan.size();
  if (!sensor_in_base.matrix().allFinite() || !base_in_map.matrix().allFinite()) {
    report.alignment.reason = "the transform of the scan is not finite";
    report.insertion.points = report.insertion.unusable = scan.size();
    return report;
  }
  const PointCloud kept = cut(scan, sensor_in_base, report);
  follow(bearing_rad, base_in_map);
  const Eigen::Isometry3d guess = correction_ * base_in_map;
  Eigen::Isometry3d sensor_in_map = guess * sensor_in_base;
  report.is_keyframe = is_keyframe(base_in_map);
  if (report.is_keyframe) {
    if (parameters_.align && map_.size() > 0) {
      const PointCloud nearby = map_.points_within(sensor_in_map.translation(), parameters_.align_radius);
      const PointCloud thinned = voxel_filtered(kept, map_.parameters().voxel_size);
      report.alignment = ScanAligner(nearby, aligner_parameters_).align(thinned, sensor_in_map);
      if (report.alignment.is_accepted()) {
        sensor_in_map = report.alignment.pose;
        correction_ = sensor_in_map * sensor_in_base.inverse() * base_in_map.inverse();
      }
    }
    note_placement(report.alignment, base_in_map);
    last_keyframe_ = base_in_map;
    has_keyframe_ = true;
  }
  report.base_in_map = sensor_in_map * sensor_in_base.inverse();
  report.is_placed = is_placed_;
  if (is_placed_) report.insertion = map_.add_scan(transformed(kept, sensor_in_map), sensor_in_map.translation());
  return report;
}

void LocalMap::follow(std::optional<double> bearing_rad, const Eigen::Isometry3d& base_in_map) {
  if (!bearing_rad) {
    odometry_from_bearing_rad_.reset();
    return;
  }
  const double difference_rad = wrap_angle(yaw_of(base_in_map) - *bearing_rad);
  const double before_rad = odometry_from_bearing_rad_.value_or(difference_rad);
  odometry_from_bearing_rad_ = difference_rad;
  const double excess_rad = angle_difference(before_rad, difference_rad);
  if (std::abs(excess_rad) > aligner_parameters_.max_correction_angle) return;
  const Eigen::Translation3d place((correction_ * base_in_map).translation());
  correction_ = place * Eigen::AngleAxisd(excess_rad, Eigen::Vector3d::UnitZ()) * place.inverse() * correction_;
}

void LocalMap::note_placement(const Alignment& alignment, const Eigen::Isometry3d& base_in_map) {
  const bool was_tried = alignment.decision != AlignmentDecision::kNotTried &&
                         alignment.decision != AlignmentDecision::kTooFewPoints;  // nothing to align, or to align with
  const bool was_refused = was_tried && !alignment.is_accepted();
  unplaced_m_ = is_placed_ ? 0.0 : unplaced_m_ + (last_keyframe_.inverse() * base_in_map).translation().norm();
  is_placed_ = !was_refused || unplaced_m_ >= parameters_.unplaced_distance;
}

PointCloud LocalMap::cut(const PointCloud& scan, const Eigen::Isometry3d& sensor_in_base, ScanReport& report) const {
  CutLimits limits{{},
                   static_cast<float>(parameters_.body_radius),
                   static_cast<float>(parameters_.min_height),
                   static_cast<float>(parameters_.max_scan_range)};
  const Eigen::Isometry3f to_base = sensor_in_base.cast<float>();
  Eigen::Map<Eigen::Matrix<float, 3, 4, Eigen::RowMajor>>(limits.to_base.data()) = to_base.affine();
  PointCloud kept;
  kept.resize(scan.size());
  CutPiece piece;
  std::size_t count = 0;
  for (std::size_t first = 0; first < scan.size(); first += CutPiece::kSize) {
    const std::size_t size = std::min(CutPiece::kSize, scan.size() - first);
    judge(scan[first].data(), size, limits, piece);
    report.not_finite += static_cast<std::size_t>(piece.not_finite);
    report.own_body += static_cast<std::size_t>(piece.own_body);
    // Each is written down, and the next one over those that are cut: that is quicker than to jump.
    for (std::size_t i = 0; i < size; ++i) {
      kept[count] = scan[first + i];
      count += static_cast<std::size_t>(piece.is_kept[i]);
    }
  }
  kept.resize(count);
  report.cut = scan.size() - report.not_finite - count;
  return kept;
}

bool LocalMap::is_keyframe(const Eigen::Isometry3d& base_in_map) const {
  if (!has_keyframe_) return true;
  const Eigen::Isometry3d since = last_keyframe_.inverse() * base_in_map;
  return since.translation().norm() >= parameters_.keyframe_distance ||
         Eigen::AngleAxisd(since.linear()).angle() >= parameters_.keyframe_angle;
}

}  // namespace urban_gnss
