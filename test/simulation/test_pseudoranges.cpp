#include <gtest/gtest.h>

#include <cmath>

#include "receiver_rig.hpp"
#include "urban_gnss_localization/simulation/knife_edge.hpp"
#include "urban_gnss_localization/simulation/pseudoranges.hpp"

namespace urban_gnss {
namespace {

class ChannelTest : public ::testing::Test {
 protected:
  ChannelOutput step(const ReceivedSatellite& received) { return channel.step(kEpoch, received, parameters, engine); }
  ChannelParameters parameters = without_noise().channel;
  RandomEngine engine = make_engine(5);
  SatelliteChannel channel{parameters, engine};
};

TEST_F(ChannelTest, FreeSignalIsDirect) {
  const ChannelOutput output = step(satellite(1, 0.0, 90.0));
  EXPECT_TRUE(output.is_tracked);
  EXPECT_EQ(output.path_class, PathClass::kDirect);
  EXPECT_NEAR(output.cn0_dbhz, parameters.cn0_zenith, 1e-9);
  EXPECT_NEAR(output.range_error_m, 0.0, 0.01);
}

TEST_F(ChannelTest, ReflectionAloneIsNlosWithItsExcess) {
  const ChannelOutput output = step(behind_a_wall(27.0, 9.0));
  EXPECT_EQ(output.path_class, PathClass::kNlos);
  EXPECT_EQ(output.excess_m, 27.0);
  EXPECT_NEAR(output.range_error_m, 27.0, 0.01);
  EXPECT_NEAR(output.cn0_dbhz, free_cn0_dbhz(degrees_to_radians(40.0), parameters) - 9.0, 1e-9);
}

TEST_F(ChannelTest, TheStrongestPathIsTracked) {
  ReceivedSatellite received = behind_a_wall(27.0, 9.0);
  received.paths.reflections.push_back(reflection(500.0, 7.0, 2));
  EXPECT_EQ(step(received).excess_m, 500.0);
  received.paths.has_direct = true;  // over an edge
  received.paths.loss_db = 6.5;
  received.paths.excess_m = 0.1;
  const ChannelOutput edge = step(received);
  EXPECT_EQ(edge.excess_m, 0.1);
  EXPECT_EQ(edge.path_class, PathClass::kNlos);
  received.paths.is_blocked = false;
  EXPECT_EQ(step(received).path_class, PathClass::kMultipath);
  received.paths.loss_db = 12.0;  // foliage: the reflection wins although the line of sight is there
  EXPECT_EQ(step(received).path_class, PathClass::kNlos);
}

TEST_F(ChannelTest, MultipathIsTheCorrelatorsErrorOfTheExcess) {
  parameters.code_bandwidth = 1e-6;
  ReceivedSatellite received = satellite(1, 0.0, 40.0);
  const double excess_m = 40.0 * kL1Wavelength_m;  // in phase but for the half turn of the reflection
  received.paths.reflections = {reflection(excess_m, 6.0)};
  const double amplitude = std::pow(10.0, -0.3);
  const ChannelOutput output = step(received);
  EXPECT_EQ(output.path_class, PathClass::kMultipath);
  EXPECT_EQ(output.excess_m, 0.0);
  EXPECT_NEAR(output.range_error_m, -amplitude * excess_m / (1.0 - amplitude), 0.02);
  received.paths.reflections = {reflection(500.0, 6.0)};  // beyond the correlator's reach
  EXPECT_EQ(step(received).path_class, PathClass::kDirect);
}

TEST_F(ChannelTest, NothingHeardIsBlocked) {
  ReceivedSatellite received = behind_a_wall(27.0, 9.0);
  received.paths.reflections.clear();
  const ChannelOutput output = step(received);
  EXPECT_EQ(output.path_class, PathClass::kBlocked);
  EXPECT_FALSE(output.is_tracked);
  EXPECT_FALSE(step(behind_a_wall(27.0, 60.0)).is_tracked);
}

TEST_F(ChannelTest, IsAcquiredAfterATimeAndHeldDownToALowerThreshold) {
  parameters.acquisition_time = 1.0;
  const double free_dbhz = free_cn0_dbhz(degrees_to_radians(40.0), parameters);
  const ReceivedSatellite between =
      behind_a_wall(1.0, free_dbhz - 0.5 * (parameters.tracking_threshold + parameters.acquisition_threshold));
  const ReceivedSatellite strong = behind_a_wall(1.0, 0.0);
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(step(between).is_tracked);
  int steps = 1;
  while (!step(strong).is_tracked) ++steps;
  EXPECT_NEAR(steps * kEpoch, 1.0 + kEpoch, 0.5 * kEpoch + 1e-9);
  EXPECT_TRUE(step(between).is_tracked);
  EXPECT_FALSE(step(behind_a_wall(1.0, free_dbhz)).is_tracked);
  EXPECT_FALSE(step(strong).is_tracked);
}

}  // namespace
}  // namespace urban_gnss
