#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "urban_gnss_localization/simulation/imu_sensor.hpp"

namespace urban_gnss {
namespace {

ImuParameters perfect() {
  ImuParameters parameters;
  parameters.gyro_noise_density = parameters.gyro_bias_sigma = parameters.gyro_bias_walk = 0.0;
  parameters.acceleration_noise_density = parameters.acceleration_bias_sigma = parameters.acceleration_bias_walk = 0.0;
  return parameters;
}

TEST(ImuSensor, WithoutErrorsItMeasuresTurnAccelerationAndGravity) {
  ImuSensor imu(perfect(), 1);
  const auto message = imu.advance(0.7, {1.5, -2.5}, 0.01);
  ASSERT_TRUE(message);
  EXPECT_NEAR(message->stamp_s, 0.01, 1e-12);
  EXPECT_NEAR((message->angular_velocity_radps - Eigen::Vector3d(0.0, 0.0, 0.7)).norm(), 0.0, 1e-12);
  EXPECT_NEAR((message->acceleration_mps2 - Eigen::Vector3d(1.5, -2.5, 9.80665)).norm(), 0.0, 1e-12);
  EXPECT_EQ(message->angular_velocity_variance, 0.0);
  EXPECT_EQ(message->acceleration_variance, 0.0);
}

TEST(ImuSensor, MessageIsTheMeanOverItsPeriodAndOnTime) {
  ImuSensor imu(perfect(), 1);
  EXPECT_FALSE(imu.advance(1.0, {0.0, 0.0}, 0.004));
  EXPECT_FALSE(imu.advance(2.0, {0.0, 4.0}, 0.004));
  const auto message = imu.advance(3.0, {2.0, 0.0}, 0.004);  // 0.002 s of it belong to the next message
  ASSERT_TRUE(message);
  EXPECT_NEAR(message->angular_velocity_radps.z(), (1.0 * 4 + 2.0 * 4 + 3.0 * 2) / 10, 1e-9);
  EXPECT_NEAR(message->acceleration_mps2.x(), 2.0 * 2 / 10, 1e-9);
  EXPECT_NEAR(message->acceleration_mps2.y(), 4.0 * 4 / 10, 1e-9);
  const auto next = imu.advance(0.0, {0.0, 0.0}, 0.008);
  ASSERT_TRUE(next);
  EXPECT_NEAR(next->angular_velocity_radps.z(), 3.0 * 2 / 10, 1e-9);
  EXPECT_NEAR(next->stamp_s, 0.02, 1e-12);
}

TEST(ImuSensor, NoStepLosesAMessage) {
  ImuSensor imu(perfect(), 1);
  int messages = 0;
  for (int i = 0; i < 100000; ++i) messages += imu.advance(0.0, {0.0, 0.0}, 0.001).has_value();
  EXPECT_EQ(messages, 10000);
}

TEST(ImuSensor, BiasIsWhatItSays) {
  ImuParameters parameters = perfect();
  parameters.gyro_bias_sigma = 0.1;
  parameters.acceleration_bias_sigma = 1.0;
  ImuSensor imu(parameters, 9);
  const auto message = imu.advance(0.0, {0.0, 0.0}, 0.01);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->angular_velocity_radps, imu.gyro_bias_radps());
  EXPECT_NEAR((message->acceleration_mps2 - imu.acceleration_bias_mps2()).z(), kGravity_mps2, 1e-12);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NE(imu.gyro_bias_radps()[axis], 0.0);
    EXPECT_NE(imu.acceleration_bias_mps2()[axis], 0.0);
  }
}

void expect_consistent(const ImuParameters& parameters) {
  const int seeds = 2000;
  Eigen::Vector3d gyro_nees = Eigen::Vector3d::Zero();
  Eigen::Vector3d acceleration_nees = Eigen::Vector3d::Zero();
  for (int seed = 0; seed < seeds; ++seed) {
    ImuSensor imu(parameters, static_cast<std::uint64_t>(seed));
    std::optional<ImuMessage> message;
    for (int i = 0; i < 100; ++i) message = imu.advance(0.4, {1.0, 2.0}, 0.01);
    ASSERT_TRUE(message);
    const Eigen::Array3d gyro_error = message->angular_velocity_radps - Eigen::Vector3d(0.0, 0.0, 0.4);
    const Eigen::Array3d acceleration_error = message->acceleration_mps2 - Eigen::Vector3d(1.0, 2.0, kGravity_mps2);
    gyro_nees += (gyro_error.square() / message->angular_velocity_variance / seeds).matrix();
    acceleration_nees += (acceleration_error.square() / message->acceleration_variance / seeds).matrix();
  }
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(gyro_nees[axis], 1.0, 5.0 * std::sqrt(2.0 / seeds));
    EXPECT_NEAR(acceleration_nees[axis], 1.0, 5.0 * std::sqrt(2.0 / seeds));
  }
}

TEST(ImuSensor, VariancesAreHonest) {
  expect_consistent({});
  ImuParameters walk = perfect();  // each part where it alone matters
  walk.gyro_bias_walk = walk.acceleration_bias_walk = 0.1;
  walk.gyro_noise_density = walk.acceleration_noise_density = 0.001;
  expect_consistent(walk);
  ImuParameters noise = perfect();
  noise.gyro_noise_density = noise.acceleration_noise_density = 0.01;
  expect_consistent(noise);
}

TEST(ImuSensor, SeedDecides) {
  const auto first = [](std::uint64_t seed) { return ImuSensor({}, seed).advance(0.0, {0.0, 0.0}, 0.01); };
  EXPECT_EQ(first(1)->acceleration_mps2, first(1)->acceleration_mps2);
  EXPECT_NE(first(1)->acceleration_mps2, first(2)->acceleration_mps2);
}

}  // namespace
}  // namespace urban_gnss
