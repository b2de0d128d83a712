#pragma once

#include <rosbag/bag.h>

#include <string>

#include "receiver_recording.hpp"
#include "replay_settings.hpp"

namespace urban_gnss {

/// Decodes the messages of a receiver's driver (--receiver) in a bag. Without --receiver-ns their namespace is found by
/// the names and types of the topics. Throws std::runtime_error where there are none, and lists what the bag has; where
/// there are two receivers, it lists their namespaces.
ReceiverRecording decode_receiver(const rosbag::Bag& bag, const ReplayOptions& options);

/// The topics of fix, velocity and satellites, as messages of ROS and of this package, as a recording.
ReceiverRecording read_receiver_topics(const rosbag::Bag& bag, const ReplayOptions& options);

}  // namespace urban_gnss
