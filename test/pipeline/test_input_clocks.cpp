#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "urban_gnss_localization/pipeline/input_clocks.hpp"

namespace urban_gnss {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

struct Clocks {
  std::vector<std::string> resets;
  std::vector<InputStream> restarts;
  std::vector<PipelineEvent> events;
  std::vector<double> used[5];  ///< times, by the stream
  InputClocks clocks;

  explicit Clocks(bool reset_on_time_jump = true)
      : clocks({2.0, 1.0, reset_on_time_jump}, {[this](const std::string& why) { resets.push_back(why); },
                                                [this](InputStream stream) { restarts.push_back(stream); }}) {}
  void add(InputStream stream, double time) {
    if (clocks.accept(
            stream, from_seconds(time), [this, stream, time] { add(stream, time); }, events)) {
      used[static_cast<std::size_t>(stream)].push_back(time);
    }
  }
  void odometry(double time) { add(InputStream::kOdometry, time); }
  /// Odometry at 10 Hz, fixes at 1 Hz and the IMU at 10 Hz.
  void run(double from, double to) {
    for (int k = static_cast<int>(std::lround(10.0 * from)); k <= std::lround(10.0 * to); ++k) {
      add(InputStream::kImu, 0.1 * k);
      odometry(0.1 * k);
      if (k % 10 == 0) add(InputStream::kFixes, 0.1 * k);
    }
  }
  const std::vector<double>& of(InputStream stream) const { return used[static_cast<std::size_t>(stream)]; }
};

constexpr InputStream kAll[] = {InputStream::kOdometry, InputStream::kFixes, InputStream::kImu};

TEST(InputClocks, StampsAscendInEachStreamByItself) {
  Clocks clocks;
  for (const double time : {10.0, 10.0, 9.0, 10.1}) clocks.odometry(time);
  clocks.add(InputStream::kFixes, 5.0);
  EXPECT_THAT(clocks.of(InputStream::kOdometry), ElementsAre(10.0, 10.1)) << "twice, and late";
  EXPECT_THAT(clocks.of(InputStream::kFixes), ElementsAre(5.0)) << "another stream";
  EXPECT_THAT(clocks.resets, IsEmpty());
}

TEST(InputClocks, OneOddStampIsNoClock) {
  for (const InputStream stream : kAll) {
    for (const double odd : {-1e6, -3.0, -1.5, 2.5, 30.0, 3600.0, 4e9}) {
      Clocks clocks;
      clocks.run(0.0, 20.0);
      clocks.add(stream, 20.0 + odd);
      clocks.run(20.1, 30.0);
      for (const InputStream each : kAll) {
        EXPECT_EQ(clocks.of(each).size(), each == InputStream::kFixes ? 31u : 301u) << to_string(stream) << odd;
        EXPECT_EQ(clocks.of(each).back(), 30.0);
      }
      EXPECT_THAT(clocks.resets, IsEmpty());
      EXPECT_THAT(clocks.restarts, IsEmpty());
      ASSERT_EQ(clocks.events.size(), 1u) << to_string(stream) << odd;
      EXPECT_THAT(clocks.events[0].text, HasSubstr(std::string(to_string(stream)) + " left out: header.stamp"));
      EXPECT_EQ(clocks.clocks.odd_count(), 1u);
    }
  }
}

TEST(InputClocks, OddOnesThatDoNotGoOnFromOneAnotherAreNoClockEither) {
  Clocks clocks;
  clocks.run(0.0, 20.0);
  for (const double odd : {5.0, 3.0, 12.0, 100.0, 1.0, 1.0, 50.0}) clocks.odometry(odd);
  clocks.run(20.1, 30.0);
  EXPECT_EQ(clocks.of(InputStream::kOdometry).size(), 301u);
  EXPECT_THAT(clocks.resets, IsEmpty());
}

TEST(InputClocks, OdometryThatGoesOnInThePastStartsAllAnewAndNothingIsLost) {
  Clocks clocks;
  clocks.run(100.0, 110.0);
  for (auto& each : clocks.used) each.clear();
  for (const double time : {95.0, 95.1}) clocks.odometry(time);
  EXPECT_THAT(clocks.of(InputStream::kOdometry), IsEmpty());
  clocks.odometry(95.2);
  ASSERT_EQ(clocks.resets.size(), 1u);
  EXPECT_THAT(clocks.resets[0], HasSubstr("the clock of the odometry jumped back by 14.8 s"));
  EXPECT_THAT(clocks.of(InputStream::kOdometry), ElementsAre(95.0, 95.1, 95.2));
  clocks.add(InputStream::kImu, 95.2);
  EXPECT_THAT(clocks.of(InputStream::kImu), ElementsAre(95.2)) << "no second reset";
  EXPECT_EQ(clocks.resets.size(), 1u);
}

TEST(InputClocks, TwoStreamsThatJumpTogetherStartAllAnew) {
  Clocks clocks;
  clocks.run(100.0, 110.0);
  for (auto& each : clocks.used) each.clear();
  clocks.add(InputStream::kFixes, 95.5);
  EXPECT_THAT(clocks.resets, IsEmpty());
  clocks.odometry(95.6);
  EXPECT_EQ(clocks.resets.size(), 1u);
  EXPECT_THAT(clocks.of(InputStream::kFixes), ElementsAre(95.5));
  EXPECT_THAT(clocks.of(InputStream::kOdometry), ElementsAre(95.6));
}

TEST(InputClocks, AnotherStreamAloneStartsItselfAnewAtMost) {
  Clocks clocks;
  clocks.run(0.0, 20.0);
  for (int k = 0; k < 50; ++k) {
    clocks.add(InputStream::kImu, 15.0 + 0.1 * k);
    clocks.odometry(20.1 + 0.1 * k);
  }
  EXPECT_THAT(clocks.resets, IsEmpty());
  EXPECT_THAT(clocks.restarts, ElementsAre(InputStream::kImu));
  EXPECT_EQ(clocks.of(InputStream::kImu).size(), 251u) << "those that showed it count";
  EXPECT_EQ(clocks.of(InputStream::kOdometry).size(), 251u);
}

TEST(InputClocks, AStreamMayPauseWithoutALoss) {
  Clocks clocks;
  clocks.run(0.0, 20.0);
  for (int k = 201; k < 800; ++k) clocks.odometry(0.1 * k);  // a tunnel
  clocks.run(80.0, 90.0);
  EXPECT_EQ(clocks.of(InputStream::kFixes).size(), 32u);
  EXPECT_EQ(clocks.of(InputStream::kImu).size(), 302u);
  clocks.run(300.0, 310.0);  // all together
  EXPECT_EQ(clocks.of(InputStream::kFixes).size(), 43u);
  EXPECT_EQ(clocks.of(InputStream::kOdometry).size(), 1002u);
  EXPECT_THAT(clocks.resets, IsEmpty());
}

TEST(InputClocks, JumpIsNotFollowedWhereThatIsNotWanted) {
  Clocks clocks(false);
  clocks.add(InputStream::kImu, 100.0);
  for (int k = 0; k < 10; ++k) clocks.add(InputStream::kImu, 50.0 + k);
  clocks.add(InputStream::kImu, 100.1);
  EXPECT_THAT(clocks.of(InputStream::kImu), ElementsAre(100.0, 100.1));
  EXPECT_THAT(clocks.resets, IsEmpty());
}

}  // namespace
}  // namespace urban_gnss
