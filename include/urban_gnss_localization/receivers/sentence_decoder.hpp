#pragma once

#include "urban_gnss_localization/receivers/nmea_decoder.hpp"
#include "urban_gnss_localization/receivers/receiver_decoder.hpp"

namespace urban_gnss {

/// nmea_msgs/Sentence, as nmea_navsat_driver (nmea_topic_serial_reader) and ublox_gps publish them. The stamp of a
/// solution is the header's of its first sentence: the robot's clock, at arrival.
class SentenceDecoder : public ReceiverDecoder {
 public:
  void add(ReceiverRole role, const MessageView& message, Stamp arrival) override;
  void finish() override { decoder_.finish(); }
  ReceiverOutput take() override;

 private:
  NmeaDecoder decoder_;
};

}  // namespace urban_gnss
