#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "synthetic_walls.hpp"
#include "urban_gnss_localization/occlusion/local_map.hpp"
#include "urban_gnss_localization/occlusion/voxel_ray_tracer.hpp"

namespace urban_gnss {
namespace {

Eigen::Isometry3d pose(double x, double y, double z, double yaw, double pitch = 0.0, double roll = 0.0) {
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  result.translate(Eigen::Vector3d(x, y, z));
  result.rotate(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
                Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()));
  return result;
}

void expect_near(const Eigen::Isometry3d& actual, const Eigen::Isometry3d& expected, double distance_m,
                 double angle_rad) {
  EXPECT_LT((actual.translation() - expected.translation()).norm(), distance_m);
  EXPECT_LT(Eigen::AngleAxisd(actual.linear() * expected.linear().transpose()).angle(), angle_rad);
}

PointCloud with_noise(PointCloud cloud, double sigma_m, std::uint64_t seed) {
  RandomEngine engine = make_engine(seed);
  for (Eigen::Vector3f& point : cloud) {
    for (int axis = 0; axis < 3; ++axis) point[axis] += static_cast<float>(sigma_m * draw_normal(engine));
  }
  return cloud;
}

/// What a lidar with 2 cm of noise sees of the walls around `sensor_in_map`, in its own frame.
PointCloud scan_of(const std::vector<Rectangle>& walls, const Eigen::Isometry3d& sensor_in_map, std::uint64_t seed) {
  RandomEngine engine = make_engine(seed);
  PointCloud cloud;
  for (double azimuth = -M_PI; azimuth < M_PI; azimuth += 0.02) {
    for (double elevation = -0.25; elevation < 0.5; elevation += 0.05) {
      const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                                      std::sin(elevation));
      const auto range_m = exact_range(walls, sensor_in_map.translation(), sensor_in_map.linear() * direction);
      if (range_m && *range_m < 80.0)
        cloud.push_back(((*range_m + 0.02 * draw_normal(engine)) * direction).cast<float>());
    }
  }
  return cloud;
}

const Eigen::Isometry3d kSensor = pose(0.0, 0.0, 1.5, 0.0);

TEST(ScanAligner, RecoversASmallMotion) {
  const auto walls = street();
  const ScanAligner aligner(voxel_filtered(sampled(walls, 0.3), 0.5), {});
  const Eigen::Isometry3d truth = pose(3.0, -1.0, 1.5, 0.4);
  const PointCloud scan = scan_of(walls, truth, 1);
  ASSERT_GT(scan.size(), 2000u);
  const Eigen::Isometry3d guesses[] = {truth, pose(3.5, -0.4, 1.5, 0.4), pose(2.4, -1.5, 1.5, 0.35),
                                       pose(3.2, -1.1, 1.5, 0.45)};
  for (const Eigen::Isometry3d& guess : guesses) {
    const Alignment alignment = aligner.align(scan, guess);
    ASSERT_TRUE(alignment.is_accepted()) << alignment.reason;
    expect_near(alignment.pose, truth, 0.05, 0.003);
    EXPECT_TRUE(alignment.reason.empty());
    EXPECT_GT(alignment.inlier_fraction, 0.9);
    EXPECT_LT(alignment.residual_m, 0.1);
    EXPECT_NEAR(alignment.correction_rad, std::abs(std::atan2(guess.linear()(1, 0), guess.linear()(0, 0)) - 0.4), 0.01);
  }
}

TEST(ScanAligner, PclFindsTheSamePose) {
  const auto walls = street();
  ScanAlignerParameters parameters;
  parameters.alignment_method = AlignmentMethod::kPclIcp;
  const Eigen::Isometry3d truth = pose(3.0, -1.0, 1.5, 0.4);
  const PointCloud scan = scan_of(walls, truth, 1);
  const Eigen::Isometry3d guess = pose(3.2, -1.1, 1.5, 0.42);
  const Eigen::Translation3d far(2000.0, -3000.0, 10.0);  // where floats are coarse
  for (const Eigen::Isometry3d& place : {Eigen::Isometry3d::Identity(), Eigen::Isometry3d(far)}) {
    const ScanAligner aligner(transformed(voxel_filtered(sampled(walls, 0.3), 0.5), place), parameters);
    const Alignment alignment = aligner.align(scan, place * guess);
    ASSERT_TRUE(alignment.is_accepted()) << alignment.reason;
    expect_near(alignment.pose, place * truth, 0.1, 0.01);
    EXPECT_GT(alignment.iterations, 0);
    const Eigen::Isometry3d change = alignment.pose * (place * guess).inverse();
    EXPECT_NEAR((change.linear() * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitZ()).norm(), 0.0, 1e-9) << "planar";
    EXPECT_NEAR(alignment.pose.translation().z(), (place * guess).translation().z(), 1e-9);
  }
}

