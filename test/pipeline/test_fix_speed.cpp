#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "urban_gnss_localization/pipeline/fix_speed.hpp"

namespace urban_gnss {
namespace {

constexpr double kPathYaw_rad = 0.7;
const Eigen::Vector2d kAntenna(0.5, 0.2);

/// A robot whose odometry comes at 10 Hz and whose fixes come at 1 Hz.
struct Drive {
  OdometryHistory path{10.0};
  FixSpeed source;
  double time_s{0.0};
  Pose2 truth{10.0, -5.0, kPathYaw_rad};

  Drive() { path.add(Stamp{0}, {}); }

  /// Goes on for a second; `odometry` is what it says of it. The fix that ends it is off by `error`.
  std::optional<ReceiverSpeed> second(const Twist2& twist, const Twist2& odometry,
                                      const Eigen::Vector2d& error = Eigen::Vector2d::Zero()) {
    for (int k = 0; k < 10; ++k) {
      time_s += 0.1;
      path.add(from_seconds(time_s), odometry);
      truth = move(truth, twist, 0.1);
    }
    const Eigen::Vector2d fix = transform_point(truth, kAntenna) + error;
    return source.add(from_seconds(time_s), fix, path, kPathYaw_rad, kAntenna);
  }
};

TEST(FixSpeed, IsThatOfTheRobotWhateverTheWheelsSay) {
  Drive drive;
  for (int k = 0; k < 3; ++k) EXPECT_FALSE(drive.second({2.0, 0.0}, {0.0, 0.0})) << "of too short a time";
  for (int k = 0; k < 10; ++k) {
    const auto speed = drive.second({2.0, 0.0}, {0.0, 0.0});
    ASSERT_TRUE(speed);
    EXPECT_NEAR(*speed->forward_mps, 2.0, 1e-9);
    EXPECT_NEAR(speed->duration_s, 3.0, 1e-9);
    EXPECT_LT(speed->sigma_mps, 0.11);
  }
}

TEST(FixSpeed, HasASign) {
  Drive drive;
  for (int k = 0; k < 5; ++k) drive.second({-1.0, 0.0}, {1.0, 0.0});
  EXPECT_NEAR(*drive.second({-1.0, 0.0}, {1.0, 0.0})->forward_mps, -1.0, 1e-9);
}

TEST(FixSpeed, SaysLittleAfterFixesThatMovedSideways) {
  Drive drive;
  const Eigen::Vector2d left(-std::sin(kPathYaw_rad), std::cos(kPathYaw_rad));
  for (int k = 0; k < 5; ++k) drive.second({1.0, 0.0}, {1.0, 0.0});
  for (int k = 0; k < 5; ++k) drive.second({1.0, 0.0}, {1.0, 0.0}, 12.0 * left);
  const double at_once_mps = drive.second({1.0, 0.0}, {1.0, 0.0}, 12.0 * left)->sigma_mps;
  EXPECT_GT(at_once_mps, 1.0);
  for (int k = 0; k < 59; ++k) drive.second({1.0, 0.0}, {1.0, 0.0}, 12.0 * left);
  EXPECT_LT(drive.second({1.0, 0.0}, {1.0, 0.0}, 12.0 * left)->sigma_mps, 0.2 * at_once_mps) << "it fades";
}

TEST(FixSpeed, HasNoDirectionWithoutAHeading) {
  OdometryHistory path;
  FixSpeed source;
  path.add(Stamp{0}, {});
  for (int k = 1; k <= 40; ++k) path.add(from_seconds(0.1 * k), {1.0, 0.0});
  EXPECT_FALSE(source.add(from_seconds(1.0), {0.0, 0.0}, path, std::nullopt, kAntenna));
  const auto speed = source.add(from_seconds(4.0), {-3.0, 0.0}, path, std::nullopt, kAntenna);
  ASSERT_TRUE(speed);
  EXPECT_FALSE(speed->forward_mps);
  EXPECT_NEAR(speed->speed_mps, 1.0, 1e-9);
}

TEST(FixSpeed, IsNotToldOfATurnOrAfterAGap) {
  Drive drive;
  for (int k = 0; k < 5; ++k) drive.second({1.0, 0.0}, {1.0, 0.0});
  for (int k = 0; k < 3; ++k) drive.second({1.0, 0.3}, {1.0, 0.3});
  EXPECT_FALSE(drive.second({1.0, 0.3}, {1.0, 0.3}));
  for (int k = 0; k < 3; ++k) drive.second({1.0, 0.0}, {1.0, 0.0});
  EXPECT_TRUE(drive.second({1.0, 0.0}, {1.0, 0.0}));
  for (int k = 0; k < 60; ++k) {
    drive.time_s += 0.1;
    drive.path.add(from_seconds(drive.time_s), {1.0, 0.0});
    drive.truth = move(drive.truth, {1.0, 0.0}, 0.1);
  }
  EXPECT_FALSE(drive.second({1.0, 0.0}, {1.0, 0.0}));
}

}  // namespace
}  // namespace urban_gnss
