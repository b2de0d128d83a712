// One wall north of a street along the east-west axis, 10 m away and 20 m high: what is behind it is blocked.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "satellite_sky.hpp"
#include "synthetic_walls.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/pipeline/occlusion_pipeline.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
const Stamp kStart = from_seconds(1000.0);

Eigen::Isometry3d at(double x, double y, double z, double yaw = 0.0) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translate(Eigen::Vector3d(x, y, z));
  pose.rotate(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
  return pose;
}

PointCloud the_wall() { return sampled({wall({-40.0, 10.0}, {40.0, 10.0}, 0.0, 20.0)}, 0.4); }

const Eigen::Isometry3d kSensor = at(0.0, 0.0, 2.0);
PointCloud scan() { return transformed(the_wall(), kSensor.inverse()); }

Eigen::Matrix2d claim() { return (Eigen::Matrix2d() << 4.0, 1.0, 1.0, 9.0).finished(); }

enum Where : std::size_t { kBehind, kOverTheRoof, kAlong, kAway, kBackAlong };
Sky sky(double cn0_dbhz = SatelliteObservation::kUnknown) {
  Sky satellites{satellite(1, 0, 30), satellite(2, 0, 75), satellite(3, 90, 30), satellite(4, 180, 30),
                 satellite(5, 270, 45)};
  for (auto& each : satellites) each.cn0_dbhz = cn0_dbhz;
  return satellites;
}

OcclusionPipelineParameters parameters() {
  OcclusionPipelineParameters p;
  p.occlusion.antenna_offset = {0.0, 0.0, 2.0};
  return p;
}

struct Inputs {
  bool cloud{true};
  bool heading{true};
  bool satellites{true};
  double yaw{0.0};
  double yaw_sigma{0.0};
};

void feed(OcclusionPipeline& pipeline, const Inputs& inputs = {}, const Sky& satellites = sky(), Stamp stamp = kStart) {
  if (inputs.cloud) {
    EXPECT_EQ(pipeline.add_cloud(stamp, scan(), kSensor, at(0, 0, 0)).decision, CloudDecision::kInserted);
  }
  if (inputs.heading) pipeline.set_alignment({stamp, {0.0, 0.0, inputs.yaw}, inputs.yaw_sigma});
  if (inputs.satellites) pipeline.set_satellites(stamp, satellites, 0.0);
}

FixAssessment assess(OcclusionPipeline& pipeline, double after_s = 0.0) {
  return pipeline.assess(kStart + from_seconds(after_s), claim(), at(0, 0, 0));
}

void expect_honest(const FixAssessment& fix) {
  const Eigen::Matrix2d& weighted = fix.covariance.weighted;
  ASSERT_TRUE(weighted.allFinite());
  const Eigen::Matrix2d above = weighted - claim();
  EXPECT_GE(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(above).eigenvalues().minCoeff(), -1e-9) << weighted;
  ASSERT_EQ(fix.visibilities.size(), fix.satellites.size());
}

double blocked(const FixAssessment& fix, std::size_t i) { return fix.satellites.at(i).blocked_fraction; }

TEST(OcclusionPipeline, WallBlocksWhatIsBehindIt) {
  for (const TracerChoice tracer : {TracerChoice::kVoxel, TracerChoice::kKdTree}) {
    OcclusionPipelineParameters p = parameters();
    p.occlusion.tracer = tracer;
    OcclusionPipeline pipeline(p);
    feed(pipeline);
    const FixAssessment fix = assess(pipeline);
    expect_honest(fix);
    EXPECT_TRUE(fix.has_map);
    EXPECT_EQ(fix.missing, "");
    EXPECT_EQ(fix.covariance.source, VisibilitySource::kLidar);
    EXPECT_EQ(blocked(fix, kBehind), 1.0);
    EXPECT_NEAR(fix.visibilities[kBehind].range_m, 10.0 / std::cos(degrees_to_radians(30)), 1.5);
    for (const std::size_t free : {kOverTheRoof, kAlong, kAway, kBackAlong}) {
      EXPECT_EQ(blocked(fix, free), 0.0) << free << enum_name(tracer);
      EXPECT_EQ(fix.visibilities[free].range_m, std::numeric_limits<double>::infinity()) << free;
    }
  }
}

