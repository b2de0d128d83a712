#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "urban_gnss_localization/ros/map_services.hpp"

namespace urban_gnss {
namespace {

using namespace urban_gnss_localization;
using testing::HasSubstr;

const MapFrame kMap = LocalFrame({48.1374, 11.5755, 520.0});
const double kBad[] = {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e308, -1e308,
                       1e15};

TEST(MapServices, FromLLAndToLLAreInverse) {
  FromLL::Request from;
  from.latitude = 48.14;
  from.longitude = 11.58;
  from.altitude = 530.0;
  const FromLL::Response point = answer(from, kMap);
  ASSERT_TRUE(point.success) << point.message;
  ToLL::Request to;
  to.map_point = point.map_point;
  const ToLL::Response place = answer(to, kMap);
  ASSERT_TRUE(place.success) << place.message;
  EXPECT_NEAR(place.latitude, 48.14, 1e-9);
  EXPECT_NEAR(place.longitude, 11.58, 1e-9);
  EXPECT_NEAR(place.altitude, 530.0, 1e-6);
  EXPECT_FALSE(answer(from, std::nullopt).success);
}

TEST(MapServices, WhatIsNoPlaceIsRefusedByName) {
  for (const double bad : kBad) {
    for (double FromLL::Request::*const field :
         {&FromLL::Request::latitude, &FromLL::Request::longitude, &FromLL::Request::altitude}) {
      FromLL::Request request;
      request.latitude = 48.14;
      request.longitude = 11.58;
      request.*field = bad;
      const FromLL::Response response = answer(request, kMap);
      EXPECT_FALSE(response.success) << bad;
      EXPECT_THAT(response.message, HasSubstr("must be at least"));
      EXPECT_EQ(response.map_point.x, 0.0) << "nothing that is not finite goes out";
    }
    for (double geometry_msgs::Point::*const field :
         {&geometry_msgs::Point::x, &geometry_msgs::Point::y, &geometry_msgs::Point::z}) {
      ToLL::Request request;
      request.map_point.*field = bad;
      const ToLL::Response response = answer(request, kMap);
      EXPECT_FALSE(response.success) << bad;
      EXPECT_THAT(response.message, HasSubstr("map_point"));
      EXPECT_EQ(response.latitude, 0.0);
      ToLLArray::Request array;
      array.map_points = {geometry_msgs::Point(), request.map_point};
      const ToLLArray::Response none = answer(array, kMap);
      EXPECT_FALSE(none.success);
      EXPECT_THAT(none.message, HasSubstr("element 1: map_point"));
      EXPECT_TRUE(none.latitudes.empty());
    }
  }
  ToLL::Request high;
  high.map_point.z = 2e5;
  EXPECT_THAT(answer(high, kMap).message, HasSubstr("not near the ground: altitude"));
}

// A goal in another country is a mistake, and mostly one of these.
TEST(MapServices, APlaceThatIsFarFromTheDatumIsRefusedWithAHint) {
  const auto ask = [](double latitude, double longitude) {
    FromLL::Request request;
    request.latitude = latitude;
    request.longitude = longitude;
    return answer(request, kMap);
  };
  EXPECT_THAT(ask(11.5755, 48.1374).message, HasSubstr("km from the datum: must be within 1000 km; latitude and "
                                                       "longitude swapped?"));
  EXPECT_THAT(ask(-48.1374, 11.5755).message, HasSubstr("the sign of the latitude"));
  EXPECT_THAT(ask(22.3, 114.2).message, HasSubstr("must be within 1000 km"));
  EXPECT_FALSE(ask(22.3, 114.2).success);
  EXPECT_TRUE(ask(52.5, 13.4).success) << "500 km";
  FromLLArray::Request two;
  two.latitudes = {48.14, 11.5755};
  two.longitudes = {11.58, 48.1374};
  EXPECT_THAT(answer(two, kMap).message, HasSubstr("element 1: the place is"));
  EXPECT_TRUE(answer(two, kMap).map_points.empty());
}

}  // namespace
}  // namespace urban_gnss