TEST(ScanAligner, WithPclTooABadFitIsRefused) {
  ScanAlignerParameters parameters;
  parameters.alignment_method = AlignmentMethod::kPclIcp;
  const ScanAligner aligner(voxel_filtered(sampled(street(), 0.3), 0.5), parameters);
  const Eigen::Isometry3d guess = pose(3.0, -1.0, 40.0, 0.4);  // above the roofs
  const Alignment alignment = aligner.align(scan_of(street(), pose(3.0, -1.0, 1.5, 0.4), 1), guess);
  EXPECT_FALSE(alignment.is_accepted());
  EXPECT_TRUE(alignment.pose.isApprox(guess));
}

TEST(ScanAligner, FullFreedomRecoversRollPitchAndHeight) {
  auto walls = street();
  walls.push_back({{-80, -60, 0}, {160, 0, 0}, {0, 120, 0}});  // the ground
  ScanAlignerParameters parameters;
  parameters.freedom = AlignmentFreedom::kFull;
  const ScanAligner aligner(voxel_filtered(sampled(walls, 0.35), 0.5), parameters);
  const Eigen::Isometry3d truth = pose(3.0, -1.0, 1.5, 0.4, 0.02, -0.03);
  const Alignment alignment = aligner.align(scan_of(walls, truth, 1), pose(3.3, -1.2, 1.8, 0.43));
  ASSERT_TRUE(alignment.is_accepted()) << alignment.reason;
  expect_near(alignment.pose, truth, 0.06, 0.004);
}

TEST(ScanAligner, PlanarFreedomLeavesHeightRollAndPitchAlone) {
  const auto walls = street();
  const ScanAligner aligner(voxel_filtered(sampled(walls, 0.3), 0.5), {});
  const Eigen::Isometry3d guess = pose(0.3, 0.2, 1.9, 0.02, 0.01, 0.02);
  const Alignment alignment = aligner.align(scan_of(walls, kSensor, 1), guess);
  ASSERT_TRUE(alignment.is_accepted()) << alignment.reason;
  const Eigen::Matrix3d turn = alignment.pose.linear() * guess.linear().transpose();
  EXPECT_NEAR(turn(2, 2), 1.0, 1e-12);
}

TEST(ScanAligner, RefusesWhatDoesNotConstrain) {
  const std::vector<Rectangle> plane = {wall({-40, 8}, {40, 8}, 0, 10)};
  const std::vector<Rectangle> corridor = {wall({-400, 8}, {400, 8}, 0, 10), wall({-400, -8}, {400, -8}, 0, 10)};
  for (const auto& walls : {plane, corridor}) {
    const ScanAligner aligner(voxel_filtered(sampled(walls, 0.3), 0.5), {});
    const Eigen::Isometry3d guess = pose(0.0, 0.2, 1.5, 0.01);
    const Alignment alignment = aligner.align(scan_of(walls, kSensor, 1), guess);
    EXPECT_EQ(alignment.decision, AlignmentDecision::kDegenerate) << alignment.reason;
    EXPECT_TRUE(alignment.pose.isApprox(guess));
    EXPECT_NE(alignment.reason.find("degenerate"), std::string::npos);
  }
}

