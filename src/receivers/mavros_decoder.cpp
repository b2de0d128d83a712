#include "urban_gnss_localization/receivers/mavros_decoder.hpp"

#include "urban_gnss_localization/receivers/message_parts.hpp"

namespace urban_gnss {

void MavrosDecoder::add(ReceiverRole role, const MessageView& message, Stamp arrival) {
  if (role == ReceiverRole::kFix) output_.fixes.push_back(navsat_fix_of(message, stamp_of(message, arrival)));
  if (role == ReceiverRole::kVelocity) output_.velocities.push_back(velocity_of(message, stamp_of(message, arrival)));
}

}  // namespace urban_gnss
