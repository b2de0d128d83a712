#include <gtest/gtest.h>

#include "urban_gnss_localization/receivers/solution_matcher.hpp"

namespace urban_gnss {
namespace {

SatelliteEpoch epoch_at(double stamp_s) {
  SatelliteEpoch epoch;
  epoch.stamp = from_seconds(stamp_s);
  epoch.satellites.emplace_back();
  epoch.satellites.back().residual_m = 1.0;
  return epoch;
}

TEST(SolutionMatcher, ComparesTheStampsThatAreToldAndGivesTheFixes) {
  SolutionMatcher matcher;
  for (const double second : {10.0, 11.0, 12.0}) {
    matcher.add_fix(from_seconds(second + 0.3), from_seconds(second));  // arrival, and UTC
    matcher.add_satellites(epoch_at(second + 0.31));
    const auto given = matcher.take();
    ASSERT_EQ(given.size(), 1u) << "at once";
    EXPECT_EQ(given[0].stamp, from_seconds(second));
    EXPECT_EQ(given[0].satellites[0].residual_m, 1.0);
  }
}

}  // namespace
}  // namespace urban_gnss
