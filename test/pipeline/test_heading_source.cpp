#include <gtest/gtest.h>

#include <cmath>

#include "matchers.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/pipeline/heading_source.hpp"

namespace urban_gnss {
namespace {

HeadingSource source() {
  return HeadingSource(with(ImuHeadingParameters{}, "{imu_heading: absolute, imu_heading_sigma: 0.1}"));
}

TEST(HeadingSource, IsBetweenItsMessages) {
  HeadingSource heading = source();
  heading.add({from_seconds(10.0), 3.1, 0.05});
  heading.add({from_seconds(10.2), -3.1, 0.3});  // across the wrap
  const auto told = heading.told_at(from_seconds(10.1));
  ASSERT_TRUE(told);
  EXPECT_NEAR(std::abs(told->yaw_rad), kPi, 1e-9);
  EXPECT_EQ(told->sigma_rad, 0.3);
  EXPECT_NEAR(heading.calibrated_at(from_seconds(10.1))->sigma_rad, 0.3, 1e-12);
}

TEST(HeadingSource, IsNotKnownFarFromItsMessages) {
  HeadingSource heading = source();
  EXPECT_FALSE(heading.told_at(from_seconds(10.0)));
  heading.add({from_seconds(10.0), 1.0, 0.0});
  heading.add({from_seconds(12.0), 2.0, 0.0});
  EXPECT_TRUE(heading.told_at(from_seconds(9.95)));
  EXPECT_TRUE(heading.told_at(from_seconds(12.05)));
  EXPECT_EQ(heading.told_at(from_seconds(11.95))->yaw_rad, 2.0);
  for (const double time : {9.8, 11.0, 12.2}) EXPECT_FALSE(heading.told_at(from_seconds(time))) << time;
}

TEST(HeadingSource, WrongStampIsForgottenWithTheNextRightOnes) {
  HeadingSource heading = source();
  heading.add({from_seconds(10.0), 1.0, 0.0});
  heading.add({from_seconds(5000.0), 2.0, 0.0});
  EXPECT_FALSE(heading.told_at(from_seconds(10.0)));
  heading.add({from_seconds(10.1), 1.0, 0.0});
  EXPECT_TRUE(heading.told_at(from_seconds(10.1)));
  heading.add({from_seconds(9.9), 3.0, 0.0});  // late
  EXPECT_EQ(heading.told_at(from_seconds(10.05))->yaw_rad, 1.0);
}

TEST(HeadingSource, OneASecondIsTaken) {
  HeadingSource heading = source();
  int taken = 0;
  for (int k = 0; k < 80; ++k) {
    heading.add({from_seconds(0.125 * k), 1.0, 0.0});
    taken += heading.take_due(from_seconds(0.125 * k)).has_value();
  }
  EXPECT_EQ(taken, 10);
  EXPECT_FALSE(heading.take_due(from_seconds(20.0))) << "too old";
}

}  // namespace
}  // namespace urban_gnss
