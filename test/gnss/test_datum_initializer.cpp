#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/gnss/datum_initializer.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kMetre = 1.0 / 111195.0;  // of latitude, in degrees, near enough

RawFix fix_at(double seconds, double latitude, double longitude, double altitude) {
  RawFix raw;
  raw.stamp = from_seconds(seconds);
  raw.position = {latitude, longitude, altitude};
  return raw;
}

double distance(const GeodeticPosition& a, const GeodeticPosition& b) { return LocalFrame(a).to_local(b).norm(); }

std::vector<std::string> faults_of(const std::vector<double>& datum) {
  DatumParameters parameters;
  parameters.datum = datum;
  std::vector<std::string> faults;
  faults = faults_of(parameters);
  return faults;
}

TEST(DatumInitializer, IsTheMedianOfAgreeingFixes) {
  DatumInitializer initializer({});
  const double offsets[] = {3.0, -2.0, 0.0, 5.0, -4.0};
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(initializer.waiting_for(), std::to_string(i) + " of 5 agreeing fixes");
    EXPECT_FALSE(initializer.add(fix_at(i, 33.0 + offsets[i] * kMetre, 130.0 - offsets[i] * kMetre, 50.0 + i)));
  }
  const auto datum = initializer.add(fix_at(4.0, 33.0 + offsets[4] * kMetre, 130.0 - offsets[4] * kMetre, 54.0));
  ASSERT_TRUE(datum);
  EXPECT_LT(distance(*datum, {33.0, 130.0, 52.0}), 1e-3);
  EXPECT_EQ(initializer.waiting_for(), "");
}

TEST(DatumInitializer, OneOutlierDelaysTheDatumAndLeavesNoTrace) {
  DatumInitializer initializer({});
  for (int i = 0; i < 3; ++i) EXPECT_FALSE(initializer.add(fix_at(i, 33.0, 130.0, 50.0)));
  EXPECT_FALSE(initializer.add(fix_at(3.0, 33.0 + 1600.0 * kMetre, 130.0, 50.0)));
  EXPECT_EQ(initializer.waiting_for(), "3 of 5 agreeing fixes");
  for (int i = 4; i < 8; ++i) EXPECT_FALSE(initializer.add(fix_at(i, 33.0, 130.0, 50.0)));
  const auto datum = initializer.add(fix_at(8.0, 33.0, 130.0, 50.0));
  ASSERT_TRUE(datum);
  EXPECT_LT(distance(*datum, {33.0, 130.0, 50.0}), 1e-6);
}

TEST(DatumInitializer, SpreadBeyondTheLimitGivesNoDatum) {
  DatumParameters parameters;
  for (const double limit : {15.0, 40.0}) {
    parameters.datum_max_spread = limit;
    DatumInitializer initializer(parameters);
    bool found = false;
    for (int i = 0; i < 20; ++i) {
      found = found || initializer.add(fix_at(i, 33.0 + 30.0 * (i % 2) * kMetre, 130.0, 0.0)).has_value();
    }
    EXPECT_EQ(found, limit > 30.0) << limit;
  }
}

TEST(DatumInitializer, CountIsAParameter) {
  DatumParameters parameters;
  parameters.datum_fix_count = 1;
  EXPECT_TRUE(DatumInitializer(parameters).add(fix_at(0.0, 33.0, 130.0, 0.0)));
}

TEST(DatumInitializer, EvenCountTakesTheMeanOfTheTwoMiddleOnes) {
  DatumParameters parameters;
  parameters.datum_fix_count = 2;
  DatumInitializer initializer(parameters);
  initializer.add(fix_at(0.0, 33.0, 130.0, 40.0));
  const auto datum = initializer.add(fix_at(1.0, 33.0 + 10.0 * kMetre, 130.0, 44.0));
  ASSERT_TRUE(datum);
  EXPECT_LT(distance(*datum, {33.0 + 5.0 * kMetre, 130.0, 42.0}), 1e-3);
}

TEST(DatumInitializer, UnusableAndRepeatedFixesDoNotCount) {
  DatumInitializer initializer({});
  RawFix no_fix = fix_at(1.0, 33.0, 130.0, 0.0);
  no_fix.has_fix = false;
  initializer.add(no_fix);
  initializer.add(fix_at(2.0, kNaN, 130.0, 0.0));
  initializer.add(fix_at(3.0, 0.0, 0.0, 0.0));
  initializer.add(fix_at(4.0, 91.0, 130.0, 0.0));
  EXPECT_EQ(initializer.waiting_for(), "0 of 5 agreeing fixes");
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(initializer.add(fix_at(5.0, 33.0, 130.0, 0.0)));
  EXPECT_EQ(initializer.waiting_for(), "1 of 5 agreeing fixes");
}