TEST(OcclusionPipeline, ASatelliteBehindTheWallCostsWeight) {
  OcclusionPipeline with(parameters());
  OcclusionPipeline without(parameters());
  feed(with, {}, sky(45.0));
  feed(without, {false}, sky(45.0));
  const FixAssessment seen = assess(with);
  const FixAssessment unseen = assess(without);
  EXPECT_EQ(seen.covariance.source, VisibilitySource::kLidarAndSatellites);
  EXPECT_EQ(unseen.covariance.source, VisibilitySource::kSatellites);
  EXPECT_GT(seen.covariance.satellites[kBehind].nlos_probability,
            unseen.covariance.satellites[kBehind].nlos_probability);
}

TEST(OcclusionPipeline, AHeadingOffByHalfATurnShows) {
  OcclusionPipeline pipeline(parameters());
  feed(pipeline, {true, true, true, kPi});
  const FixAssessment fix = assess(pipeline);
  EXPECT_EQ(blocked(fix, kBehind), 0.0);
  EXPECT_EQ(blocked(fix, kAway), 1.0);
}

OcclusionPipelineParameters with_imu(ImuHeadingUse use, double sigma_rad = 0.02) {
  OcclusionPipelineParameters p = parameters();
  p.imu_orientation.imu_heading = use;
  p.imu_orientation.imu_heading_sigma = sigma_rad;
  return p;
}

TEST(OcclusionPipeline, ImuTurnsTheSkyWhereNobodyElseKnowsTheHeading) {
  for (const double yaw : {0.0, 0.5, -2.0}) {
    for (const ImuHeadingUse use : {ImuHeadingUse::kAbsolute, ImuHeadingUse::kLearnt, ImuHeadingUse::kNone}) {
      OcclusionPipeline pipeline(with_imu(use));
      const Eigen::Isometry3d base = at(30.0, -20.0, 0.0, -yaw);  // heading east
      pipeline.add_imu_heading({kStart, 0.0, 0.0});
      pipeline.add_cloud(kStart, scan(), kSensor, base);
      pipeline.set_satellites(kStart, sky(), 0.0);
      const FixAssessment fix = pipeline.assess(kStart, claim(), base);
      EXPECT_EQ(fix.has_map, use == ImuHeadingUse::kAbsolute);
      EXPECT_EQ(fix.missing, fix.has_map ? "" : "a heading");
      if (!fix.has_map) continue;
      EXPECT_EQ(blocked(fix, kBehind), 1.0) << yaw;
      for (const std::size_t free : {kOverTheRoof, kAlong, kAway, kBackAlong})
        EXPECT_EQ(blocked(fix, free), 0.0) << yaw;
    }
  }
}

TEST(OcclusionPipeline, TheSurerHeadingTurnsTheSky) {
  for (const bool localizer_is_surer : {true, false}) {
    OcclusionPipeline pipeline(with_imu(ImuHeadingUse::kAbsolute, 0.1));
    pipeline.add_imu_heading({kStart, kPi, 0.0});  // half a turn off
    feed(pipeline, {true, true, true, 0.0, localizer_is_surer ? 0.05 : 0.3});
    EXPECT_NEAR(blocked(assess(pipeline), kBehind), localizer_is_surer ? 1.0 : 0.0, 0.01);
  }
}

TEST(OcclusionPipeline, ImuLearnsItsOffsetFromTheLocalizer) {
  OcclusionPipeline pipeline(with_imu(ImuHeadingUse::kLearnt));
  Stamp stamp = kStart;
  for (int k = 0; k < 5; ++k, stamp += from_seconds(20.0)) {
    pipeline.add_imu_heading({stamp, 1.5, 0.0});
    feed(pipeline, {}, sky(), stamp);
    pipeline.assess(stamp, claim(), at(0, 0, 0));
  }
  ASSERT_EQ(pipeline.take_events().size(), 1u) << "that it is turned";
  pipeline.add_imu_heading({stamp, 1.5, 0.0});
  feed(pipeline, {true, false}, sky(), stamp);  // the localizer's heading is 20 s old
  const FixAssessment fix = pipeline.assess(stamp, claim(), at(0, 0, 0));
  EXPECT_TRUE(fix.has_map) << fix.missing;
  EXPECT_EQ(blocked(fix, kBehind), 1.0);
  pipeline.reset();
  feed(pipeline, {true, false}, sky(), stamp);
  EXPECT_FALSE(pipeline.assess(stamp, claim(), at(0, 0, 0)).has_map) << "a reset forgets it";
}

