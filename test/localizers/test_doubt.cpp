#include <gtest/gtest.h>

#include "matchers.hpp"
#include "urban_gnss_localization/localizers/registry.hpp"

namespace urban_gnss {
namespace {

// Where sources contradict each other, each localizer becomes as uncertain as it is told to be, and stays where it is.
TEST(Localizers, DoubtMakesEachOneUncertain) {
  const LocalizerRegistry registry = standard_localizers();
  for (const LocalizerEntry& entry : registry.entries()) {
    const auto localizer = entry.settings()->make();
    localizer->initialize(pose_with_sigma({3.0, -4.0, 0.5}, 1.0, 0.05));
    for (int k = 0; k < 10; ++k) localizer->move({1.0, 0.1}, 0.1);
    const PoseEstimate before = localizer->estimate();
    localizer->doubt({16.0, 0.04});
    const PoseEstimate after = localizer->estimate();
    EXPECT_TRUE(near(after.pose, before.pose, 1e-9)) << entry.name;
    for (int axis = 0; axis < 2; ++axis) {
      EXPECT_NEAR(after.covariance(axis, axis), before.covariance(axis, axis) + 16.0, 2.5) << entry.name;
    }
    EXPECT_NEAR(after.covariance(2, 2), before.covariance(2, 2) + 0.04, 0.008) << entry.name;
  }
}

}  // namespace
}  // namespace urban_gnss