TEST(DatumInitializer, AltitudesThatAreNotFiniteAreLeftOut) {
  DatumInitializer some({});
  DatumInitializer none({});
  std::optional<GeodeticPosition> some_datum, none_datum;
  for (int i = 0; i < 5; ++i) {
    some_datum = some.add(fix_at(i, 33.0, 130.0, i < 2 ? kNaN : 40.0 + i));
    none_datum = none.add(fix_at(i, 33.0, 130.0, i < 2 ? kNaN : HUGE_VAL));
  }
  ASSERT_TRUE(some_datum && none_datum);
  EXPECT_EQ(some_datum->altitude_m, 43.0);
  EXPECT_EQ(none_datum->altitude_m, 0.0);
}

TEST(DatumInitializer, WorksAcrossTheDateLineAndAtThePole) {
  DatumInitializer date_line({});
  DatumInitializer pole({});
  std::optional<GeodeticPosition> at_date_line, at_pole;
  const double longitudes[] = {179.99999, -179.99999, 180.0, -179.99998, 179.99998};
  for (int i = 0; i < 5; ++i) {
    at_date_line = date_line.add(fix_at(i, -16.8, longitudes[i], 0.0));
    at_pole = pole.add(fix_at(i, 90.0 - 5.0 * kMetre, -180.0 + 72.0 * i, 0.0));
  }
  ASSERT_TRUE(at_date_line && at_pole);
  EXPECT_LT(distance(*at_date_line, {-16.8, 180.0, 0.0}), 1e-3);
  EXPECT_LT(distance(*at_pole, {90.0, 0.0, 0.0}), 5.0);
}

TEST(DatumInitializer, FixesAllOverTheEarthDoNotAgreeAndDoNoHarm) {
  DatumInitializer initializer({});
  const double latitudes[] = {45.0, -45.0, 90.0, -90.0, 1e-9, 0.0};
  const double longitudes[] = {0.0, 180.0, 0.0, 77.0, -90.0, 90.0};
  for (int i = 0; i < 60; ++i) {
    EXPECT_FALSE(initializer.add(fix_at(i, latitudes[i % 6], longitudes[i % 6], i % 2 ? kNaN : 1e300)));
  }
}

TEST(DatumInitializer, ParameterWinsAtOnce) {
  DatumParameters parameters;
  parameters.datum = {33.5, 130.5, 12.0};
  DatumInitializer initializer(parameters);
  ASSERT_TRUE(initializer.fixed());
  EXPECT_EQ(initializer.fixed()->latitude_deg, 33.5);
  EXPECT_EQ(initializer.fixed()->longitude_deg, 130.5);
  EXPECT_EQ(initializer.fixed()->altitude_m, 12.0);
  EXPECT_EQ(initializer.waiting_for(), "");
  EXPECT_EQ(initializer.add(fix_at(0.0, 40.0, 10.0, 0.0))->latitude_deg, 33.5);
  initializer.reset();
  EXPECT_TRUE(initializer.fixed());
  EXPECT_FALSE(DatumInitializer({}).fixed());
}

TEST(DatumInitializer, ResetForgetsEveryFix) {
  DatumInitializer initializer({});
  for (int i = 0; i < 4; ++i) initializer.add(fix_at(i, 33.0, 130.0, 0.0));
  initializer.reset();
  EXPECT_EQ(initializer.waiting_for(), "0 of 5 agreeing fixes");
  EXPECT_FALSE(initializer.add(fix_at(0.0, 33.0, 130.0, 0.0)));
}

TEST(DatumInitializer, ParameterIsChecked) {
  EXPECT_TRUE(faults_of({}).empty());
  EXPECT_TRUE(faults_of({-90.0, 180.0, 0.0}).empty());
  EXPECT_EQ(faults_of({1.0, 2.0}).size(), 1u);
  EXPECT_EQ(faults_of({1.0, 2.0, 3.0, 4.0}).size(), 1u);
  EXPECT_EQ(faults_of({91.0, 181.0, kNaN}).size(), 4u);  // each number, and a list that is not finite
}

}  // namespace
}  // namespace urban_gnss
