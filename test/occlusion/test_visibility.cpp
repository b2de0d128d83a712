#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "synthetic_walls.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/occlusion/visibility.hpp"
#include "urban_gnss_localization/occlusion/voxel_ray_tracer.hpp"

namespace urban_gnss {
namespace {

/// Says what a function says.
class FunctionTracer : public RayTracer {
 public:
  using Function = std::function<RayOutcome(const Eigen::Vector3d&, const Eigen::Vector3d&)>;
  explicit FunctionTracer(Function function) : function_(std::move(function)) {}
  RayOutcome trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const override {
    EXPECT_NEAR(direction.norm(), 1.0, 1e-9);
    return function_(origin, direction);
  }

 private:
  Function function_;
};

RayOutcome blocked_if(bool blocked) {
  RayOutcome outcome;
  outcome.blocked = blocked;
  if (blocked) outcome.range_m = 7.0;
  return outcome;
}

SatelliteVisibility assess(const RayTracer& tracer, const AntennaPose& antenna, const LookAngles& look,
                           double resolution_rad = 0.0) {
  return assess_visibility(tracer, ObservedSpace(4.0), antenna, look, resolution_rad, VisibilityParameters());
}

TEST(Visibility, QuantilesAreThoseOfTheNormalDistribution) {
  EXPECT_EQ(normal_quantiles(1), std::vector<double>{0.0});
  const std::vector<double> three = normal_quantiles(3);
  ASSERT_EQ(three.size(), 3u);
  EXPECT_NEAR(three[0], -0.967421566, 1e-8);  // Phi^-1(1/6), from tables
  EXPECT_NEAR(three[1], 0.0, 1e-12);
  EXPECT_NEAR(three[2], 0.967421566, 1e-8);
}

TEST(Visibility, FractionIsThatOfTheHeadingsUncertainty) {
  // What lies clockwise of an azimuth 0.1 rad to the right is blocked: of five quantiles (0, 0.52 and 1.28 sigma to
  // either side) none, one or two reach it.
  const FunctionTracer tracer(
      [](const Eigen::Vector3d&, const Eigen::Vector3d& d) { return blocked_if(std::atan2(d.x(), d.y()) > 0.1); });
  AntennaPose antenna;
  const LookAngles north{0.0, 0.5};
  for (const auto& [sigma, fraction] : {std::pair{0.0, 0.0}, {0.05, 0.0}, {0.1, 0.2}, {0.3, 0.4}}) {
    antenna.east_yaw_sigma_rad = sigma;
    const SatelliteVisibility visibility = assess(tracer, antenna, north);
    EXPECT_NEAR(visibility.blocked_fraction, fraction, 1e-12) << sigma;
    EXPECT_NEAR(visibility.known_fraction, fraction, 1e-12) << "what blocks has been seen, the rest has not";
    EXPECT_FALSE(visibility.is_blocked_ahead);
    EXPECT_EQ(visibility.range_m, std::numeric_limits<double>::infinity());
  }
  EXPECT_TRUE(assess(tracer, antenna, {0.2, 0.5}).is_blocked_ahead);
  EXPECT_EQ(assess(tracer, antenna, {0.2, 0.5}).range_m, 7.0);
}

TEST(Visibility, EastYawTurnsTheSky) {
  Eigen::Vector3d seen = Eigen::Vector3d::Zero();
  const FunctionTracer tracer([&](const Eigen::Vector3d&, const Eigen::Vector3d& d) {
    seen = d;
    return RayOutcome();
  });
  AntennaPose antenna;
  antenna.east_yaw_rad = 0.3;
  VisibilityParameters one;
  one.azimuth_samples = one.elevation_samples = 1;
  assess_visibility(tracer, ObservedSpace(4.0), antenna, {0.5 * kPi, 0.0}, 0.0, one);  // east
  EXPECT_LT((seen - Eigen::Vector3d(std::cos(0.3), std::sin(0.3), 0.0)).norm(), 1e-9);
}

TEST(Visibility, RaysStartAcrossTheDirection) {
  std::vector<double> east;
  const FunctionTracer tracer([&](const Eigen::Vector3d& origin, const Eigen::Vector3d&) {
    EXPECT_NEAR(origin.y(), 0.0, 1e-12);
    EXPECT_EQ(origin.z(), 2.0);
    east.push_back(origin.x());
    return RayOutcome();
  });
  AntennaPose antenna;
  antenna.position = {0.0, 0.0, 2.0};
  antenna.position_sigma_m = 1.0;
  assess(tracer, antenna, {0.0, 0.5});
  const auto [least, most] = std::minmax_element(east.begin(), east.end());
  EXPECT_NEAR(*most, 1.2815515655, 1e-8);  // the 0.9 quantile
  EXPECT_NEAR(*least, -1.2815515655, 1e-8);
}

TEST(Visibility, RoundingNeitherPassesTheZenithNorTheHorizon) {
  const FunctionTracer tracer([](const Eigen::Vector3d& origin, const Eigen::Vector3d& d) {
    EXPECT_TRUE(origin.allFinite() && d.allFinite());
    EXPECT_GE(d.z(), -1e-12);
    return RayOutcome();
  });
  AntennaPose antenna;
  antenna.position_sigma_m = 1.0;
  for (const double elevation : {0.0, 0.001, 0.5 * kPi - 0.001, 0.5 * kPi}) {
    EXPECT_EQ(assess(tracer, antenna, {1.0, elevation}, 0.2).blocked_fraction, 0.0);
  }
}

TEST(Visibility, VegetationCountsByItsLength) {
  for (const auto& [length_m, fraction] : {std::pair{0.0, 0.0}, {5.0, 0.5}, {10.0, 1.0}, {50.0, 1.0}}) {
    const double vegetation_m = length_m;
    const FunctionTracer tracer([&](const Eigen::Vector3d&, const Eigen::Vector3d&) {
      RayOutcome outcome;
      outcome.vegetation_m = vegetation_m;
      return outcome;
    });
    EXPECT_NEAR(assess(tracer, AntennaPose(), {1.0, 0.5}).blocked_fraction, fraction, 1e-12) << length_m;
  }
}

// A wall of 20 m, 10 m to the north, seen from 2 m: it reaches up to atan(18 cos(azimuth) / 10).
TEST(Visibility, SkylineOfAWall) {
  VoxelMap map{VoxelMapParameters()};
  map.add_points(sampled({wall({-60.0, 10.0}, {60.0, 10.0}, 0.0, 20.0)}, 0.4));
  const VoxelRayTracer tracer(map, VoxelRayTracerParameters());
  AntennaPose antenna;
  antenna.position = {0.0, 0.0, 2.0};
  const double step = 0.02;
  const std::vector<double> elevations = skyline(tracer, antenna, 36, step);
  ASSERT_EQ(elevations.size(), 36u);
  for (std::size_t i = 0; i < elevations.size(); ++i) {
    const double azimuth = 2.0 * kPi * static_cast<double>(i) / 36.0;
    const double degrees = std::abs(radians_to_degrees(std::remainder(azimuth, 2.0 * kPi)));
    if (degrees < 75.0) {  // the map's means end up to half a voxel below the top
      const double distance_m = 10.0 / std::cos(azimuth);
      EXPECT_LE(elevations[i], std::atan(18.1 / distance_m)) << degrees;
      EXPECT_GE(elevations[i], std::atan(17.5 / distance_m) - step) << degrees;
    } else if (degrees > 95.0) {
      EXPECT_EQ(elevations[i], 0.0) << degrees;
    }
  }
}

}  // namespace
}  // namespace urban_gnss