TEST(ScanAligner, RefusesNothing) {
  const auto walls = street();
  const PointCloud cloud = sampled(walls, 1.0);
  const PointCloud unusable(200, Eigen::Vector3f::Constant(NAN));
  EXPECT_EQ(ScanAligner({}, {}).align(cloud, kSensor).decision, AlignmentDecision::kTooFewPoints);
  EXPECT_EQ(ScanAligner(unusable, {}).align(cloud, kSensor).decision, AlignmentDecision::kTooFewPoints);
  EXPECT_EQ(ScanAligner(cloud, {}).align({}, kSensor).decision, AlignmentDecision::kTooFewPoints);
  EXPECT_EQ(ScanAligner(cloud, {}).align(unusable, kSensor).decision, AlignmentDecision::kTooFewPoints);
  Eigen::Isometry3d guess = kSensor;
  guess.translation().x() = std::nan("");
  EXPECT_FALSE(ScanAligner(cloud, {}).align(cloud, guess).is_accepted());
  const PointCloud copies(200, Eigen::Vector3f::Ones());
  EXPECT_FALSE(ScanAligner(copies, {}).align(copies, Eigen::Isometry3d::Identity()).is_accepted());
}

TEST(ScanAligner, RefusesTheWrongPlace) {
  const auto walls = street();
  const ScanAligner aligner(voxel_filtered(sampled(walls, 0.3), 0.5), {});
  const PointCloud scan = scan_of(walls, kSensor, 1);
  EXPECT_FALSE(aligner.align(scan, pose(0, 0, 1.5, M_PI)).is_accepted());
  EXPECT_FALSE(aligner.align(scan, pose(15, 0, 1.5, 0)).is_accepted());
  EXPECT_EQ(aligner.align(scan, pose(500, 0, 1.5, 0)).decision, AlignmentDecision::kNoOverlap);
  // Leaves without any plane in them.
  RandomEngine engine = make_engine(3);
  PointCloud bush;
  for (int i = 0; i < 5000; ++i) {
    const Eigen::Vector3d place(draw_normal(engine), draw_normal(engine), draw_normal(engine));
    bush.push_back((5.0 * place).cast<float>());
  }
  EXPECT_FALSE(ScanAligner(bush, {}).align(with_noise(bush, 0.5, 1), pose(0.5, 0, 0, 0)).is_accepted());
}

TEST(ScanAligner, RefusesALargeCorrection) {
  const auto walls = street();
  ScanAlignerParameters parameters;
  parameters.max_correction = 0.2;
  const ScanAligner aligner(voxel_filtered(sampled(walls, 0.3), 0.5), parameters);
  const Alignment alignment = aligner.align(scan_of(walls, kSensor, 1), pose(0.5, 0.3, 1.5, 0.0));
  EXPECT_EQ(alignment.decision, AlignmentDecision::kLargeCorrection);
  EXPECT_NEAR(alignment.correction_m, std::hypot(0.5, 0.3), 0.05);
}

TEST(LocalMap, CutsRobotGroundAndRange) {
  LocalMapParameters parameters;
  parameters.max_scan_range = 50.0;
  LocalMap map(parameters, {}, {});
  const PointCloud scan = {{0.5F, 0.0F, 0.0F},    // the robot
                           {10.0F, 0.0F, -1.4F},  // 10 cm above the ground
                           {60.0F, 0.0F, 0.0F},   // too far
                           {NAN, 0.0F, 0.0F},    {10.0F, 0.0F, 0.0F}, {0.2F, 10.0F, 5.0F}};
  const ScanReport report = map.add_scan(scan, kSensor, pose(100.0, 0.0, 0.0, M_PI / 2.0));
  EXPECT_EQ(report.points, 6u);
  EXPECT_EQ(report.not_finite, 1u);
  EXPECT_EQ(report.cut, 3u);
  EXPECT_EQ(report.insertion.new_voxels, 2u);
  EXPECT_NE(map.map().find({100.0, 10.0, 1.5}), VoxelMap::kNone);
  EXPECT_NE(map.map().find({90.0, 0.2, 6.5}), VoxelMap::kNone);
}

