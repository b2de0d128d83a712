#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "matchers.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"
#include "urban_gnss_localization/simulation/fix_faults.hpp"

namespace urban_gnss {
namespace {

/// A receiver that goes east by 2 m/s.
ReceiverFix fix_at(double time_s) {
  ReceiverFix fix;
  fix.position = {2.0 * time_s, 5.0, 1.0};
  fix.velocity = {2.0, 0.0, 0.0};
  fix.covariance = 4.0 * Eigen::Matrix3d::Identity();
  return fix;
}

FixFault fault(FixFaultType type, double start = 10.0, double duration = 5.0) {
  FixFault result;
  result.type = type;
  result.start = start;
  result.duration = duration;
  return result;
}

std::vector<PublishedFix> published(FixFaults& faults, double time_s) {
  std::vector<PublishedFix> result(7);
  faults.apply(time_s, fix_at(time_s), result);
  return result;
}

Eigen::Vector3d offset(FixFaults& faults, double time_s) {
  return published(faults, time_s).front().fix.position - fix_at(time_s).position;
}

TEST(FixFaults, WithoutFaultsAFixPassesAsItIs) {
  FixFaults none({}, 1);
  const auto result = published(none, 3.0);
  ASSERT_EQ(result.size(), 1u);
  EXPECT_TRUE(result[0].has_fix);
  EXPECT_EQ(result[0].publisher, 0);
  EXPECT_EQ(result[0].fix.position, fix_at(3.0).position);
  EXPECT_EQ(result[0].fix.covariance, fix_at(3.0).covariance);
  std::vector<PublishedFix> nothing;
  none.apply(4.0, std::nullopt, nothing);
  ASSERT_EQ(nothing.size(), 1u);
  EXPECT_FALSE(nothing[0].has_fix);
}

TEST(FixFaults, SpikeHitsFromStartToBeforeTheEnd) {
  FixFault spike = fault(FixFaultType::kSpike);
  spike.offset = {100.0, -50.0, 3.0};
  FixFaults faults({spike}, 1);
  const Eigen::Vector3d expected(100.0, -50.0, 3.0);
  EXPECT_EQ(offset(faults, 9.999), Eigen::Vector3d::Zero());
  EXPECT_TRUE(offset(faults, 10.0).isApprox(expected));
  EXPECT_TRUE(offset(faults, 14.999).isApprox(expected));
  EXPECT_EQ(offset(faults, 15.0), Eigen::Vector3d::Zero());
}

TEST(FixFaults, ShareOfTheFixesIsHit) {
  FixFault spike = fault(FixFaultType::kSpike, 0.0, 1e6);
  spike.offset = {100.0, 0.0, 0.0};
  spike.share = 0.2;
  FixFault nan = fault(FixFaultType::kNan, 0.0, 1e6);
  nan.share = 0.3;
  FixFaults faults({spike, nan}, 3);
  int spikes = 0;
  int nans = 0;
  int both = 0;
  const int count = 10000;
  for (int i = 0; i < count; ++i) {
    const double east = offset(faults, i).x();
    (std::isnan(east) ? nans : east > 50.0 ? spikes : both) += 1;
  }
  EXPECT_NEAR(nans, 0.3 * count, 4.5 * std::sqrt(0.21 * count));
  EXPECT_NEAR(spikes, 0.2 * 0.7 * count, 4.5 * std::sqrt(0.14 * 0.86 * count));
}

TEST(FixFaults, BlackoutTakesTheFixAway) {
  FixFaults faults({fault(FixFaultType::kBlackout)}, 1);
  EXPECT_TRUE(published(faults, 9.0).front().has_fix);
  EXPECT_FALSE(published(faults, 12.0).front().has_fix);
  EXPECT_TRUE(published(faults, 15.0).front().has_fix);
}

TEST(FixFaults, DecoyIsAClusterAboutItsOffset) {
  FixFault decoy = fault(FixFaultType::kDecoy, 10.0, 1e5);
  decoy.offset = {30.0, 40.0, 0.0};
  decoy.sigma = 0.7;
  FixFaults faults({fault(FixFaultType::kBlackout, 0.0, 10.0), decoy}, 4);
  EXPECT_FALSE(published(faults, 5.0).front().has_fix);
  std::vector<double> east;
  std::vector<double> north;
  for (int i = 0; i < 4000; ++i) {
    const Eigen::Vector3d error = offset(faults, 10.0 + i);
    east.push_back(error.x());
    north.push_back(error.y());
  }
  EXPECT_TRUE(has_moments(east, 30.0, 0.49));
  EXPECT_TRUE(has_moments(north, 40.0, 0.49));
}

TEST(FixFaults, RampGrowsFromItsStart) {
  FixFault ramp = fault(FixFaultType::kRamp);
  ramp.rate = {0.5, -0.25, 0.0};
  FixFaults faults({ramp}, 1);
  EXPECT_EQ(offset(faults, 10.0), Eigen::Vector3d::Zero());
  EXPECT_TRUE(offset(faults, 14.0).isApprox(Eigen::Vector3d(2.0, -1.0, 0.0)));
  EXPECT_EQ(offset(faults, 15.0), Eigen::Vector3d::Zero());
}

TEST(FixFaults, FrozenFixIsTheLastBeforeEvenWhereTheReceiverHasNone) {
  FixFaults faults({fault(FixFaultType::kFreeze), fault(FixFaultType::kFreeze, 20.0, 2.0)}, 1);
  published(faults, 9.0);
  EXPECT_EQ(published(faults, 10.0).front().fix.position, fix_at(9.0).position);
  std::vector<PublishedFix> result;
  faults.apply(12.0, std::nullopt, result);
  EXPECT_TRUE(result.front().has_fix);
  EXPECT_EQ(result.front().fix.position, fix_at(9.0).position);
  EXPECT_EQ(published(faults, 14.0).front().fix.position, fix_at(9.0).position);
  EXPECT_EQ(published(faults, 15.0).front().fix.position, fix_at(15.0).position);
  EXPECT_EQ(published(faults, 20.0).front().fix.position, fix_at(15.0).position);
}

TEST(FixFaults, FreezeFromTheStartHoldsTheFirstFix) {
  FixFaults faults({fault(FixFaultType::kFreeze, 0.0, 5.0)}, 1);
  std::vector<PublishedFix> result;
  faults.apply(0.0, std::nullopt, result);
  EXPECT_FALSE(result.front().has_fix);
  EXPECT_EQ(published(faults, 1.0).front().fix.position, fix_at(1.0).position);
  EXPECT_EQ(published(faults, 2.0).front().fix.position, fix_at(1.0).position);
}

TEST(FixFaults, NanKeepsTheStatusOfAFix) {
  FixFaults faults({fault(FixFaultType::kNan)}, 1);
  const PublishedFix result = published(faults, 10.0).front();
  EXPECT_TRUE(result.has_fix);
  EXPECT_TRUE(result.fix.position.array().isNaN().all());
}

TEST(FixFaults, DuplicatesAreCountedAndCarryTheFaultsBeforeThem) {
  FixFault ramp = fault(FixFaultType::kRamp);
  ramp.rate = {1.0, 0.0, 0.0};
  FixFault first = fault(FixFaultType::kDuplicate);
  first.offset = {0.0, 3.0, 0.0};
  FixFault second = fault(FixFaultType::kDuplicate, 12.0, 1.0);
  FixFaults faults({ramp, first, second, fault(FixFaultType::kBlackout, 13.0, 1.0)}, 1);
  auto result = published(faults, 11.0);
  ASSERT_EQ(result.size(), 2u);
  EXPECT_EQ(result[1].publisher, 1);
  EXPECT_TRUE((result[1].fix.position - fix_at(11.0).position).isApprox(Eigen::Vector3d(1.0, 3.0, 0.0)));
  result = published(faults, 12.0);
  ASSERT_EQ(result.size(), 3u);
  EXPECT_EQ(result[2].publisher, 2);
  result = published(faults, 13.0);
  ASSERT_EQ(result.size(), 2u);
  EXPECT_FALSE(result[0].has_fix);
  EXPECT_TRUE(result[1].has_fix);
}

TEST(FixFaults, SameSeedSameNoise) {
  FixFault decoy = fault(FixFaultType::kDecoy, 0.0);
  FixFaults one({decoy, decoy}, 7);
  FixFaults same({decoy, decoy}, 7);
  FixFaults other({decoy, decoy}, 8);
  EXPECT_EQ(offset(one, 1.0), offset(same, 1.0));
  EXPECT_NE(offset(one, 2.0), offset(other, 2.0));
}

TEST(FixFaults, ListsOfAnotherLengthAreFaults) {
  FixFault bad;
  bad.offset = {1.0, 2.0};
  bad.rate = {};
  std::vector<std::string> faults;
  faults = faults_of(bad);
  ASSERT_EQ(faults.size(), 2u);
  EXPECT_NE(faults[0].find("offset"), std::string::npos);
  EXPECT_NE(faults[1].find("rate"), std::string::npos);
}

TEST(FixFaults, IsReadByName) {
  FixFault read;
  ParameterReader reader(YAML::Load("{type: decoy, start: 3, duration: 4, offset: [1, 2, 3], sigma: 0.1}"));
  EXPECT_TRUE(reader.read(read).finish().empty());
  EXPECT_EQ(read.type, FixFaultType::kDecoy);
  EXPECT_EQ(read.offset[2], 3.0);
}

}  // namespace
}  // namespace urban_gnss
