#include <gtest/gtest.h>

#include "urban_gnss_localization/motion/standstill.hpp"

namespace urban_gnss {
namespace {

TEST(Standstill, IsOfTheWheelsWhateverTheGyroscopeDrifts) {
  EXPECT_TRUE(is_standstill({}));
  EXPECT_TRUE(is_standstill({-0.0009, 0.009}));
  EXPECT_TRUE(is_standstill({0.0009, -0.009}));
  EXPECT_FALSE(is_standstill({0.0, 0.011}));  // turns on the spot
  EXPECT_FALSE(is_standstill({-0.0011, 0.0}));
  EXPECT_FALSE(is_standstill({0.0, 0.009}, 1e-4));
}

TEST(Standstill, OfATravelIsThatOfItsMeanSpeed) {
  Travel travel;
  EXPECT_FALSE(travel.is_standstill()) << "nothing is known";
  travel.add({0.0, 0.5}, 1.0);
  EXPECT_TRUE(travel.is_standstill());
  travel.add({-0.2, 0.0}, 0.5);  // backwards
  EXPECT_NEAR(travel.distance_m, 0.1, 1e-12);
  EXPECT_NEAR(travel.duration_s, 1.5, 1e-12);
  EXPECT_FALSE(travel.is_standstill()) << "0.1 m in 1.5 s";
  travel.add({}, 1.0);
  EXPECT_TRUE(travel.is_standstill()) << "0.1 m in 2.5 s";
}

}  // namespace
}  // namespace urban_gnss
