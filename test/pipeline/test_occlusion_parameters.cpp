// Every parameter of the occlusion pipeline has an effect on what users see of a drive along a street.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>

#include "matchers.hpp"
#include "satellite_sky.hpp"
#include "synthetic_walls.hpp"
#include "urban_gnss_localization/geometry/isometry.hpp"
#include "urban_gnss_localization/pipeline/occlusion_pipeline.hpp"

namespace urban_gnss {
namespace {

constexpr int kSteps = 40;
constexpr double kStep_s = 0.5;
const Eigen::Vector3d kSensor(0.3, 0.0, 2.0);

Stamp at(int step) { return from_seconds(1000.0 + kStep_s * step); }
Pose2 truth(int step) { return {-10.0 + 0.5 * step, 0.0, 0.1 * std::sin(0.3 * step)}; }
/// The odometry drifts.
Pose2 odometry(int step) { return compose({0.0, 0.02 * step, 0.001 * step}, truth(step)); }
Eigen::Isometry3d base(const Pose2& pose) { return to_isometry(pose); }
Eigen::Isometry3d sensor_in_base() { return Eigen::Isometry3d(Eigen::Translation3d(kSensor)); }

PointCloud near_part(const PointCloud& cloud) {
  PointCloud near;
  for (const Eigen::Vector3f& point : cloud) {
    if (std::abs(point.x()) < 40.0F) near.push_back(point);
  }
  return near;
}

/// Houses, the ground and the robot's own roof; a hedge in every third scan, through which the others look.
PointCloud scan(int step) {
  static const PointCloud houses = near_part(sampled(street(), 1.0));
  static const PointCloud hedge = sampled({wall({-30.0, -7.0}, {30.0, -7.0}, 0.0, 6.0)}, 0.6);
  static const PointCloud ground = sampled({{{-30.0, -8.0, 0.0}, {60.0, 0.0, 0.0}, {0.0, 16.0, 0.0}}}, 2.0);
  PointCloud cloud = houses;
  cloud.insert(cloud.end(), ground.begin(), ground.end());
  if (step % 6 == 0) cloud.insert(cloud.end(), hedge.begin(), hedge.end());
  cloud = transformed(cloud, (base(truth(step)) * sensor_in_base()).inverse());
  for (const float x : {-0.5F, 0.5F, 2.0F}) cloud.emplace_back(x, 0.2F, -0.5F);
  return cloud;
}

Sky sky(int step) {
  Sky all{satellite(1, 0, 30),   satellite(2, 10, 75),  satellite(3, 90, 30),
          satellite(4, 175, 25), satellite(5, 270, 45), satellite(6, 220, 60),
          satellite(7, 350, 40), satellite(8, 185, 55), satellite(9, 120, 15)};
  for (std::size_t i = 0; i < all.size(); ++i) all[i].cn0_dbhz = 33.0 + 2.0 * static_cast<double>(i) + (step % 2);
  return all;
}

/// What users see of the drive, fix by fix.
using Trace = std::vector<std::string>;

/// No farther than the first fix that differs from the reference, where there is one.
Trace trace(const std::string& base_yaml, const std::string& change, const Trace& reference = {}) {
  OcclusionPipelineParameters parameters;
  parameters.occlusion.antenna_offset = {0.0, 0.0, 2.0};
  OcclusionPipeline pipeline(with(with(parameters, base_yaml), change));
  Trace seen;
  for (int step = 0; step < kSteps; ++step) {
    if (!reference.empty() && !seen.empty() && seen.back() != reference[seen.size() - 1]) break;
    std::ostringstream out;
    out.precision(10);
    const Eigen::Isometry3d base_in_odom = base(odometry(step));
    if (step % 2 == 0 && (step < 28 || step > 32)) {
      const CloudOutcome cloud = pipeline.add_cloud(at(step), scan(step), sensor_in_base(), base_in_odom);
      const ScanReport& report = cloud.scan;
      const Alignment& fit = report.alignment;
      out << int(cloud.decision) << ' ' << report.own_body << ' ' << report.cut << ' ' << report.insertion.new_voxels
          << ' ' << report.insertion.dropped_by_limit << ' ' << int(fit.decision) << ' ' << fit.iterations << ' '
          << fit.inlier_fraction << ' ' << fit.residual_m << ' ' << report.base_in_map.translation().transpose() << ' '
          << pipeline.local_map().map().size() << '\n';
    }
    pipeline.add_imu_heading({at(step), truth(step).yaw + 0.05, 0.02});
    if (step < 12 || step > 16) {
      const Pose2 odom_in_world = compose(truth(step), inverse(odometry(step)));
      pipeline.set_alignment({at(step), odom_in_world, 0.03});
    }
    if ((step < 20 || step > 21) && step < 34) pipeline.set_satellites(at(step), sky(step), 0.0175);
    if (step % 2 == 1) continue;
    const FixAssessment fix = pipeline.assess(at(step), 9.0 * Eigen::Matrix2d::Identity(), base_in_odom);
    out << fix.has_map << fix.missing << fix.doubt << ' ' << fix.strong_share << ' '
        << fix.covariance.weighted.reshaped().transpose() << '\n';
    for (std::size_t i = 0; i < fix.satellites.size(); ++i) {
      out << fix.satellites[i].blocked_fraction << ' ' << fix.satellites[i].known_fraction << ' '
          << fix.visibilities[i].range_m << '\n';
    }
    seen.push_back(out.str());
  }
  return seen;
}

TEST(OcclusionParameters, EachHasAnEffect) {
  const std::string none = "{}";
  // By name: what else is set, and another value.
  const std::map<std::string, std::pair<std::string, std::string>> changes = {
      {"mode", {none, "as_printed"}},
      {"tracer", {none, "kdtree"}},
      {"antenna_offset", {none, "[0.5, 0.0, 2.0]"}},
      {"antenna_sigma", {none, "2.0"}},
      {"heading_sigma", {none, "0.3"}},
      {"heading_timeout", {none, "1.0"}},
      {"satellites_max_age", {none, "0.4"}},
      {"map_timeout", {none, "1.0"}},
      {"sky_azimuths", {none, "12"}},
      {"sky_mask", {none, "0.6"}},
      {"azimuth_samples", {none, "1"}},
      {"elevation_samples", {none, "1"}},
      {"known_range", {none, "10.0"}},
      {"permeable_loss", {"ray_stride: 5", "1.0"}},
      {"body_radius", {none, "0.2"}},
      {"min_height", {none, "1.5"}},
      {"max_scan_range", {none, "30.0"}},
      {"align", {none, "false"}},
      {"align_radius", {none, "20.0"}},
      {"keyframe_distance", {none, "3.0"}},
      {"keyframe_angle", {"keyframe_distance: 100.0", "0.05"}},
      {"unplaced_distance", {"max_residual: 0.000001", "2.0"}},
      {"alignment_method", {none, "pcl_icp"}},
      {"freedom", {none, "full"}},
      {"max_iterations", {none, "1"}},
      {"max_points", {none, "200"}},
      {"normal_neighbours", {none, "4"}},
      {"max_distance", {none, "1.0"}},
      {"final_distance", {none, "0.4"}},
      {"inlier_distance", {none, "0.02"}},
      {"min_inlier_fraction", {"inlier_distance: 0.005", "1.0"}},
      {"min_overlap", {none, "1.0"}},
      {"max_residual", {none, "0.000001"}},
      {"min_conditioning", {none, "0.9"}},
      {"max_correction", {none, "0.0001"}},
      {"max_correction_angle", {none, "0.000001"}},
      {"voxel_size", {none, "1.0"}},
      {"window", {none, "40.0"}},
      {"max_voxels", {none, "1000"}},
      {"ray_stride", {none, "10"}},
      {"observed_cell", {none, "2.0"}},
      {"min_range", {none, "25.0"}},
      {"max_range", {none, "15.0"}},
      {"link_length", {none, "1.0"}},
      {"max_permeability", {"ray_stride: 5", "1.0"}},
      {"strong_cn0", {none, "45.0"}},
      {"consistency_time", {none, "3.0"}},
      {"doubtful_share", {none, "0.95"}},
      {"imu_heading", {"heading_timeout: 1.0", "absolute"}},
      {"imu_heading_offset", {"{imu_heading: absolute, heading_timeout: 1.0}", "0.3"}},
      {"imu_heading_sigma", {"{imu_heading: absolute, heading_timeout: 1.0}", "0.3"}},
  };
  std::vector<std::string> elsewhere = parameter_names(GnssCovarianceParameters{});  // GnssCovariance.Every...
  for (const std::string& name : parameter_names(KdTreeRayTracerParameters{})) {
    if (changes.count(name) == 0) elsewhere.push_back(name);  // OcclusionAsPrinted.EveryParameterOfAlgorithm2...
  }
  std::map<std::string, Trace> references;
  for (const std::string& name : parameter_names(OcclusionPipelineParameters{})) {
    const auto found = changes.find(name);
    if (found == changes.end()) {
      EXPECT_EQ(std::count(elsewhere.begin(), elsewhere.end(), name), 1) << name << " is not examined";
      continue;
    }
    const auto& [set, value] = found->second;
    if (references[set].empty()) references[set] = trace(set, none);
    EXPECT_TRUE(trace(set, name + ": " + value, references[set]) != references[set]) << name;
  }
}

}  // namespace
}  // namespace urban_gnss
