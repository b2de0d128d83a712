#include <gtest/gtest.h>

#include <cmath>

#include "matchers.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/motion/imu_heading.hpp"

namespace urban_gnss {
namespace {

constexpr double kSigma = 0.05;

HeadingCalibration calibration(const std::string& use, const std::string& more = "") {
  return HeadingCalibration(
      with(ImuHeadingParameters{}, "{imu_heading: " + use + ", imu_heading_sigma: 0.1" + more + "}"));
}

/// Compares `count` times, 20 s apart, with the differences that `difference` gives.
template <class Difference>
void compare(HeadingCalibration& calibration, int count, const Difference& difference) {
  for (int k = 0; k < count; ++k) calibration.add(from_seconds(20.0 * k), difference(k), kSigma);
}

TEST(ImuHeading, ConstantOffsetIsLearntAndTakenOff) {
  for (const double offset : {0.0, 0.3, kPi / 2.0, kPi, -3.0}) {
    HeadingCalibration learnt = calibration("learnt");
    compare(learnt, 3, [&](int) { return offset; });
    EXPECT_FALSE(learnt.calibrated({Stamp(0), 1.0, 0.0})) << "three comparisons are too few";
    compare(learnt, 1, [&](int) { return offset; });
    const auto sample = learnt.calibrated({Stamp(0), wrap_angle(1.0 + offset), 0.0});
    ASSERT_TRUE(sample);
    EXPECT_NEAR(sample->yaw_rad, 1.0, 1e-9) << offset;
    EXPECT_NEAR(sample->sigma_rad, std::hypot(0.1, kSigma), 1e-9);
    EXPECT_EQ(learnt.verdict(), std::abs(offset) > 0.5 ? ImuHeadingVerdict::kTurned : ImuHeadingVerdict::kFits);
  }
}

TEST(ImuHeading, AbsoluteOneThatLiesLosesItsSay) {
  HeadingCalibration absolute = calibration("absolute");
  const auto unexamined = absolute.calibrated({Stamp(0), 1.0, 0.0});
  ASSERT_TRUE(unexamined);
  EXPECT_EQ(unexamined->yaw_rad, 1.0);
  EXPECT_EQ(unexamined->sigma_rad, 0.1);
  compare(absolute, 4, [](int) { return kPi / 2.0; });
  const auto sample = absolute.calibrated({Stamp(0), 1.0, 0.0});
  ASSERT_TRUE(sample);
  EXPECT_EQ(sample->yaw_rad, 1.0) << "absolute: as it says";
  EXPECT_GT(sample->sigma_rad, kPi / 2.0);
  EXPECT_NE(absolute.describe().find("90 deg off"), std::string::npos) << absolute.describe();
}

TEST(ImuHeading, OneThatWandersHasNoSay) {
  for (const char* use : {"learnt", "absolute"}) {
    HeadingCalibration wandering = calibration(use);
    compare(wandering, 12, [](int k) { return 1.2 * std::sin(0.7 * k); });
    EXPECT_EQ(wandering.verdict(), ImuHeadingVerdict::kWanders);
    EXPECT_GT(wandering.calibrated({Stamp(0), 1.0, 0.0})->sigma_rad, 0.6);
    compare(wandering, 12, [](int) { return 0.02; });
    EXPECT_EQ(wandering.verdict(), ImuHeadingVerdict::kFits) << "minutes later it is good again";
    EXPECT_LT(wandering.calibrated({Stamp(0), 1.0, 0.0})->sigma_rad, 0.15);
  }
}

TEST(ImuHeading, OffsetOfTheUserIsAdded) {
  HeadingCalibration absolute = calibration("absolute", ", imu_heading_offset: -0.2");
  compare(absolute, 4, [](int) { return 0.2; });
  EXPECT_EQ(absolute.verdict(), ImuHeadingVerdict::kFits);
  EXPECT_NEAR(absolute.calibrated({Stamp(0), 1.0, 0.0})->yaw_rad, 0.8, 1e-12);
  EXPECT_NEAR(absolute.calibrated({Stamp(0), 1.0, 0.0})->sigma_rad, 0.1, 1e-9);
}

TEST(ImuHeading, SigmaIsTheLargerOfDeclaredAndLeast) {
  const HeadingCalibration absolute = calibration("absolute");
  EXPECT_EQ(absolute.calibrated({Stamp(0), 1.0, 0.01})->sigma_rad, 0.1);
  EXPECT_EQ(absolute.calibrated({Stamp(0), 1.0, 0.7})->sigma_rad, 0.7);
}

TEST(ImuHeading, NoneIsNone) {
  HeadingCalibration none = calibration("none");
  EXPECT_FALSE(none.is_due(Stamp(0)));
  EXPECT_FALSE(none.calibrated({Stamp(0), 1.0, 0.01}));
}

}  // namespace
}  // namespace urban_gnss
