#include "urban_gnss_localization/occlusion/local_map.hpp"

#include <cmath>

#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/geometry/isometry.hpp"

namespace urban_gnss {

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
  const Eigen::Isometry3f to_base = sensor_in_base.cast<float>();
  const auto body_m = static_cast<float>(parameters_.body_radius);
  const auto min_height_m = static_cast<float>(parameters_.min_height);
  const auto max_range_m = static_cast<float>(parameters_.max_scan_range);
  PointCloud kept;
  kept.resize(scan.size());
  // Each is written down, and the next one over those that are cut: that is quicker than to jump.
  std::size_t count = 0;
  for (const Eigen::Vector3f& point : scan) {
    const Eigen::Vector3f in_base = to_base * point;
    const bool is_finite = point.allFinite();
    const bool is_own_body = is_finite & (in_base.head<2>().norm() < body_m);
    const bool is_kept = is_finite & !(is_own_body | (in_base.z() < min_height_m) | (point.norm() > max_range_m));
    report.not_finite += static_cast<std::size_t>(!is_finite);
    report.own_body += static_cast<std::size_t>(is_own_body);
    kept[count] = point;
    count += static_cast<std::size_t>(is_kept);
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
