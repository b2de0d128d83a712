#include <gtest/gtest.h>

#include <limits>

#include "urban_gnss_localization/gnss/position_hint.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kMax = std::numeric_limits<double>::max();

std::string hint(double latitude, double longitude) { return hint_of_no_place({latitude, longitude, 0.0}); }

TEST(PositionHint, ScaledDegreesAreNamedWithTheirScale) {
  EXPECT_EQ(hint(481374000.0, 115755000.0), "degrees times 1e7 of 48.1374, 11.5755?");
  EXPECT_EQ(hint(-338900000.0, 1512000000.0), "degrees times 1e7 of -33.89, 151.2?");
  EXPECT_NE(hint(-33890000.0, 151200000.0).find("degrees times 1e6 of -33.89, 151.2"), std::string::npos);
  EXPECT_EQ(hint(48137.4, 11575.5), "degrees times 1e3 of 48.1374, 11.5755?");
}

TEST(PositionHint, DegreesAndMinutesOfNmea) {
  EXPECT_EQ(hint(4807.038, 1131.0),
            "degrees times 1e3 of 4.807038, 1.131, or NMEA's degrees and minutes "
            "(ddmm.mmmm) of 48.1173, 11.5166667?");
  EXPECT_EQ(hint(-4807.038, -12331.0).find("NMEA's degrees and minutes (ddmm.mmmm) of -48.1173, -123.516667"),
            hint(-4807.038, -12331.0).rfind("NMEA"));
  EXPECT_EQ(hint(4861.0, 1131.0).find("NMEA"), std::string::npos) << "61 minutes";
}

TEST(PositionHint, SwappedAndTurnedLongitudes) {
  EXPECT_EQ(hint(130.84, 33.89), "latitude and longitude swapped, of 33.89, 130.84?");
  EXPECT_EQ(hint(-122.08, 37.4), "latitude and longitude swapped, of 37.4, -122.08?");
  EXPECT_EQ(hint(37.4, 237.92), "a longitude from 0 to 360, of 37.4, -122.08?");
}

TEST(PositionHint, NothingWhereNothingIsKnown) {
  EXPECT_EQ(hint(48.1, 11.6), "") << "a place";
  EXPECT_EQ(hint(kNaN, 11.6), "");
  EXPECT_EQ(hint(kMax, kMax), "");
  EXPECT_EQ(hint(-kMax, 11.0), "");
  EXPECT_EQ(hint(-270.0, 480.0), "");
}

TEST(PositionHint, AFarPlaceIsExplainedByTheDatum) {
  const LocalFrame sydney({-33.87, 151.21, 20.0});
  const auto far = [&](double latitude, double longitude) {
    return hint_of_far_place({latitude, longitude, 0.0}, sydney, 1e5);
  };
  EXPECT_EQ(far(33.87, 151.2), "the sign of the latitude (north is positive)?");
  EXPECT_EQ(far(-33.87, -151.2), "the sign of the longitude (east is positive)?");
  EXPECT_EQ(far(33.87, -151.2), "the signs of latitude and longitude?");
  EXPECT_EQ(far(-37.8, 144.96), "") << "Melbourne";
  const LocalFrame munich({48.1374, 11.5755, 520.0});
  EXPECT_EQ(hint_of_far_place({11.57, 48.13, 500.0}, munich, 1e5), "latitude and longitude swapped?");
}

TEST(PositionHint, Radians) {
  EXPECT_TRUE(looks_like_radians({0.8402, 0.2020, 520.0})) << "Munich";
  EXPECT_TRUE(looks_like_radians({0.8988, -0.0022, 20.0})) << "London";
  EXPECT_TRUE(looks_like_radians({-0.5911, 2.6391, 20.0})) << "Sydney";
  EXPECT_FALSE(looks_like_radians({48.1374, 11.5755, 520.0}));
  EXPECT_FALSE(looks_like_radians({0.3365, 6.7273, 0.0})) << "Sao Tome, the next land";
  EXPECT_FALSE(looks_like_radians({1e-4, -2e-4, 0.0})) << "a simulated world";
}

}  // namespace
}  // namespace urban_gnss
