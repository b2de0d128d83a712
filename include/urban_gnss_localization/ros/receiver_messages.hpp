#pragma once

#include <geometry_msgs/TwistWithCovarianceStamped.h>
#include <ros/serialization.h>
#include <sensor_msgs/NavSatFix.h>
#include <urban_gnss_localization/SatelliteArray.h>

#include <cstdint>
#include <string>
#include <vector>

#include "urban_gnss_localization/receivers/receiver_input.hpp"

/// Between the messages of a receiver's driver, what it says, and the messages that localizers take.
namespace urban_gnss {

/// `frame`: the antenna's.
sensor_msgs::NavSatFix to_message(const RawFix& fix, const std::string& frame);
geometry_msgs::TwistWithCovarianceStamped to_message(const RawVelocity& velocity, const std::string& frame);
urban_gnss_localization::SatelliteArray to_message(const SatelliteEpoch& epoch, const std::string& frame);

SatelliteEpoch to_satellite_epoch(const urban_gnss_localization::SatelliteArray& message);

/// Gives a driver's message to a receiver's input. `Any` is topic_tools::ShapeShifter or rosbag::MessageInstance.
template <class Any>
void add_message(const Any& message, const std::string& name, const ReceiverTopic& topic, Stamp arrival,
                 ReceiverInput& input) {
  std::vector<std::uint8_t> bytes(message.size());
  ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  message.write(stream);
  const MessageConnection connection{name, message.getDataType(), message.getMD5Sum(), message.getMessageDefinition()};
  input.add(topic, connection, bytes.data(), bytes.size(), arrival);
}

}  // namespace urban_gnss
