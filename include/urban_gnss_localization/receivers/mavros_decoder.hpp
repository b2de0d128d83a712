#pragma once

#include "urban_gnss_localization/receivers/receiver_decoder.hpp"

namespace urban_gnss {

/// A driver that publishes fixes and velocities ready for use, as mavros does of its autopilot's receiver
/// (global_position/raw). http://wiki.ros.org/mavros
class MavrosDecoder : public ReceiverDecoder {
 public:
  void add(ReceiverRole role, const MessageView& message, Stamp arrival) override;
};

}  // namespace urban_gnss
