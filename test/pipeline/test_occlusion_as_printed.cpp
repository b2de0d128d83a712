// Occlusion as Maier and Kleiner print it, selected in YAML as in config/occlusion.yaml.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "matchers.hpp"
#include "satellite_sky.hpp"
#include "synthetic_walls.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/geometry/isometry.hpp"
#include "urban_gnss_localization/gnss/dilution_of_precision.hpp"
#include "urban_gnss_localization/pipeline/occlusion_pipeline.hpp"

namespace urban_gnss {
namespace {

const Stamp kStart = from_seconds(1000.0);
const Eigen::Vector3d kAntenna(0.0, 0.0, 2.0);
const Eigen::Matrix2d kClaim = 400.0 * Eigen::Matrix2d::Identity();

/// As occlusion_node reads its YAML.
OcclusionPipelineParameters read(const std::string& yaml) {
  OcclusionPipelineParameters parameters;
  ParameterReader reader(YAML::Load(yaml), "", "", Layout::kTiered);
  reader.read(parameters);
  for (const std::string& fault : reader.finish()) ADD_FAILURE() << fault;
  return parameters;
}

/// What a fix is made of beside this map, and with a heading that is known to 0.5 rad.
FixAssessment assess(const OcclusionPipelineParameters& parameters, const PointCloud& map, const Sky& sky) {
  OcclusionPipeline pipeline(parameters);
  pipeline.set_antenna(kAntenna);
  pipeline.add_prior(map, {});
  pipeline.set_alignment({kStart, {}, 0.5});
  pipeline.set_satellites(kStart, sky, 0.0);
  return pipeline.assess(kStart, kClaim, Eigen::Isometry3d::Identity());
}

bool is_blocked(const std::string& kdtree_tracer, const PointCloud& map) {
  const OcclusionPipelineParameters p = read("{mode: as_printed, expert: {kdtree_tracer: {" + kdtree_tracer + "}}}");
  return assess(p, map, {satellite(1, 90, 0)}).satellites[0].blocked_fraction == 1.0;
}

/// Points to the east of the antenna, at its height: range, and distance north of the ray (m).
PointCloud points(const std::vector<std::pair<float, float>>& places) {
  PointCloud cloud;
  for (const auto& [range, aside] : places) cloud.emplace_back(range, aside, static_cast<float>(kAntenna.z()));
  return cloud;
}

TEST(OcclusionAsPrinted, EveryParameterOfAlgorithm2HasAnEffect) {
  const PointCloud near = points({{0.2F, 0.1F}});
  EXPECT_TRUE(is_blocked("", near)) << "r starts at 0";
  EXPECT_FALSE(is_blocked("min_range: 1.0", near)) << "r_min";

  const PointCloud far = points({{140.0F, 0.1F}});
  EXPECT_TRUE(is_blocked("", far));
  EXPECT_FALSE(is_blocked("max_range: 100.0", far)) << "r_max";

  const PointCloud between = points({{10.25F, 0.1F}});
  EXPECT_TRUE(is_blocked("search_radius: 0.2, search_radius_slope: 0.0, range_step: 0.25", between));
  EXPECT_FALSE(is_blocked("search_radius: 0.2, search_radius_slope: 0.0, range_step: 1.0", between)) << "r_inc";

  const PointCloud aside = points({{50.0F, 1.2F}});  // 0.3 + 0.02 * 50 = 1.3
  EXPECT_TRUE(is_blocked("", aside));
  EXPECT_FALSE(is_blocked("search_radius: 0.1", aside)) << "determineSearchRadius: at r = 0";
  EXPECT_FALSE(is_blocked("search_radius_slope: 0.01", aside)) << "determineSearchRadius: growth";
  EXPECT_FALSE(is_blocked("search_radius_max: 1.0", aside)) << "determineSearchRadius: bound";

  const PointCloud two = points({{20.0F, 0.3F}, {20.0F, -0.3F}});
  EXPECT_TRUE(is_blocked("min_neighbours: 2", two));
  EXPECT_FALSE(is_blocked("min_neighbours: 3", two)) << "signal_path_obstructed";
}

// An approximate search may miss points near the edge of its radius: it finds no more, and on many rays it finds fewer.
TEST(OcclusionAsPrinted, EpsilonMakesTheSearchApproximate) {
  RandomEngine engine = make_engine(7);
  PointCloud cloud;
  for (int i = 0; i < 5000; ++i) {
    cloud.emplace_back(static_cast<float>(uniform_between(5.0, 60.0, engine)),
                       static_cast<float>(uniform_between(-30.0, 30.0, engine)),
                       static_cast<float>(uniform_between(0.0, 20.0, engine)));
  }
  Sky sky;
  for (int i = 0; i < 200; ++i) sky.push_back(satellite(i + 1, uniform_between(60, 120, engine), 10));
  const auto blocked = [&](const std::string& epsilon) {
    const FixAssessment fix = assess(
        read("{mode: as_printed, expert: {kdtree_tracer: {epsilon: " + epsilon + ", max_range: 25.0}}}"), cloud, sky);
    std::vector<bool> each;
    for (const SatelliteObservation& satellite : fix.satellites) each.push_back(satellite.blocked_fraction == 1.0);
    return each;
  };
  const std::vector<bool> exact = blocked("0.0");
  const std::vector<bool> approximate = blocked("30.0");
  EXPECT_NE(exact, approximate);
  for (std::size_t i = 0; i < exact.size(); ++i) EXPECT_TRUE(exact[i] || !approximate[i]) << i;
}

PointCloud the_wall() { return sampled({wall({-40.0, 10.0}, {40.0, 10.0}, 0.0, 20.0)}, 0.4); }
Sky some_sky() {
  return {satellite(1, 0, 30),   satellite(2, 10, 75),  satellite(3, 90, 30), satellite(4, 180, 30),
          satellite(5, 270, 45), satellite(6, 220, 60), satellite(7, 72, 10), satellite(8, 130, 15),
          satellite(9, 230, 15), satellite(10, 110, 20)};
}

// Eq. (6) of the visible satellites, with the paper's sigma, though the receiver claims 20 m; all others are not used.
TEST(OcclusionAsPrinted, IsEquation6OfWhatOneRayCallsVisible) {
  const FixAssessment fix = assess(read("mode: as_printed"), the_wall(), some_sky());
  std::vector<RangingSatellite> visible;
  for (const SatelliteObservation& each : fix.satellites) {
    EXPECT_TRUE(each.blocked_fraction == 0.0 || each.blocked_fraction == 1.0) << "one ray, however unsure the heading";
    if (each.blocked_fraction == 0.0) visible.push_back({line_of_sight(each.look), 0, 1.0});
  }
  EXPECT_EQ(visible.size(), 8u);
  const Eigen::Matrix2d expected = horizontal_covariance(*dilution_of_precision(visible), 3.75);
  EXPECT_TRUE(fix.covariance.weighted.isApprox(expected, 1e-9)) << fix.covariance.weighted;
  EXPECT_EQ(fix.covariance.is_good, std::sqrt(expected.trace()) <= 6.0);
  EXPECT_FALSE(
      fix.covariance.weighted.isApprox(assess(read("model: paper"), the_wall(), some_sky()).covariance.weighted, 1e-3))
      << "ours";
}

TEST(OcclusionAsPrinted, TooFewVisibleAreRInfinity) {
  Sky three = some_sky();
  three.resize(4);  // the first is behind the wall
  const FixAssessment fix = assess(read("mode: as_printed"), the_wall(), three);
  EXPECT_TRUE(fix.covariance.weighted.isApprox(600.0 * 600.0 * Eigen::Matrix2d::Identity()));
  EXPECT_FALSE(fix.covariance.is_good);
}

TEST(OcclusionAsPrinted, NothingOfOursHasAnEffect) {
  const FixAssessment plain = assess(read("mode: as_printed"), the_wall(), some_sky());
  const FixAssessment other =
      assess(read("{mode: as_printed, tracer: voxel, model: soft, expert: {antenna_sigma: 3.0, heading_sigma: 0.5, "
                  "visibility: {azimuth_samples: 9, elevation_samples: 5, known_range: 5.0, permeable_loss: 1.0}, "
                  "voxel_tracer: {min_range: 20.0, max_range: 30.0, link_length: 1.5}, "
                  "covariance: {allow_smaller: false, blocked_threshold: 0.9, nlos_if_blocked: 0.5, nlos_cn0: 50.0}}}"),
             the_wall(), some_sky());
  EXPECT_EQ(plain.covariance.weighted, other.covariance.weighted);
  for (std::size_t i = 0; i < plain.satellites.size(); ++i) {
    EXPECT_EQ(plain.satellites[i].blocked_fraction, other.satellites[i].blocked_fraction) << i;
  }
  EXPECT_EQ(read("{}").occlusion.mode, OcclusionMode::kStandard);
}

// What the paper has a number for is the default, and can be changed.
TEST(OcclusionAsPrinted, NumbersOfThePaperAreTheDefaults) {
  const OcclusionPipelineParameters p = as_printed({});
  EXPECT_EQ(p.covariance.sigma_ure, 3.75);
  EXPECT_EQ(p.covariance.filter.sigma_infinite, 600.0);
  EXPECT_EQ(p.covariance.filter.sigma_threshold, 6.0);
  EXPECT_EQ(p.covariance.filter.sigma_smooth, 9.0);
  EXPECT_EQ(p.covariance.filter.smooth_length_scale, 0.2);
  EXPECT_EQ(p.covariance.filter.smooth_length_max, 12.0);
  EXPECT_EQ(p.kdtree_tracer.min_range, 0.0);
  const auto weighted = [](const std::string& yaml) {
    return assess(read(yaml), the_wall(), some_sky()).covariance.weighted;
  };
  const Eigen::Matrix2d plain = weighted("mode: as_printed");
  EXPECT_TRUE(weighted("{mode: as_printed, sigma_ure: 1.875}").isApprox(0.25 * plain, 1e-9));
  EXPECT_GT(weighted("{mode: as_printed, expert: {covariance: {filter: {sigma_threshold: 1.0}}}}")(0, 0), 3e5);
}

}  // namespace
}  // namespace urban_gnss
