#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "urban_gnss_localization/pipeline/yaw_rate_source.hpp"

namespace urban_gnss {
namespace {

/// Odometry at 10 Hz that says 0.1 rad/s.
struct Steps {
  YawRateSource source;
  std::vector<PipelineEvent> events;
  double time{0.0};
  double odometry_radps{0.1};

  explicit Steps(bool use = true) : source({use}, 2.0) {}
  void imu(double at, double rate) { source.add(from_seconds(at), rate); }
  double step() {
    const Stamp since = from_seconds(time);
    time += 0.1;
    return source.twist_of({from_seconds(time), {}, {2.0, odometry_radps}}, since, events).yaw_rate_radps;
  }
};

TEST(YawRateSource, StepHasTheMeanOfTheRatesWithinIt) {
  Steps steps;
  steps.imu(0.0, 0.9);  // ends the step before
  steps.imu(0.02, 0.2);
  steps.imu(0.1, 0.3);
  steps.imu(0.12, 0.4);
  EXPECT_NEAR(steps.step(), 0.25, 1e-12);
  EXPECT_NEAR(steps.step(), 0.4, 1e-12);
  EXPECT_NEAR(steps.step(), 0.4, 1e-12) << "held";
  EXPECT_NEAR(steps.step(), 0.4, 1e-12) << "0.18 s before the step";
  EXPECT_NEAR(steps.step(), 0.1, 1e-12) << "0.28 s before it: the odometry's";
}

TEST(YawRateSource, OneThatIsNotWantedIsNotLookedAt) {
  Steps steps(false);
  steps.imu(0.05, 0.4);
  EXPECT_EQ(steps.step(), 0.1);
  EXPECT_TRUE(steps.events.empty());
}

TEST(YawRateSource, ChangesOfTheSourceAreTold) {
  Steps steps;
  for (int k = 0; k < 10; ++k) steps.step();
  EXPECT_TRUE(steps.events.empty()) << "there never was one";
  steps.imu(steps.time + 0.05, 0.3);
  steps.step();
  ASSERT_EQ(steps.events.size(), 1u);
  EXPECT_EQ(steps.events[0].level, PipelineEvent::Level::kInfo);
  for (int k = 0; k < 20; ++k) steps.step();  // held for two steps, silent for 1.8 s
  EXPECT_EQ(steps.events.size(), 1u);
  for (int k = 0; k < 50; ++k) steps.step();
  ASSERT_EQ(steps.events.size(), 2u);
  EXPECT_EQ(steps.events[1].level, PipelineEvent::Level::kWarn);
  EXPECT_NE(steps.events[1].text.find("silent for 2 s"), std::string::npos) << steps.events[1].text;
}

TEST(YawRateSource, ResetForgetsRatesAndWhatWasFound) {
  Steps steps;
  int contradictions = 0;
  for (int pass = 0; pass < 2; ++pass) {
    steps.events.clear();
    for (int k = 0; k < 1500; ++k) {
      steps.imu(steps.time + 0.05, -0.1);
      steps.step();
    }
    for (const PipelineEvent& event : steps.events) {
      contradictions += event.text.find("upside down") != std::string::npos;
    }
    EXPECT_EQ(contradictions, pass + 1) << "once until a reset";
    steps.source.reset();
    EXPECT_EQ(steps.step(), 0.1);
  }
}

TEST(YawRateSource, StepOfTheGyroscopeIsLeftOutWithADoubt) {
  Steps steps;
  steps.odometry_radps = 0.2;
  const auto turn = [&](int count, double imu_radps, double& doubt_rad2) {
    double used = 0.0;
    for (int k = 0; k < count; ++k) {
      steps.imu(steps.time + 0.05, imu_radps);
      used = steps.step();
      doubt_rad2 += steps.source.doubt_rad2();
    }
    return used;
  };
  double doubt_rad2 = 0.0;
  EXPECT_EQ(turn(50, 0.2, doubt_rad2), 0.2);
  EXPECT_EQ(doubt_rad2, 0.0);
  EXPECT_EQ(turn(20, 1.2, doubt_rad2), 0.2) << "the odometry's";
  EXPECT_NEAR(std::sqrt(doubt_rad2), 0.3 * 2.0, 1e-9) << "of 2 rad";
  EXPECT_NE(steps.source.complaint().find("IMU's yaw rate jumped"), std::string::npos);
  EXPECT_FALSE(steps.source.contradicts_wheels());
  EXPECT_EQ(turn(1, 0.3, doubt_rad2), 0.3) << "believed again";
  EXPECT_EQ(steps.source.complaint(), "");
}

TEST(YawRateSource, WhatWasTurnedByAnImuUpsideDownIsToldOnce) {
  Steps steps;
  int changes = 0;
  double rate = 0.0;
  for (int k = 0; k < 600; ++k) {
    steps.odometry_radps = 0.3 * std::sin(0.05 * k);
    steps.imu(steps.time + 0.05, -steps.odometry_radps);
    rate = steps.step();
    changes += steps.source.has_changed();
  }
  EXPECT_EQ(changes, 1);
  EXPECT_EQ(rate, steps.odometry_radps);
}

TEST(YawRateSource, AnImuThatComesAheadIsUsedOnceItsClockIsKnown) {
  for (const double lead_s : {3.0, 0.0}) {  // 0: only the odometry comes late
    Steps steps;
    const auto true_radps = [](double time_s) { return 0.3 * std::sin(0.4 * time_s) + 0.1 * std::sin(0.17 * time_s); };
    const double bias_radps = 0.01;
    for (double imu_s = 0.0; imu_s < 3.0; imu_s += 0.05) steps.imu(imu_s + lead_s, true_radps(imu_s) + bias_radps);
    int used_at = 0;
    for (int k = 1; k <= 600; ++k) {
      for (const double ago_s : {0.05, 0.0}) {
        const double imu_s = 3.0 + 0.1 * k - ago_s;
        steps.imu(imu_s + lead_s, true_radps(imu_s) + bias_radps);
      }
      steps.odometry_radps = true_radps(steps.time + 0.05);
      steps.source.set_comes_ahead(true);
      const double rate = steps.step();
      if (rate != steps.odometry_radps && used_at == 0) used_at = k;
      EXPECT_NEAR(rate, steps.odometry_radps, 0.03) << lead_s << ' ' << k;
    }
    EXPECT_GT(used_at, 200) << lead_s;
    EXPECT_LT(used_at, 500) << lead_s;
  }
}

TEST(YawRateSource, WheelsThatTurnAloneAreContradicted) {
  YawRateSource source({true}, 2.0);
  std::vector<PipelineEvent> events;
  for (int k = 1; k <= 60; ++k) {
    const Stamp since = from_seconds(0.1 * (k - 1));
    const Stamp stamp = from_seconds(0.1 * k);
    source.add(stamp, 0.2);
    const double wheels_radps = k <= 35 ? 0.2 : 2.2;
    EXPECT_EQ(source.twist_of({stamp, {}, {1.0, wheels_radps}}, since, events).yaw_rate_radps, 0.2) << k;
    EXPECT_EQ(source.contradicts_wheels(), k > 45) << k;
  }
  EXPECT_NE(source.complaint().find("one wheel"), std::string::npos) << source.complaint();
}

TEST(YawRateSource, RateIsFiniteAndOfARobotsSize) {
  EXPECT_TRUE(is_usable_yaw_rate(-49.0));
  for (const double bad :
       {51.0, -1e300, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    EXPECT_FALSE(is_usable_yaw_rate(bad)) << bad;
  }
}

}  // namespace
}  // namespace urban_gnss