TEST(LocalMap, CutsAPieceAsPointAfterPoint) {
  LocalMapParameters parameters;
  parameters.align = false;
  parameters.min_height = 0.5;
  RandomEngine engine = make_engine(21);
  for (const Eigen::Isometry3d& sensor : {pose(0.0, 0.0, 0.0, 0.0), pose(0.7, -0.2, 1.8, 0.5, 0.1, -0.2)}) {
    // On the limits themselves, what is no point, and both sides of each limit; several pieces, the last one short.
    PointCloud scan = {{1.0F, 0.0F, 0.5F},   {0.6F, 0.8F, 0.5F}, {2.0F, 0.0F, 0.5F},  {100.0F, 0.0F, 0.0F},
                       {60.0F, 0.0F, 80.0F}, {NAN, 5, 5},        {5, INFINITY, 5},    {5, 5, -INFINITY},
                       {0, 0, NAN},          {0, 0, 1},          {1e30F, 0.0F, 0.0F}, {5.0F, 5.0F, 0.5F}};
    while (scan.size() < 3001) {
      const double spread_m = scan.size() % 3 == 0 ? 1.0 : scan.size() % 3 == 1 ? 5.0 : 60.0;
      scan.push_back(
          (spread_m * Eigen::Vector3d(draw_normal(engine), draw_normal(engine), draw_normal(engine))).cast<float>());
    }
    PointCloud kept;
    std::size_t not_finite = 0;
    std::size_t own_body = 0;
    const Eigen::Isometry3f to_base = sensor.cast<float>();
    for (const Eigen::Vector3f& point : scan) {
      const Eigen::Vector3f in_base = to_base * point;
      const bool is_own_body = in_base.head<2>().norm() < 1.0F;
      if (!point.allFinite()) {
        ++not_finite;
      } else if (is_own_body) {
        ++own_body;
      } else if (!(in_base.z() < 0.5F) && !(point.norm() > 100.0F)) {
        kept.push_back(point);
      }
    }
    ASSERT_GT(own_body, 100u);
    ASSERT_GT(kept.size(), 500u);
    LocalMap map(parameters, {}, {});
    const ScanReport report = map.add_scan(scan, sensor, Eigen::Isometry3d::Identity());
    EXPECT_EQ(report.not_finite, not_finite);
    EXPECT_EQ(report.own_body, own_body);
    EXPECT_EQ(report.cut, scan.size() - not_finite - kept.size());
    VoxelMap plain{VoxelMapParameters()};
    plain.add_scan(transformed(kept, sensor), sensor.translation());
    EXPECT_EQ(map.map().points(), plain.points());
  }
}

TEST(LocalMap, EmptyScansAndUnknownTransformsAreHarmless) {
  LocalMap map({}, {}, {});
  EXPECT_EQ(map.add_scan({}, kSensor, Eigen::Isometry3d::Identity()).insertion.new_voxels, 0u);
  Eigen::Isometry3d unknown = kSensor;
  unknown.translation().z() = std::numeric_limits<double>::quiet_NaN();
  const ScanReport report = map.add_scan({{10, 0, 0}}, kSensor, unknown);
  EXPECT_EQ(report.insertion.unusable, 1u);
  EXPECT_FALSE(report.alignment.reason.empty());
  EXPECT_EQ(map.map().size(), 0u);
}

TEST(LocalMap, AlignmentTakesOutTheDriftOfTheOdometry) {
  const auto walls = street();
  LocalMapParameters parameters;
  for (const bool align : {false, true}) {
    parameters.align = align;
    LocalMap map(parameters, {}, {});
    double error_m = 0.0;
    for (int i = 0; i <= 20; ++i) {
      const double x = -15.0 + 1.5 * i;
      const Eigen::Isometry3d truth = pose(x, 0.0, 0.0, 0.0);
      const Eigen::Isometry3d odometry = pose(x, 0.07 * i, 0.0, 0.004 * i);
      const ScanReport report = map.add_scan(scan_of(walls, truth * kSensor, 40 + i), kSensor, odometry);
      EXPECT_TRUE(report.is_keyframe);
      EXPECT_EQ(report.alignment.is_accepted(), align && i > 0) << i << ' ' << report.alignment.reason;
      error_m = (report.base_in_map.translation() - truth.translation()).norm();
    }
    if (align) {
      EXPECT_LT(error_m, 0.2);
    } else {
      EXPECT_NEAR(error_m, 1.4, 0.01);
    }
    const VoxelRayTracer tracer(map.map(), {});
    if (align) {
      EXPECT_TRUE(tracer.trace({0, 0, 1.5}, Eigen::Vector3d(0.0, 15.0, 4.0).normalized()).blocked);
      EXPECT_FALSE(tracer.trace({0, 0, 1.5}, Eigen::Vector3d(0.0, 1.0, 8.0).normalized()).blocked);
    }
  }
}

