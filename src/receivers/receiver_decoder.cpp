#include "urban_gnss_localization/receivers/receiver_decoder.hpp"

#include <utility>

namespace urban_gnss {

ReceiverOutput ReceiverDecoder::take() { return std::exchange(output_, {}); }

Stamp ReceiverDecoder::stamp_of(const MessageView& message, Stamp arrival) {
  const Stamp stamp = message.stamp("header.stamp");
  if (stamp != Stamp(0)) return stamp;
  warn_once(message.definition().type() + ": header.stamp is 0, the time of arrival is taken in its place");
  return arrival;
}

void ReceiverDecoder::warn_once(const std::string& warning) {
  if (said_.insert(warning).second) output_.warnings.push_back(warning);
}

}  // namespace urban_gnss
