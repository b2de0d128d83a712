#include "urban_gnss_localization/pipeline/occlusion_pipeline.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "urban_gnss_localization/geometry/isometry.hpp"

namespace urban_gnss {
namespace {

/// Standard deviation of a heading from which the IMU's may be learnt.
constexpr double kComparable_rad = 0.2;

void append(std::string& text, const std::string& more) { text += (text.empty() ? "" : ", ") + more; }

}  // namespace

EnumNames<OcclusionMode> enum_names(OcclusionMode) {
  return {{"standard", OcclusionMode::kStandard}, {"as_printed", OcclusionMode::kAsPrinted}};
}

EnumNames<TracerChoice> enum_names(TracerChoice) {
  return {{"voxel", TracerChoice::kVoxel}, {"kdtree", TracerChoice::kKdTree}};
}

const char* to_string(CloudDecision decision) {
  switch (decision) {
    case CloudDecision::kInserted: return "inserted";
    case CloudDecision::kNotNewer: return "not newer than the cloud before it";
    case CloudDecision::kEmpty: return "no point in reach";
    case CloudDecision::kNotFinite: return "transform not finite";
    case CloudDecision::kNotPlaced: return "it does not fit the map";
  }
  return "?";
}

void OcclusionParameters::check(std::vector<std::string>& faults) const {
  if (antenna_offset.size() != 3) faults.push_back("antenna_offset: must be x, y and z (m)");
}

OcclusionPipelineParameters as_printed(OcclusionPipelineParameters parameters) {
  parameters.occlusion.mode = OcclusionMode::kAsPrinted;
  parameters.occlusion.tracer = TracerChoice::kKdTree;
  parameters.visibility.azimuth_samples = parameters.visibility.elevation_samples = 1;
  parameters.covariance.model = CovarianceModel::kPaper;
  parameters.covariance.allow_smaller = true;
  return parameters;
}

OcclusionPipeline::OcclusionPipeline(const OcclusionPipelineParameters& parameters)
    : parameters_(parameters.occlusion.mode == OcclusionMode::kAsPrinted ? as_printed(parameters) : parameters),
      local_map_(parameters_.local_map, parameters_.voxels, parameters_.aligner),
      voxel_tracer_(local_map_.map(), parameters_.voxel_tracer),
      sampling_(parameters_.visibility),
      covariance_(parameters_.covariance),
      consistency_(parameters_.consistency),
      antenna_in_base_(parameters_.occlusion.antenna_offset[0], parameters_.occlusion.antenna_offset[1],
                       parameters_.occlusion.antenna_offset[2]),
      heading_(parameters_.imu_orientation) {}

CloudOutcome OcclusionPipeline::add_cloud(Stamp stamp, const PointCloud& cloud, const Eigen::Isometry3d& sensor_in_base,
                                          const Eigen::Isometry3d& base_in_odom) {
  CloudOutcome outcome;
  if (last_cloud_ && stamp <= *last_cloud_ && to_seconds(*last_cloud_ - stamp) <= parameters_.occlusion.map_timeout) {
    outcome.decision = CloudDecision::kNotNewer;
    return outcome;
  }
  if (!sensor_in_base.matrix().allFinite() || !base_in_odom.matrix().allFinite()) {
    outcome.decision = CloudDecision::kNotFinite;
    return outcome;
  }
  const auto heading = heading_.told_at(stamp);
  const std::optional<double> bearing_rad = heading ? std::optional<double>(heading->yaw_rad) : std::nullopt;
  outcome.scan = local_map_.add_scan(cloud, sensor_in_base, base_in_odom, bearing_rad);
  kd_tracer_.reset();
  const ScanReport& scan = outcome.scan;
  if (!scan.is_placed) {
    outcome.decision = CloudDecision::kNotPlaced;  // the map is no younger for it
    return outcome;
  }
  const bool has_ground = scan.points > scan.not_finite + scan.own_body;
  if (scan.insertion.points == scan.insertion.unusable && !has_ground) {
    outcome.decision = CloudDecision::kEmpty;  // nothing was seen, so the map is no younger for it
    return outcome;
  }
  last_cloud_ = stamp;
  return outcome;
}

InsertReport OcclusionPipeline::add_prior(const PointCloud& points, const Pose2& odom_in_world) {
  has_prior_ = true;
  kd_tracer_.reset();
  return local_map_.add_prior(transformed(points, to_isometry(inverse(odom_in_world))));
}

void OcclusionPipeline::set_antenna(const Eigen::Vector3d& place) {
  if (place.allFinite()) antenna_in_base_ = place;
}

void OcclusionPipeline::set_alignment(const WorldAlignment& alignment) {
  if (!is_finite(alignment.odom_in_world)) return;
  const bool is_known = std::isfinite(alignment.yaw_sigma_rad) && alignment.yaw_sigma_rad >= 0.0;
  alignment_ = is_known ? std::optional<WorldAlignment>(alignment) : std::nullopt;
}

void OcclusionPipeline::set_satellites(Stamp stamp, std::vector<SatelliteObservation> satellites,
                                       double angle_resolution_rad) {
  const double resolution_rad = std::isfinite(angle_resolution_rad) ? std::max(0.0, angle_resolution_rad) : 0.0;
  epochs_.add({stamp, std::move(satellites), resolution_rad});
}

void OcclusionPipeline::add_imu(const ImuSample& sample) {
  if (const auto heading = imu_.heading(sample)) heading_.add(*heading);
}

const SatelliteEpoch* OcclusionPipeline::satellites_for(Stamp fix) const {
  const SatelliteEpoch* nearest = epochs_.nearest(fix, parameters_.occlusion.satellites_max_age);
  return nearest != nullptr && !nearest->satellites.empty() ? nearest : nullptr;
}

const RayTracer& OcclusionPipeline::tracer() const {
  if (parameters_.occlusion.tracer == TracerChoice::kVoxel) return voxel_tracer_;
  if (!kd_tracer_) {
    kd_tracer_ = std::make_unique<KdTreeRayTracer>(local_map_.map().points(), parameters_.kdtree_tracer);
  }
  return *kd_tracer_;
}

std::optional<AntennaPose> OcclusionPipeline::antenna_at(Stamp stamp,
                                                         const std::optional<Eigen::Isometry3d>& base_in_odom,
                                                         std::string& missing) const {
  const OcclusionParameters& p = parameters_.occlusion;
  if (!last_cloud_ && !has_prior_) {
    append(missing, "clouds");
  } else if (!has_prior_ && std::abs(to_seconds(stamp - *last_cloud_)) > p.map_timeout) {
    append(missing, "a recent cloud");
  }
  const bool has_pose = base_in_odom && base_in_odom->matrix().allFinite();
  if (!has_pose) append(missing, "the robot's pose in the odometry frame");
  const auto alignment = alignment_at(stamp, has_pose ? base_in_odom : std::nullopt);
  if (!alignment) append(missing, "a heading");
  if (!missing.empty()) return std::nullopt;

  AntennaPose antenna;
  antenna.position = local_map_.correction() * *base_in_odom * antenna_in_base_;
  antenna.position_sigma_m = p.antenna_sigma;
  antenna.east_yaw_rad = wrap_angle(yaw_of(local_map_.correction()) - alignment->odom_in_world.yaw);
  antenna.east_yaw_sigma_rad = std::max(p.heading_sigma, alignment->yaw_sigma_rad);
  return antenna;
}

std::optional<WorldAlignment> OcclusionPipeline::alignment_at(
    Stamp stamp, const std::optional<Eigen::Isometry3d>& base_in_odom) const {
  std::optional<WorldAlignment> alignment = alignment_;
  if (alignment && std::abs(to_seconds(stamp - alignment->stamp)) > parameters_.occlusion.heading_timeout) {
    alignment.reset();
  }
  const auto heading = base_in_odom ? heading_.calibrated_at(stamp) : std::nullopt;
  if (!heading || (alignment && alignment->yaw_sigma_rad <= heading->sigma_rad)) return alignment;
  const double yaw_rad = angle_difference(heading->yaw_rad, yaw_of(*base_in_odom));
  return WorldAlignment{stamp, {0.0, 0.0, yaw_rad}, heading->sigma_rad};
}

void OcclusionPipeline::compare_heading(Stamp stamp, const Eigen::Isometry3d& base_in_odom) {
  if (!alignment_ || !heading_.wants_comparison(stamp) || alignment_->yaw_sigma_rad > kComparable_rad) return;
  if (std::abs(to_seconds(stamp - alignment_->stamp)) > parameters_.occlusion.heading_timeout) return;
  const double yaw_rad = wrap_angle(alignment_->odom_in_world.yaw + yaw_of(base_in_odom));
  heading_.compare(stamp, yaw_rad, alignment_->yaw_sigma_rad, events_);
}

std::vector<double> OcclusionPipeline::skyline_at(const AntennaPose& antenna) const {
  constexpr double kStep_rad = 3.0 * kPi / 180.0;
  return skyline(tracer(), antenna, parameters_.occlusion.sky_azimuths, kStep_rad);
}

/// By solid angle, of the sky above sky_mask.
SkyObservation OcclusionPipeline::observe_sky(const AntennaPose& antenna) const {
  const double mask_sine = std::sin(parameters_.occlusion.sky_mask);
  SkyObservation sky;
  const std::vector<double> elevations = skyline_at(antenna);
  for (const double elevation : elevations) {
    sky.blocked_fraction += std::max(0.0, std::sin(elevation) - mask_sine) / (1.0 - mask_sine);
  }
  sky.blocked_fraction /= static_cast<double>(elevations.size());
  sky.known_fraction = 1.0;
  return sky;
}

FixAssessment OcclusionPipeline::assess(Stamp stamp, const std::optional<Eigen::Matrix2d>& claimed,
                                        const std::optional<Eigen::Isometry3d>& base_in_odom) {
  FixAssessment assessment;
  assessment.stamp = stamp;
  epochs_.take(stamp);
  const SatelliteEpoch* epoch = satellites_for(stamp);
  if (epoch != nullptr) assessment.satellites = epoch->satellites;
  if (base_in_odom && base_in_odom->matrix().allFinite()) compare_heading(stamp, *base_in_odom);
  const auto antenna = antenna_at(stamp, base_in_odom, assessment.missing);
  if (epoch == nullptr) append(assessment.missing, "satellites");
  assessment.visibilities.resize(assessment.satellites.size());
  std::optional<SkyObservation> sky;
  if (antenna) {
    assessment.has_map = true;
    assessment.antenna = *antenna;
    for (std::size_t i = 0; i < assessment.satellites.size(); ++i) {
      SatelliteObservation& satellite = assessment.satellites[i];
      if (!has_direction(satellite)) continue;  // one that is not tracked is looked at: the map says why
      assessment.visibilities[i] = assess_visibility(tracer(), local_map_.map().observed_space(), *antenna,
                                                     satellite.look, epoch->angle_resolution_rad, sampling_);
      satellite.blocked_fraction = assessment.visibilities[i].blocked_fraction;
      satellite.known_fraction = assessment.visibilities[i].known_fraction;
    }
    consistency_.add(stamp, assessment.satellites);
    assessment.strong_share = consistency_.strong_share();
    if (consistency_.is_doubtful()) {
      assessment.doubt = "satellites that the map blocks are received strongly: the heading or the map is wrong";
    }
    if (epoch == nullptr) sky = observe_sky(*antenna);
  }
  assessment.covariance = covariance_.process(stamp, assessment.satellites, sky, claimed);
  return assessment;
}

void OcclusionPipeline::clear_map() {
  local_map_.clear();
  consistency_.reset();
  kd_tracer_.reset();
  last_cloud_.reset();
  has_prior_ = false;
}

void OcclusionPipeline::reset() {
  clear_map();
  covariance_.reset();
  alignment_.reset();
  imu_.reset();
  heading_.reset();
  epochs_.reset();
}

}  // namespace urban_gnss
