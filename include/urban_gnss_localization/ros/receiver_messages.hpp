#pragma once

#include <geometry_msgs/TwistWithCovarianceStamped.h>
#include <sensor_msgs/NavSatFix.h>
#include <urban_gnss_localization/SatelliteArray.h>

#include <string>

#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/gnss/satellite_epoch.hpp"

/// Between what a receiver says and the messages that localizers take.
namespace urban_gnss {

/// `frame`: the antenna's.
sensor_msgs::NavSatFix to_message(const RawFix& fix, const std::string& frame);
geometry_msgs::TwistWithCovarianceStamped to_message(const RawVelocity& velocity, const std::string& frame);
urban_gnss_localization::SatelliteArray to_message(const SatelliteEpoch& epoch, const std::string& frame);

SatelliteEpoch to_satellite_epoch(const urban_gnss_localization::SatelliteArray& message);

}  // namespace urban_gnss
