#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "matchers.hpp"
#include "package_directory.hpp"
#include "urban_gnss_localization/experiments/faulty_participant.hpp"
#include "urban_gnss_localization/experiments/input_faults.hpp"

namespace urban_gnss {
namespace {

using std::chrono::milliseconds;

const Stamp kStart = std::chrono::seconds(1000);
const Stamp kOnset = std::chrono::seconds(1010);
const Twist2 kDriving{2.0, 0.05};

Stamp at(double time_s) { return kStart + from_seconds(time_s); }

struct ToldYawRate {
  Stamp stamp;
  double yaw_rate_radps;
};

struct ToldEpoch {
  Stamp came;  ///< the last odometry before it
  DriveEpoch epoch;
  Pose2 base_in_odom;
};

/// Writes down what it is told.
class Listener : public LocalizingParticipant {
 public:
  bool wants_clouds() const override { return true; }
  void add_imu_yaw_rate(Stamp stamp, double yaw_rate_radps) override { yaw_rates.push_back({stamp, yaw_rate_radps}); }
  void add_odometry(const OdometrySample& sample) override { odometry.push_back(sample); }
  void add_cloud(Stamp, const PointCloud&, const Eigen::Isometry3d&, const Pose2& base_in_odom) override {
    cloud_base = base_in_odom;
  }
  void add_epoch(const DriveEpoch& epoch, const Pose2& base_in_odom) override {
    epochs.push_back({odometry.back().stamp, epoch, base_in_odom});
  }
  void set_pose_aside(double left_m) override { poses.push_back({odometry.size(), left_m}); }
  void move_antenna(double forward_m) override { antennas.push_back({odometry.size(), forward_m}); }

