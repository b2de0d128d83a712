#include <gtest/gtest.h>

#include "urban_gnss_localization/pipeline/bias_matcher.hpp"

namespace urban_gnss {
namespace {

BiasEstimate bias(double time, double radius_m) {
  BiasEstimate bias;
  bias.stamp = from_seconds(time);
  bias.radius_m = radius_m;
  return bias;
}

TEST(BiasMatcher, FixHasTheBiasOfItsOwnStamp) {
  BiasMatcher matcher({});
  matcher.add(bias(5000.0, 9.0));  // of before the clock was set back
  matcher.add(bias(1.0, 3.0));
  matcher.add(bias(2.0, 4.0));
  matcher.add(bias(2.0, 5.0));  // once more: the last one counts
  EXPECT_FALSE(matcher.take(from_seconds(1.5)));
  EXPECT_EQ(matcher.radius_m(), std::nullopt);
  EXPECT_EQ(matcher.take(from_seconds(1.0)).value().radius_m, 3.0);
  EXPECT_EQ(matcher.take(from_seconds(2.0)).value().radius_m, 5.0);
  EXPECT_EQ(matcher.radius_m(), 5.0);
  EXPECT_FALSE(matcher.take(from_seconds(3.0)));
  EXPECT_EQ(matcher.radius_m(), 5.0) << "the last one, where there is none";
  matcher.forget_radius();
  EXPECT_EQ(matcher.radius_m(), std::nullopt);
}

TEST(BiasMatcher, IsAwaitedForTheTimeoutAtMost) {
  BiasMatcherParameters parameters;
  parameters.bias_timeout = 0.3;
  BiasMatcher matcher(parameters);
  EXPECT_TRUE(matcher.awaits(from_seconds(1.0), 0.29));
  EXPECT_FALSE(matcher.awaits(from_seconds(1.0), 0.3));
  matcher.add(bias(1.0, 3.0));
  EXPECT_FALSE(matcher.awaits(from_seconds(1.0), 0.0));
  EXPECT_TRUE(matcher.awaits(from_seconds(2.0), 0.0));
  matcher.reset();
  EXPECT_TRUE(matcher.awaits(from_seconds(1.0), 0.29));
  EXPECT_FALSE(matcher.awaits(from_seconds(1.0), 0.3)) << "the parameters are kept";
}

}  // namespace
}  // namespace urban_gnss
