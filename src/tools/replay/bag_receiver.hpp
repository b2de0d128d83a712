#pragma once

#include <map>
#include <string>
#include <vector>

#include "files/bag_reader.hpp"
#include "receiver_recording.hpp"
#include "replay_settings.hpp"
#include "urban_gnss_localization/receivers/receiver_input.hpp"
#include "urban_gnss_localization/receivers/receiver_presets.hpp"

namespace urban_gnss {

/// Decodes the messages of a receiver's driver (--receiver) in a bag, one after the other.
class BagReceiver {
 public:
  /// Without --receiver-ns the namespace of the driver is found by the names and types of the topics. Throws
  /// std::runtime_error where there is none, and lists what the bag has; where there are two receivers, it lists their
  /// namespaces.
  BagReceiver(const BagReader& bag, const ReplayOptions& options);

  /// Its topics, without leading slashes, in the order in which messages of one time are decoded.
  const std::vector<std::string>& names() const { return names_; }
  bool decodes(const std::string& name) const { return topics_.count(name) > 0; }
  /// "ublox: ublox_gps/navpvt …".
  const std::string& source() const { return source_; }
  /// What the receiver has said with this message; with the last, all that is left.
  ReceiverOutput add(const BagMessage& message);

  /// That its messages name so far; empty: none.
  const std::string& antenna_frame() const { return input_.frame_id(); }
  ReceiverCounts counts() const { return input_.counts(); }
  /// Messages that were left out.
  std::size_t unreadable() const;

 private:
  std::map<std::string, const ReceiverTopic*> topics_;  ///< by their names
  std::vector<std::string> names_;
  std::string source_;
  ReceiverInput input_;
  std::size_t left_{0};
};

/// All of it at once.
ReceiverRecording decode_receiver(const BagReader& bag, const ReplayOptions& options);

/// The topics of fix, velocity and satellites, as messages of ROS and of this package, as a recording.
ReceiverRecording read_receiver_topics(const BagReader& bag, const ReplayOptions& options);

}  // namespace urban_gnss