/// A drive behind wheels that turn too far from one scan to the next, with a bearing that is off by a constant, and
/// jumps in the middle.
struct BearingDrive {
  double excess_rad;
  bool has_bearing;
  double jump_rad;
  double worst_turn_rad{0.0};        ///< of the map's pose, away from the truth
  double worst_correction_rad{0.0};  ///< that an alignment had to find

  BearingDrive(double excess, bool with_bearing, double jump)
      : excess_rad(excess), has_bearing(with_bearing), jump_rad(jump) {
    const auto walls = street();
    LocalMap map({}, {}, {});
    for (int i = 0; i <= 8; ++i) {
      const Eigen::Isometry3d truth = pose(-6.0 + 1.5 * i, 0.0, 0.0, 0.02 * i);
      const Eigen::Isometry3d odometry = pose(-6.0 + 1.5 * i, 0.0, 0.0, (0.02 + excess_rad) * i);
      std::optional<double> bearing_rad;
      if (has_bearing) bearing_rad = 0.02 * i + 1.2 + (i >= 4 ? jump_rad : 0.0);
      const ScanReport report = map.add_scan(scan_of(walls, truth * kSensor, 70 + i), kSensor, odometry, bearing_rad);
      const Eigen::Matrix3d turned = report.base_in_map.linear() * truth.linear().transpose();
      worst_turn_rad = std::max(worst_turn_rad, Eigen::AngleAxisd(turned).angle());
      worst_correction_rad = std::max(worst_correction_rad, report.alignment.correction_rad);
    }
  }
};

TEST(LocalMap, GuessTurnsWithTheBearing) {
  LocalMapParameters blind;
  blind.align = false;
  LocalMap map(blind, {}, {});
  map.add_scan({{10, 0, 1}}, kSensor, pose(1, 2, 0, 0.5), 2.0);
  const Eigen::Isometry3d turned = map.add_scan({{10, 0, 1}}, kSensor, pose(1, 2, 0, 0.5), 2.1).base_in_map;
  expect_near(turned, pose(1, 2, 0, 0.6), 1e-9, 1e-9);
  const Eigen::Isometry3d without = map.add_scan({{10, 0, 1}}, kSensor, pose(1, 2, 0, 0.5)).base_in_map;
  expect_near(without, pose(1, 2, 0, 0.6), 1e-9, 1e-9);  // what it has found stays
}

TEST(LocalMap, BearingGuidesTheAlignment) {
  const BearingDrive guided(0.1, true, 0.0);
  EXPECT_LT(guided.worst_turn_rad, 0.02);
  EXPECT_LT(guided.worst_correction_rad, 0.02);
  EXPECT_GT(BearingDrive(0.1, false, 0.0).worst_correction_rad, 0.08);
}

TEST(LocalMap, BearingThatJumpsIsNotFollowed) {
  EXPECT_LT(BearingDrive(0.03, true, 1.5).worst_turn_rad, 0.02)
      << "the odometry's turn is taken, and the alignment undoes it";
}

TEST(LocalMap, KeyframesAreAtDistancesAndTurns) {
  LocalMap map({}, {}, {});
  const auto is_keyframe = [&](double x, double yaw) {
    return map.add_scan({{10, 0, 0}}, kSensor, pose(x, 0, 0, yaw)).is_keyframe;
  };
  EXPECT_TRUE(is_keyframe(0.0, 0.0));
  EXPECT_FALSE(is_keyframe(0.9, 0.0));
  EXPECT_TRUE(is_keyframe(1.1, 0.0));
  EXPECT_FALSE(is_keyframe(1.2, 0.1));
  EXPECT_TRUE(is_keyframe(1.2, 0.2));
  map.clear();
  EXPECT_TRUE(is_keyframe(1.2, 0.2));
}

