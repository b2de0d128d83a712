#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "urban_gnss_localization/evaluation/error_history.hpp"

namespace urban_gnss {
namespace {

TimedPose at(double seconds, double x, double y = 0.0) { return {from_seconds(seconds), {x, y, 0.0}}; }

ErrorHistory history() { return ErrorHistory(2, std::chrono::seconds(60), std::chrono::milliseconds(100)); }

TEST(ErrorHistory, ErrorsAreThoseAtTheTruthsStamps) {
  ErrorHistory errors = history();
  for (int k = 0; k < 100; ++k) {
    errors.add_truth(at(0.2 * k, 0.4 * k));
    errors.add_estimate(0, at(0.2 * k + 0.1, 0.4 * k + 0.2, 3.0));  // between the truth's stamps, 3 m aside
    errors.add_estimate(1, at(0.2 * k, 0.4 * k + 4.0, 3.0));
  }
  EXPECT_EQ(errors.errors(1).samples.size(), 100u);
  EXPECT_EQ(errors.errors(0).samples.size(), 99u);  // the first stamp is before the first estimate
  for (const ErrorSample& each : errors.errors(0).samples) EXPECT_NEAR(each.position_error_m, 3.0, 1e-12);
  EXPECT_NEAR(errors.errors(1).summary.position_m.rmse, 5.0, 1e-12);
}

TEST(ErrorHistory, KeepsTheWindowAndTheInterval) {
  ErrorHistory errors = history();
  for (int k = 0; k <= 20000; ++k) {  // 200 s at 100 Hz
    errors.add_truth(at(0.01 * k, 0.0));
    errors.add_estimate(0, at(0.01 * k, 1.0));
  }
  const auto samples = errors.errors(0).samples;
  EXPECT_EQ(samples.back().stamp, from_seconds(200.0));
  EXPECT_GE(samples.size(), 600u);  // 60 s at 10 Hz, and up to an eighth more
  EXPECT_LE(samples.size(), 690u);
}

TEST(ErrorHistory, AClockThatIsSetBackStartsAnew) {
  ErrorHistory errors = history();
  for (int k = 0; k < 100; ++k) errors.add_truth(at(100.0 + 0.1 * k, 0.0));
  errors.add_estimate(0, at(105.0, 7.0));
  errors.add_truth(at(10.0, 0.0));
  EXPECT_EQ(errors.latest(), from_seconds(10.0));
  for (int k = 0; k < 20; ++k) {
    errors.add_truth(at(10.0 + 0.1 * k, 0.0));
    errors.add_estimate(0, at(10.0 + 0.1 * k, 1.0));
  }
  EXPECT_EQ(errors.errors(0).samples.size(), 20u);
  EXPECT_NEAR(errors.errors(0).summary.position_m.max, 1.0, 1e-12);
}

TEST(ErrorHistory, LeavesOutWhatIsNotFiniteLateOrTwice) {
  ErrorHistory errors = history();
  EXPECT_FALSE(errors.has_truth());
  EXPECT_FALSE(errors.latest());
  EXPECT_TRUE(errors.errors(0).samples.empty());
  errors.add_truth(at(1.0, std::numeric_limits<double>::quiet_NaN()));
  EXPECT_FALSE(errors.has_truth());
  for (const double stamp : {1.0, 2.0, 2.0, 1.5, 3.0}) errors.add_truth(at(stamp, 0.0));
  for (const double stamp : {1.0, 1.5, 2.0, 2.5, 3.0}) errors.add_estimate(1, at(stamp, 2.0));
  EXPECT_EQ(errors.errors(1).samples.size(), 3u);
  EXPECT_TRUE(errors.errors(0).samples.empty());
}

}  // namespace
}  // namespace urban_gnss