// The odometry's frame lies in any way to the world: the same robot in the same street gives the same.
TEST(OcclusionPipeline, TheOdometrysFrameDoesNotMatter) {
  for (const double yaw : {0.5, 2.0, -1.5}) {
    OcclusionPipeline pipeline(parameters());
    const Eigen::Isometry3d base = at(30.0, -20.0, 0.0, -yaw);  // heading east
    pipeline.add_cloud(kStart, scan(), kSensor, base);
    pipeline.set_alignment({kStart, {0.0, 0.0, yaw}, 0.0});
    pipeline.set_satellites(kStart, sky(), 0.0);
    const FixAssessment fix = pipeline.assess(kStart, claim(), base);
    EXPECT_EQ(blocked(fix, kBehind), 1.0) << yaw;
    for (const std::size_t free : {kOverTheRoof, kAlong, kAway, kBackAlong}) EXPECT_EQ(blocked(fix, free), 0.0) << yaw;
  }
}

TEST(OcclusionPipeline, AnUncertainHeadingGivesFractions) {
  OcclusionPipeline pipeline(parameters());
  const Sky about_the_end{satellite(1, 70, 10), satellite(2, 82, 10)};  // the wall ends at an azimuth of 76 degrees
  feed(pipeline, {true, true, true, 0.0, 0.3}, about_the_end);
  const FixAssessment fix = assess(pipeline);
  EXPECT_LT(blocked(fix, 0), 1.0);
  EXPECT_GT(blocked(fix, 0), blocked(fix, 1));
  EXPECT_GT(blocked(fix, 1), 0.0);
  feed(pipeline, {false, true, false, 0.0, 0.0});
  EXPECT_EQ(blocked(assess(pipeline), 0), 1.0);
  EXPECT_EQ(blocked(assess(pipeline), 1), 0.0);
}

TEST(OcclusionPipeline, WhatIsMissingIsNamed) {
  struct Case {
    Inputs inputs;
    const char* missing;
    VisibilitySource source;
  };
  const Case cases[] = {{{false, true, true}, "clouds", VisibilitySource::kSatellites},
                        {{true, false, true}, "a heading", VisibilitySource::kSatellites},
                        {{true, true, false}, "satellites", VisibilitySource::kLidar},
                        {{false, false, false}, "clouds, a heading, satellites", VisibilitySource::kNone}};
  for (const Case& each : cases) {
    OcclusionPipeline pipeline(parameters());
    feed(pipeline, each.inputs, sky(45.0));
    const FixAssessment fix = assess(pipeline);
    EXPECT_EQ(fix.missing, each.missing);
    EXPECT_EQ(fix.covariance.source, each.source) << each.missing;
    EXPECT_EQ(fix.has_map, each.inputs.cloud && each.inputs.heading) << each.missing;
    expect_honest(fix);
  }
  for (const auto& nowhere : {std::optional<Eigen::Isometry3d>(), std::optional<Eigen::Isometry3d>(at(kNaN, 0, 0))}) {
    OcclusionPipeline pipeline(parameters());
    feed(pipeline, {}, sky(45.0));
    const FixAssessment fix = pipeline.assess(kStart, claim(), nowhere);
    EXPECT_EQ(fix.missing, "the robot's pose in the odometry frame");
    EXPECT_EQ(fix.covariance.source, VisibilitySource::kSatellites);
    EXPECT_TRUE(std::isnan(blocked(fix, kBehind)));
    expect_honest(fix);
  }
}

TEST(OcclusionPipeline, WithoutAClaimItIsFinite) {
  OcclusionPipeline pipeline(parameters());
  const FixAssessment fix = pipeline.assess(kStart, std::nullopt, std::nullopt);
  EXPECT_TRUE(fix.covariance.weighted.allFinite());
  EXPECT_GT(fix.covariance.weighted.determinant(), 0.0);
}