TEST(LocalMap, RefusedAlignmentsKeepTheGuess) {
  const std::vector<Rectangle> plane = {wall({-40, 8}, {40, 8}, 0, 10)};
  LocalMap map({}, {}, {});
  map.add_scan(scan_of(plane, kSensor, 1), kSensor, pose(0, 0, 0, 0));
  const Eigen::Isometry3d odometry = pose(1.5, 0.1, 0, 0);
  const ScanReport report = map.add_scan(scan_of(plane, pose(1.5, 0, 1.5, 0), 2), kSensor, odometry);
  EXPECT_EQ(report.alignment.decision, AlignmentDecision::kDegenerate);
  EXPECT_TRUE(report.base_in_map.isApprox(odometry, 1e-12));
  EXPECT_TRUE(map.correction().isApprox(Eigen::Isometry3d::Identity()));
}

TEST(LocalMap, AScanThatIsNotPlacedIsNotInserted) {
  const auto walls = street();
  LocalMap map({}, {}, {});
  map.add_scan(scan_of(walls, kSensor, 1), kSensor, pose(0, 0, 0, 0));
  const std::size_t size = map.map().size();
  const auto lost = [&](double x) {  // the odometry is 9 m off to the side
    return map.add_scan(scan_of(walls, pose(x, 0, 1.5, 0), 2), kSensor, pose(x, 9.0, 0, 0));
  };
  for (const double x : {0.0, 0.5, 1.5}) {  // a keyframe, one before the next, and that
    const ScanReport report = lost(x);
    EXPECT_FALSE(report.is_placed) << x;
    EXPECT_EQ(report.insertion.points, 0u);
    EXPECT_EQ(map.map().size(), size);
  }
  const ScanReport found = map.add_scan(scan_of(walls, pose(3, 0, 1.5, 0), 3), kSensor, pose(3, 0, 0, 0));
  EXPECT_TRUE(found.is_placed) << found.alignment.reason;
  EXPECT_GT(found.insertion.points, 0u);
}

TEST(LocalMap, AMapThatCannotBeAlignedGoesOnAfterADistance) {
  const std::vector<Rectangle> plane = {wall({-40, 8}, {40, 8}, 0, 10)};
  LocalMapParameters parameters;
  parameters.unplaced_distance = 3.5;
  LocalMap map(parameters, {}, {});
  std::vector<int> placed;
  for (int k = 0; k <= 10; ++k) {
    const auto report = map.add_scan(scan_of(plane, pose(k, 0, 1.5, 0), 1), kSensor, pose(k, 0, 0, 0));
    if (report.is_placed) placed.push_back(k);
  }
  EXPECT_EQ(placed, (std::vector<int>{0, 5, 10}));
}

TEST(LocalMap, ParametersMustBeInOrder) {
  LocalMapParameters parameters;
  parameters.body_radius = 200.0;
  EXPECT_THROW(LocalMap(parameters, {}, {}), ParameterError);
  ScanAlignerParameters aligner;
  aligner.final_distance = 5.0;
  EXPECT_THROW(LocalMap({}, {}, aligner), ParameterError);
}

TEST(ScanAligner, RealScanFindsItsOwnMotion) {
  const char* data = std::getenv("URBAN_GNSS_DATA");
  if (data == nullptr) GTEST_SKIP() << "URBAN_GNSS_DATA is not set";
  const std::string path = std::string(data) + "/ray/urbannav_hk_hdl32_scan.pcd";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no file " << path;
  PointCloud map;  // without the points of `scan`, so that none meets itself
  PointCloud scan;
  const PointCloud cloud = read_pcd(path);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (cloud[i].z() > -1.5F && cloud[i].norm() > 2.0F) (i % 8 == 0 ? scan : map).push_back(cloud[i]);
  }
  const Alignment alignment = ScanAligner(voxel_filtered(map, 0.5), {}).align(scan, pose(0.4, -0.3, 0.0, 0.03));
  ASSERT_TRUE(alignment.is_accepted()) << alignment.reason;
  expect_near(alignment.pose, Eigen::Isometry3d::Identity(), 0.1, 0.01);
}

}  // namespace
}  // namespace urban_gnss
