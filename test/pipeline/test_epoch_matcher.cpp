#include <gtest/gtest.h>

#include "satellite_sky.hpp"
#include "urban_gnss_localization/pipeline/epoch_matcher.hpp"

namespace urban_gnss {
namespace {

/// One satellite, by whose number the epoch is told.
SatelliteEpoch epoch(double time, int mark) { return {from_seconds(time), {satellite(mark, 10.0, 45.0)}, 0.0}; }

/// The number; 0 where there are none.
int mark_of(const SatelliteEpoch* found) { return found != nullptr ? found->satellites.at(0).id.svid : 0; }
int taken(EpochMatcher& matcher, double time) { return mark_of(matcher.take(from_seconds(time))); }
bool awaits(const EpochMatcher& matcher, double time) { return matcher.awaits(from_seconds(time)); }

TEST(EpochMatcher, OwnSatellitesAreThoseWithinTenMilliseconds) {
  for (const auto& [offset_s, mark] : {std::pair{0.0, 7}, {0.01, 7}, {-0.01, 7}, {0.0101, 0}, {-0.0101, 0}}) {
    EpochMatcher matcher;
    matcher.add(epoch(100.0 + offset_s, 7));
    EXPECT_EQ(taken(matcher, 100.0), mark) << offset_s;
  }
}

TEST(EpochMatcher, OfSeveralTheNearestAndThenTheLastIsTheFixsOwn) {
  EpochMatcher matcher;
  matcher.add(epoch(100.000, 1));
  matcher.add(epoch(100.008, 2));
  EXPECT_EQ(taken(matcher, 100.001), 1);
  EXPECT_EQ(taken(matcher, 100.007), 2);
  matcher.add(epoch(100.000, 3));
  EXPECT_EQ(taken(matcher, 100.0), 3);
}

TEST(EpochMatcher, AwaitsThoseOfAFixWhoseForerunnerHadSome) {
  EpochMatcher matcher;
  EXPECT_FALSE(awaits(matcher, 100.0));
  matcher.add(epoch(99.0, 1));
  EXPECT_FALSE(awaits(matcher, 100.0)) << "they belonged to no fix";
  matcher.add(epoch(100.0, 2));
  EXPECT_EQ(taken(matcher, 100.0), 2);
  EXPECT_TRUE(awaits(matcher, 101.0));
  matcher.add(epoch(101.005, 3));
  EXPECT_FALSE(awaits(matcher, 101.0)) << "they are there";
  EXPECT_EQ(taken(matcher, 101.0), 3);
  EXPECT_EQ(taken(matcher, 102.0), 0);
  EXPECT_FALSE(awaits(matcher, 103.0)) << "the last fix had none";
  matcher.add(epoch(102.005, 4));
  EXPECT_TRUE(awaits(matcher, 103.0)) << "they came late, but came";
}

TEST(EpochMatcher, ReceiverThatTracksNothingHasAnEpochAllTheSame) {
  EpochMatcher matcher;
  matcher.add({from_seconds(100.0), {}, 0.0});
  ASSERT_NE(matcher.take(from_seconds(100.0)), nullptr);
  EXPECT_TRUE(awaits(matcher, 101.0));
}

TEST(EpochMatcher, NearestIsNoOlderThanItsLimit) {
  EpochMatcher matcher;
  const auto nearest = [&](double time, double max_age_s) {
    return mark_of(matcher.nearest(from_seconds(time), max_age_s));
  };
  EXPECT_EQ(nearest(100.0, 1e9), 0);
  matcher.add(epoch(100.0, 1));
  matcher.add(epoch(101.0, 2));
  EXPECT_EQ(nearest(100.4, 2.0), 1);
  EXPECT_EQ(nearest(100.6, 2.0), 2);
  EXPECT_EQ(nearest(103.0, 2.0), 2);
  EXPECT_EQ(nearest(103.1, 2.0), 0);
  EXPECT_EQ(nearest(98.0, 2.0), 1);
  EXPECT_EQ(nearest(97.9, 2.0), 0);
}

TEST(EpochMatcher, ManyAreForgottenAndAllByReset) {
  EpochMatcher matcher;
  matcher.add(epoch(0.0, 5));
  for (int k = 1; k <= 99; ++k) matcher.add(epoch(k, 6));
  EXPECT_EQ(taken(matcher, 0.0), 5);
  matcher.add(epoch(100.0, 6));
  EXPECT_EQ(taken(matcher, 0.0), 0);
  EXPECT_EQ(taken(matcher, 100.0), 6);
  matcher.reset();
  EXPECT_FALSE(awaits(matcher, 101.0));
  EXPECT_EQ(taken(matcher, 100.0), 0);
}

}  // namespace
}  // namespace urban_gnss
