#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "urban_gnss_localization/ros/message_faults.hpp"
#include "urban_gnss_localization/ros/visibility_messages.hpp"

namespace urban_gnss {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kLargest = std::numeric_limits<double>::max();

sensor_msgs::NavSatFix fix() {
  sensor_msgs::NavSatFix message;
  message.latitude = 48.0;
  message.longitude = 11.0;
  message.altitude = 520.0;
  message.position_covariance = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 4.0};
  message.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_KNOWN;
  return message;
}

TEST(WeightedFix, KeepsTheAltitudeAndWidensItsVariance) {
  GnssCovariance covariance;
  covariance.weighted *= 9.0;
  const auto weighted = weighted_fix(fix(), covariance);
  EXPECT_EQ(weighted.altitude, 520.0);
  EXPECT_DOUBLE_EQ(weighted.position_covariance[8], 36.0);
}

TEST(WeightedFix, AnAltitudeThatIsNoneIsNan) {
  for (const double none : {kInfinity, -kInfinity, std::nan("")}) {
    sensor_msgs::NavSatFix message = fix();
    message.altitude = none;
    EXPECT_TRUE(std::isnan(weighted_fix(message, {}).altitude)) << none;
  }
}

TEST(WeightedFix, GoesOutWhateverTheVerticalVarianceIs) {
  GnssCovariance covariance;
  covariance.weighted *= 9.0;
  for (const double up : {kInfinity, std::nan(""), kLargest, 1e300, -1.0, 0.0}) {
    sensor_msgs::NavSatFix message = fix();
    message.position_covariance[8] = up;
    EXPECT_EQ(message_fault(weighted_fix(message, covariance)), "") << up;
  }
}

}  // namespace
}  // namespace urban_gnss
