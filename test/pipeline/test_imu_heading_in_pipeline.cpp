// What the pipelines make of the heading in an IMU's orientation.

#include <functional>

#include "pipeline_rig.hpp"
#include "urban_gnss_localization/localizers/maier/ukf.hpp"

namespace urban_gnss {
namespace {

using Level = PipelineEvent::Level;

const std::string kDatumOf = "datum: [33.0, 130.0, 20.0], initial_pose: [0.0, 0.0, 0.0]";

std::string use(const std::string& how) { return "{" + kDatumOf + ", imu_heading: " + how + "}"; }

/// Drives with an IMU whose heading is off by `error(time)`, in rad.
void run(Rig& rig, double from, double to, const std::function<double(double)>& error, bool with_fixes = true) {
  for (long k = std::lround(10.0 * from); k <= std::lround(10.0 * to); ++k) {
    const double time = 0.1 * static_cast<double>(k);
    rig.pipeline.add_imu_heading({Rig::at(time), wrap_angle(Rig::truth(time).yaw + error(time)), 0.0});
    if (with_fixes && k % 10 == 0) rig.fix(time);
    rig.drive(time);
  }
}

double yaw_error(const HeadingMeasurement& heading, double time) {
  return angle_difference(heading.yaw_rad, Rig::truth(time).yaw);
}

TEST(ImuHeadingInPipeline, AbsoluteOneIsTakenOnceASecond) {
  Rig rig(use("absolute"));
  run(rig, 0.0, 10.0, [](double) { return 0.0; });
  EXPECT_NEAR(static_cast<double>(rig.fake->headings.size()), 10.0, 1.0);
  EXPECT_NEAR(yaw_error(rig.fake->headings.back(), 10.0), 0.0, 0.11);
  EXPECT_NEAR(rig.fake->headings.back().sigma_rad, 0.2, 1e-9);
}

TEST(ImuHeadingInPipeline, ItIsTurnedToTheTimeOfTheOdometry) {
  Rig rig(use("absolute"));
  rig.drive(0.0);
  for (int k = 1; k <= 4; ++k) rig.drive(0.1 * k);
  rig.pipeline.add_imu_heading({Rig::at(0.2), Rig::truth(0.2).yaw, 0.0});
  rig.drive(0.7);
  ASSERT_EQ(rig.fake->headings.size(), 1u);
  EXPECT_NEAR(yaw_error(rig.fake->headings[0], 0.7), 0.0, 1e-9);
}

TEST(ImuHeadingInPipeline, LearntOneWaitsUntilFixesAndMotionHaveToldItsOffset) {
  for (const double offset : {0.1, kPi / 2.0, -2.5}) {
    Rig rig(use("learnt"));
    run(rig, 0.0, 59.0, [&](double) { return offset; });
    EXPECT_TRUE(rig.fake->headings.empty()) << offset;
    run(rig, 59.1, 150.0, [&](double) { return offset; });
    ASSERT_FALSE(rig.fake->headings.empty()) << offset;
    EXPECT_NEAR(yaw_error(rig.fake->headings.back(), 150.0), 0.0, 0.02 + 0.11);
    EXPECT_TRUE(has_event(rig.pipeline, std::abs(offset) > 0.5 ? Level::kWarn : Level::kInfo, "the IMU's heading is"));
  }
}

TEST(ImuHeadingInPipeline, WhatIsNotAHeadingIsLeftOut) {
  Rig rig(use("absolute"));
  rig.drive(0.0);
  for (const double bad : {kNaN, kInfinity}) rig.pipeline.add_imu_heading({Rig::at(0.05), bad, 0.0});
  rig.pipeline.add_imu_heading({Rig::at(0.05), 0.0, kNaN});
  rig.pipeline.add_imu_heading({Rig::at(3600.0), 0.0, 0.0});
  rig.drive(0.1);
  EXPECT_TRUE(rig.fake->headings.empty());
  run(rig, 0.2, 5.0, [](double) { return 0.0; });
  EXPECT_FALSE(rig.fake->headings.empty()) << "the one of the far future has hidden those after it";
}

TEST(ImuHeadingInPipeline, NoneIsNone) {
  Rig rig(use("none"));
  run(rig, 0.0, 150.0, [](double) { return 0.0; });
  EXPECT_TRUE(rig.fake->headings.empty());
}

TEST(ImuHeadingInPipeline, OldHeadingIsNotTaken) {
  Rig rig(use("absolute"));
  run(rig, 0.0, 5.0, [](double) { return 0.0; });
  const std::size_t taken = rig.fake->headings.size();
  rig.run(6.1, 60.0);
  EXPECT_EQ(rig.fake->headings.size(), taken);
}

/// Two minutes with fixes, then two without, in which the odometry's yaw rate is 0.01 rad/s wrong, by a UKF. The share
/// of the drive in which the true yaw is within 3 standard deviations, and the yaw's error at the end.
struct Outage {
  double honest{0.0};
  double final_error{0.0};
};

Outage outage(const std::string& how, const std::function<double(double)>& error) {
  const auto parameters =
      with(LocalizationParameters{}, "{" + kDatumOf + ", imu_heading_sigma: 0.05, imu_heading: " + how + "}");
  UkfParameters ukf;
  ukf.odometry.yaw_rate_bias_sigma = 0.02;
  ukf.odometry.heading_walk = 0.02;
  Rig rig(parameters, std::make_unique<Ukf>(ukf, MotionParameters()));
  Outage outage;
  int samples = 0;
  for (int k = 0; k <= 2400; ++k) {
    const double time = 0.1 * k;
    rig.pipeline.add_imu_heading({Rig::at(time), wrap_angle(Rig::truth(time).yaw + error(time)), 0.0});
    if (k % 10 == 0 && time < 120.0) rig.fix(time);
    OdometrySample odometry = Rig::odometry(time);
    if (time > 120.0) odometry.twist.yaw_rate_radps += 0.01;
    rig.pipeline.add_odometry(odometry);
    const PoseEstimate estimate = rig.pipeline.localizer().estimate();
    outage.final_error = angle_difference(estimate.pose.yaw, Rig::truth(time).yaw);
    if (time < 10.0) continue;
    ++samples;
    outage.honest += std::abs(outage.final_error) < 3.0 * std::sqrt(estimate.covariance(2, 2));
  }
  outage.honest /= samples;
  return outage;
}

TEST(ImuHeadingInPipeline, HoldsTheYawThroughAnOutage) {
  const auto right = [](double) { return 0.05; };
  EXPECT_GT(std::abs(outage("none", right).final_error), 0.8);
  for (const char* how : {"learnt", "absolute"}) {
    EXPECT_LT(std::abs(outage(how, right).final_error), 0.3) << how;
    EXPECT_GT(outage(how, right).honest, 0.99) << how;
  }
}

TEST(ImuHeadingInPipeline, LyingMagnetometerDoesNotMakeTheYawDishonest) {
  const std::map<std::string, std::function<double(double)>> lies{
      {"90 degrees off", [](double) { return kPi / 2.0; }},
      {"upside down", [](double) { return kPi; }},
      {"wandering", [](double time) { return 1.0 * std::sin(0.05 * time); }},
      {"steel from 150 s on", [](double time) { return time > 150.0 ? 1.5 : 0.0; }},
      {"stuck", [](double time) { return -Rig::truth(time).yaw; }}};
  for (const auto& [name, lie] : lies) {
    for (const char* how : {"learnt", "absolute"}) {
      const double without = outage("none", lie).honest;
      EXPECT_GT(outage(how, lie).honest, std::min(0.97, without - 0.02)) << name << ", " << how;
    }
  }
}

}  // namespace
}  // namespace urban_gnss