  std::vector<ToldYawRate> yaw_rates;
  std::vector<OdometrySample> odometry;
  std::vector<ToldEpoch> epochs;
  Pose2 cloud_base;
  std::vector<std::pair<std::size_t, double>> poses;     ///< odometry messages before it, m
  std::vector<std::pair<std::size_t, double>> antennas;  ///< likewise
};

InputFault fault_named(const std::string& name) {
  const Scenario scenario = load_scenario(package_directory() + "/scenarios/campus_loop.yaml");
  for (const InputFault& fault : input_faults(scenario)) {
    if (fault.name == name) return fault;
  }
  throw std::invalid_argument(name);
}

/// A minute at a constant twist, odometry at 50 Hz, IMU at 100 Hz, an epoch each second; a sharp turn from 20 s on
/// where it is wanted.
Listener drive(const InputFault& fault, bool turns = false) {
  Listener listener;
  FaultyParticipant faulty(fault, kOnset, listener);
  Pose2 pose;
  for (int k = 1; k <= 3000; ++k) {
    const Stamp stamp = kStart + k * milliseconds(20);
    Twist2 twist = kDriving;
    if (turns && k > 1000 && k <= 1100) twist.yaw_rate_radps = 0.5;
    pose = move(pose, twist, 0.02);
    faulty.add_imu_yaw_rate(stamp - milliseconds(10), twist.yaw_rate_radps);
    faulty.add_imu_yaw_rate(stamp, twist.yaw_rate_radps);
    faulty.add_odometry({stamp, pose, twist});
    if (k % 50 != 0) continue;
    DriveEpoch epoch;
    epoch.stamp = stamp;
    epoch.fix = ReceiverFix{};
    faulty.add_epoch(epoch, pose);
    faulty.add_cloud(stamp, {}, Eigen::Isometry3d::Identity(), pose);
  }
  return listener;
}

/// Requires that `told` and `expected` agree on everything before `until`, to the last bit.
void expect_same_before(Stamp until, const Listener& told, const Listener& expected) {
  for (std::size_t i = 0; i < expected.odometry.size() && expected.odometry[i].stamp < until; ++i) {
    ASSERT_TRUE(told.odometry.at(i).pose == expected.odometry[i].pose) << i;
    ASSERT_EQ(told.odometry[i].twist.speed_mps, expected.odometry[i].twist.speed_mps) << i;
    ASSERT_EQ(told.odometry[i].twist.yaw_rate_radps, expected.odometry[i].twist.yaw_rate_radps) << i;
  }
  for (std::size_t i = 0; i < expected.yaw_rates.size() && expected.yaw_rates[i].stamp < until; ++i) {
    ASSERT_EQ(told.yaw_rates.at(i).yaw_rate_radps, expected.yaw_rates[i].yaw_rate_radps) << i;
  }
  for (std::size_t i = 0; i < expected.epochs.size() && expected.epochs[i].came < until; ++i) {
    ASSERT_EQ(told.epochs.at(i).epoch.stamp, expected.epochs[i].epoch.stamp) << i;
    ASSERT_TRUE(told.epochs[i].base_in_odom == expected.epochs[i].base_in_odom) << i;
  }
}

constexpr double kForever_s = 1e6;

/// Requires that the odometry says `wrong` from the onset on for `duration_s` and the truth after that, that its pose
/// is the integral of its twists, and that nothing else is changed.
void expect_wheels(const std::string& name, const Twist2& wrong, double duration_s) {
  SCOPED_TRACE(name);
  const Listener told = drive(fault_named(name));
  const Listener right = drive(fault_named("none"));
  expect_same_before(kOnset, told, right);
  for (std::size_t i = 1; i < told.odometry.size(); ++i) {
    const OdometrySample& sample = told.odometry[i];
    const bool is_wrong = sample.stamp >= kOnset && to_seconds(sample.stamp - kOnset) < duration_s - 1e-9;
    const Twist2& expected = is_wrong ? wrong : kDriving;
    ASSERT_NEAR(sample.twist.speed_mps, expected.speed_mps, 1e-12) << to_seconds(sample.stamp - kOnset);
    ASSERT_NEAR(sample.twist.yaw_rate_radps, expected.yaw_rate_radps, 1e-12) << to_seconds(sample.stamp - kOnset);
    ASSERT_TRUE(near(sample.pose, move(told.odometry[i - 1].pose, sample.twist, 0.02), 1e-9));
  }
  for (const ToldYawRate& imu : told.yaw_rates) ASSERT_EQ(imu.yaw_rate_radps, kDriving.yaw_rate_radps);
  for (const ToldEpoch& each : told.epochs) ASSERT_EQ(each.epoch.stamp, each.came);
  EXPECT_TRUE(told.poses.empty() && told.antennas.empty());
}

TEST(InputFaults, WheelsAreWrongWhileTheFaultLasts) {
  const double track_width_m = 0.6;  // of campus_loop
  expect_wheels("none", kDriving, 0.0);
  expect_wheels("dead_encoder", {0.0, 0.0}, 30.0);
  const double right_mps = 2.0 + 0.5 * track_width_m * 0.05;
  expect_wheels("left_wheel_dead", {0.5 * right_mps, right_mps / track_width_m}, 30.0);
  expect_wheels("speed_x0.447", {0.894, 0.05}, kForever_s);
  expect_wheels("speed_x3.6", {7.2, 0.05}, kForever_s);
  expect_wheels("speed_reversed", {-2.0, 0.05}, 30.0);
  expect_wheels("speed_plus_20mps", {22.0, 0.05}, 1.0);
}

TEST(InputFaults, ADeadLeftWheelOnAStraightHalvesTheSpeedAndTurns) {
  const Twist2 told = without_left_wheel({1.2, 0.0}, 0.6);
  EXPECT_NEAR(told.speed_mps, 0.6, 1e-12);
  EXPECT_NEAR(told.yaw_rate_radps, 2.0, 1e-12);
  // On the spot of the left wheel, which stands anyway, nothing is wrong.
  const Twist2 pivot = without_left_wheel({0.3, 1.0}, 0.6);
  EXPECT_NEAR(pivot.speed_mps, 0.3, 1e-12);
  EXPECT_NEAR(pivot.yaw_rate_radps, 1.0, 1e-12);
}

TEST(InputFaults, WrongWheelsMoveWhatIsSeenInTheOdometryFrame) {
  const Listener told = drive(fault_named("dead_encoder"));
  EXPECT_TRUE(near(told.epochs.back().base_in_odom, told.odometry.back().pose, 1e-9));
  EXPECT_TRUE(near(told.cloud_base, told.odometry.back().pose, 1e-9));
}

TEST(InputFaults, TheGyroAloneIsWrong) {
  for (const auto& [name, duration_s, offset_radps, samples] :
       {std::make_tuple("gyro_step", 1.0, 1.0, 100), std::make_tuple("gyro_spike", 0.02, 20.0, 2)}) {
    SCOPED_TRACE(name);
    const Listener told = drive(fault_named(name));
    int wrong = 0;
    for (const ToldYawRate& imu : told.yaw_rates) {
      const double error_radps = imu.yaw_rate_radps - kDriving.yaw_rate_radps;
      if (error_radps == 0.0) continue;
      ++wrong;
      EXPECT_NEAR(error_radps, offset_radps, 1e-12);
      EXPECT_GE(imu.stamp, kOnset);
      EXPECT_LT(imu.stamp, kOnset + from_seconds(duration_s));
    }
    EXPECT_EQ(wrong, samples);
    for (const OdometrySample& sample : told.odometry) ASSERT_EQ(sample.twist.yaw_rate_radps, kDriving.yaw_rate_radps);
  }
}

TEST(InputFaults, TheWheelsSlipInTheFirstSharpTurn) {
  const Listener told = drive(fault_named("slip_in_turn"), true);
  // At 0.5 rad/s from 20 s on, 0.3 rad are passed at 20.62 s.
  expect_same_before(at(20.6), told, drive(fault_named("none"), true));
  for (const OdometrySample& sample : told.odometry) {
    if (sample.stamp > at(23.66)) {
      ASSERT_EQ(sample.twist.speed_mps, 2.0);
    } else if (sample.stamp > at(20.62) && sample.stamp < at(23.6)) {
      ASSERT_EQ(sample.twist.speed_mps, 3.0);
      ASSERT_EQ(sample.twist.yaw_rate_radps, sample.stamp <= at(22.0) ? 0.25 : 0.025);
    }
  }
  // Without a turn there is nothing.
  Listener listener;
  FaultyParticipant straight(fault_named("slip_in_turn"), kOnset, listener);
  straight.add_odometry({kOnset, {}, kDriving});
  EXPECT_FALSE(straight.begin());
}

TEST(InputFaults, LateEpochsComeWithTheStampOfTheirComing) {
  const Listener told = drive(fault_named("fixes_1.5s_late"));
  ASSERT_EQ(told.epochs.size(), 58u);  // of 60, one a second: the last are still on their way
  for (std::size_t i = 0; i < told.epochs.size(); ++i) {
    ASSERT_EQ(told.epochs[i].epoch.stamp, at(static_cast<double>(i + 1) + 1.5)) << i;
    ASSERT_EQ(told.epochs[i].came, told.epochs[i].epoch.stamp) << i;
  }
  for (const OdometrySample& sample : told.odometry) ASSERT_EQ(sample.twist.speed_mps, kDriving.speed_mps);
}

TEST(InputFaults, APoseIsSetOnceAndAnAntennaIsWrongFromTheStart) {
  const Listener pose = drive(fault_named("pose_30m_off"));
  ASSERT_EQ(pose.poses.size(), 1u);
  EXPECT_EQ(pose.poses[0].first, 499u);  // before the odometry of the onset, 10 s at 50 Hz
  EXPECT_EQ(pose.poses[0].second, 30.0);
  const Listener antenna = drive(fault_named("antenna_2m_off"));
  ASSERT_EQ(antenna.antennas.size(), 1u);
  EXPECT_EQ(antenna.antennas[0].first, 0u);
  EXPECT_EQ(antenna.antennas[0].second, 2.0);
  const Listener none = drive(fault_named("none"));
  for (const Listener* told : {&pose, &antenna}) expect_same_before(Stamp::max(), *told, none);
}

}  // namespace
}  // namespace urban_gnss