TEST(OcclusionPipeline, OldInputsAreNotUsed) {
  OcclusionPipeline pipeline(parameters());
  feed(pipeline);
  EXPECT_EQ(assess(pipeline, 1.9).missing, "");
  EXPECT_EQ(assess(pipeline, 2.1).missing, "satellites");
  EXPECT_EQ(assess(pipeline, 5.1).missing, "a heading, satellites");
  EXPECT_EQ(assess(pipeline, 60.1).missing, "a recent cloud, a heading, satellites");
  expect_honest(assess(pipeline, 60.1));
}

TEST(OcclusionPipeline, CloudsThatCannotBeUsed) {
  OcclusionPipeline pipeline(parameters());
  const auto add = [&](double after_s, const PointCloud& cloud, const Eigen::Isometry3d& base = at(0, 0, 0)) {
    return pipeline.add_cloud(kStart + from_seconds(after_s), cloud, kSensor, base).decision;
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(add(0.0, {}), CloudDecision::kEmpty);
  EXPECT_EQ(add(1.0, PointCloud(50, Eigen::Vector3f(nan, nan, nan))), CloudDecision::kEmpty);
  EXPECT_EQ(add(2.0, PointCloud(50, Eigen::Vector3f(0.5F, 0, -0.5F))), CloudDecision::kEmpty);  // the robot
  EXPECT_EQ(add(3.0, scan(), at(kNaN, 0, 0)), CloudDecision::kNotFinite);
  EXPECT_EQ(pipeline.local_map().map().size(), 0u);
  EXPECT_EQ(add(0.0, scan()), CloudDecision::kInserted) << "none of these counts as the last cloud";
  const std::size_t size = pipeline.local_map().map().size();
  EXPECT_EQ(add(0.0, scan(), at(0, -5, 0)), CloudDecision::kNotNewer);
  EXPECT_EQ(add(-1.0, scan(), at(0, -5, 0)), CloudDecision::kNotNewer);
  EXPECT_EQ(pipeline.local_map().map().size(), size);
  EXPECT_EQ(add(0.1, scan()), CloudDecision::kInserted);
}

TEST(OcclusionPipeline, ACloudOfTheFutureIsNotTheLast) {
  OcclusionPipeline pipeline(parameters());
  EXPECT_EQ(pipeline.add_cloud(kStart + from_seconds(1000), scan(), kSensor, at(0, 0, 0)).decision,
            CloudDecision::kInserted);
  feed(pipeline, {false});
  EXPECT_EQ(assess(pipeline).missing, "a recent cloud");
  feed(pipeline);
  EXPECT_EQ(assess(pipeline).missing, "");
}

TEST(OcclusionPipeline, BadSatellitesAndHeadings) {
  OcclusionPipeline pipeline(parameters());
  Sky satellites = sky(45.0);
  satellites[kAlong].look.azimuth_rad = kNaN;
  satellites[kAway].look.elevation_rad = -0.1;
  satellites[kBackAlong].look.elevation_rad = 3.0;
  feed(pipeline, {}, satellites);
  pipeline.set_satellites(kStart, satellites, kNaN);
  pipeline.set_alignment({kStart, {0.0, 0.0, kNaN}, 0.0});
  pipeline.set_antenna({kNaN, 0.0, 0.0});
  const FixAssessment fix = assess(pipeline);
  expect_honest(fix);
  EXPECT_EQ(fix.missing, "");
  EXPECT_EQ(blocked(fix, kBehind), 1.0);
  for (const std::size_t bad : {kAlong, kAway, kBackAlong}) EXPECT_TRUE(std::isnan(blocked(fix, bad))) << bad;
}

TEST(OcclusionPipeline, AnOpenFieldIsNoMissingMap) {
  OcclusionPipeline pipeline(parameters());
  feed(pipeline, {false});
  EXPECT_EQ(assess(pipeline).missing, "clouds");
  const PointCloud ground(50, Eigen::Vector3f(5, 0, -2));
  EXPECT_EQ(pipeline.add_cloud(kStart, ground, kSensor, at(0, 0, 0)).decision, CloudDecision::kInserted);
  EXPECT_EQ(pipeline.local_map().map().size(), 0u);
  const FixAssessment fix = assess(pipeline);
  EXPECT_EQ(fix.missing, "");
  EXPECT_TRUE(fix.has_map);
  for (std::size_t i = 0; i < fix.satellites.size(); ++i) EXPECT_EQ(blocked(fix, i), 0.0) << i;
  expect_honest(fix);
}

TEST(OcclusionPipeline, AHeadingWithoutAVarianceIsNotKnown) {
  for (const double yaw_sigma : {kNaN, -1.0, std::numeric_limits<double>::infinity()}) {
    OcclusionPipeline pipeline(parameters());
    feed(pipeline);
    pipeline.set_alignment({kStart, {0.0, 0.0, 0.0}, yaw_sigma});
    const FixAssessment fix = assess(pipeline);
    EXPECT_EQ(fix.missing, "a heading") << yaw_sigma;
    EXPECT_FALSE(fix.has_map);
    expect_honest(fix);
    feed(pipeline, {false, true, false});
    EXPECT_EQ(assess(pipeline).missing, "");
  }
}

TEST(OcclusionPipeline, SatellitesAreThoseOfTheFixsOwnStamp) {
  OcclusionPipeline pipeline(parameters());
  const auto at_s = [](double after_s) { return kStart + from_seconds(after_s); };
  feed(pipeline, {true, true, false});
  EXPECT_FALSE(pipeline.awaits_satellites(at_s(0.0))) << "nobody has sent any";
  for (const double after_s : {0.0, 0.2, 0.4}) {  // one more each time
    Sky satellites = sky(45.0);
    satellites.resize(static_cast<std::size_t>(3.0 + 5.0 * after_s + 0.5));
    pipeline.set_satellites(at_s(after_s), satellites, 0.0);
  }
  EXPECT_EQ(assess(pipeline, 0.2).satellites.size(), 4u);
  EXPECT_FALSE(pipeline.awaits_satellites(at_s(0.4)));
  EXPECT_TRUE(pipeline.awaits_satellites(at_s(0.6)));
  EXPECT_FALSE(pipeline.awaits_satellites(at_s(0.41))) << "some drivers round one of the two stamps";
  EXPECT_EQ(assess(pipeline, 0.59).satellites.size(), 5u) << "those next to it in time";
  EXPECT_FALSE(pipeline.awaits_satellites(at_s(0.8))) << "the last fix had none of its own";
  pipeline.set_satellites(at_s(0.59), sky(45.0), 0.0);
  EXPECT_TRUE(pipeline.awaits_satellites(at_s(0.8))) << "they came late, but came";
  pipeline.reset();
  EXPECT_FALSE(pipeline.awaits_satellites(at_s(0.8)));
}

TEST(OcclusionPipeline, AHeadingThatDoesNotFitIsDoubted) {
  Sky satellites = sky(45.0);
  satellites[kBehind].cn0_dbhz = 25.0;
  for (const double yaw : {0.0, kPi}) {
    OcclusionPipeline pipeline(parameters());
    feed(pipeline);
    FixAssessment fix;
    for (double after_s = 0.0; after_s < 60.0; after_s += 0.5) {
      const Stamp stamp = kStart + from_seconds(after_s);
      pipeline.set_alignment({stamp, {0.0, 0.0, yaw}, 0.0});
      pipeline.set_satellites(stamp, satellites, 0.0);
      fix = assess(pipeline, after_s);
      if (after_s < 20.0) {
        EXPECT_TRUE(std::isnan(fix.strong_share)) << "too early to tell: " << after_s;
      }
    }
    EXPECT_EQ(fix.strong_share, yaw == 0.0 ? 0.0 : 1.0);
    EXPECT_EQ(fix.doubt.empty(), yaw == 0.0);
    pipeline.reset();
    feed(pipeline);
    EXPECT_TRUE(std::isnan(assess(pipeline).strong_share));
  }
}

TEST(OcclusionPipeline, TheAntennaIsInItsPlace) {
  OcclusionPipeline pipeline(parameters());
  feed(pipeline);
  pipeline.set_antenna({0.0, 0.0, 25.0});  // above the wall
  const FixAssessment fix = assess(pipeline);
  EXPECT_NEAR(fix.antenna.position.z(), 25.0, 1e-9);
  EXPECT_EQ(blocked(fix, kBehind), 0.0);
}

TEST(OcclusionPipeline, WithoutSatellitesTheSkySpeaks) {
  OcclusionPipeline narrow(parameters());
  feed(narrow, {true, true, false});
  const FixAssessment fix = assess(narrow);
  EXPECT_EQ(fix.missing, "satellites");
  EXPECT_EQ(fix.covariance.source, VisibilitySource::kLidar);
  EXPECT_GT(fix.covariance.weighted.trace(), 1.2 * claim().trace());
  OcclusionPipeline above(parameters());
  feed(above, {true, true, false});
  above.set_antenna({0.0, 0.0, 25.0});
  EXPECT_LT((assess(above).covariance.weighted - claim()).norm(), 1e-9) << "a free sky leaves the claim as it is";
}

TEST(OcclusionPipeline, SkylineIsThatOfTheWall) {
  OcclusionPipeline pipeline(parameters());
  feed(pipeline);
  const std::vector<double> skyline = pipeline.skyline_at(assess(pipeline).antenna);
  ASSERT_EQ(skyline.size(), 72u);
  EXPECT_NEAR(radians_to_degrees(skyline[0]), radians_to_degrees(std::atan(18.0 / 10.0)), 4.0);
  EXPECT_EQ(skyline[36], 0.0);
}

TEST(OcclusionPipeline, APriorMapNeedsNoClouds) {
  OcclusionPipeline pipeline(parameters());
  const Pose2 odom_in_world{5.0, 3.0, 0.5 * kPi};
  EXPECT_GT(pipeline.add_prior(the_wall(), odom_in_world).new_voxels, 0u);
  const Pose2 base = inverse(odom_in_world);  // the origin of the world, heading east
  for (const double after_s : {0.0, 1000.0}) {
    const Stamp stamp = kStart + from_seconds(after_s);
    pipeline.set_alignment({stamp, odom_in_world, 0.0});
    pipeline.set_satellites(stamp, sky(), 0.0);
    const FixAssessment fix = pipeline.assess(stamp, claim(), at(base.x, base.y, 0.0, base.yaw));
    EXPECT_EQ(fix.missing, "");
    EXPECT_EQ(blocked(fix, kBehind), 1.0);
    for (const std::size_t free : {kOverTheRoof, kAlong, kAway}) EXPECT_EQ(blocked(fix, free), 0.0) << free;
  }
  pipeline.clear_map();
  EXPECT_EQ(assess(pipeline, 1000.0).missing, "clouds");
}

TEST(OcclusionPipeline, ClearMapAndReset) {
  for (const TracerChoice tracer : {TracerChoice::kVoxel, TracerChoice::kKdTree}) {
    OcclusionPipelineParameters p = parameters();
    p.occlusion.tracer = tracer;
    OcclusionPipeline pipeline(p);
    feed(pipeline);
    const Eigen::Matrix2d before = assess(pipeline).covariance.weighted;
    pipeline.clear_map();
    EXPECT_EQ(assess(pipeline).missing, "clouds");
    pipeline.reset();
    EXPECT_EQ(assess(pipeline).missing, "clouds, a heading, satellites");
    EXPECT_EQ(pipeline.local_map().map().size(), 0u);
    feed(pipeline);  // the same stamps again, as of a clock that was set back
    EXPECT_EQ(assess(pipeline).missing, "");
    EXPECT_LT((assess(pipeline).covariance.weighted - before).norm(), 1e-9);
  }
}

TEST(OcclusionPipeline, ParametersNameTheirFaults) {
  OcclusionPipelineParameters p;
  std::vector<std::string> faults;
  faults = faults_of(p);
  EXPECT_TRUE(faults.empty());
  p.occlusion.antenna_offset = {1.0, 2.0};
  faults = faults_of(p);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_EQ(faults[0].rfind("antenna_offset", 0), 0u);
}

}  // namespace
}  // namespace urban_gnss
