#pragma once

#include <optional>
#include <set>
#include <string>

#include "urban_gnss_localization/receivers/message_view.hpp"
#include "urban_gnss_localization/receivers/receiver_output.hpp"

namespace urban_gnss {

/// What a message is to a decoder, whatever its topic is called.
enum class ReceiverRole {
  kFix,        ///< sensor_msgs/NavSatFix
  kVelocity,   ///< geometry_msgs/TwistWithCovarianceStamped or TwistStamped, east and north
  kNavPvt,     ///< ublox_msgs/NavPVT, NavPVT7
  kNavSat,     ///< ublox_msgs/NavSAT
  kNavSvinfo,  ///< ublox_msgs/NavSVINFO
  kGpsFix,     ///< gps_common/GPSFix
  kGpsStatus,  ///< gps_common/GPSStatus
  kTrackstat,  ///< novatel_gps_msgs/Trackstat
  kGpgsv,      ///< novatel_gps_msgs/Gpgsv
  kSentence,   ///< nmea_msgs/Sentence
};

/// Turns the messages of one receiver's driver into fixes, velocities and satellites. What it gives depends on the
/// messages and the order in which they come, and on no clock.
class ReceiverDecoder {
 public:
  virtual ~ReceiverDecoder() = default;

  /// `arrival`: when it was received or recorded, by the robot's clock; taken where a message has no stamp of its own.
  /// Throws MessageError where a field that is needed is missing; the message is then left out.
  virtual void add(ReceiverRole role, const MessageView& message, Stamp arrival) = 0;
  /// Nothing more comes: what waits for more is given as it is.
  virtual void finish() {}
  /// What was found since it was asked last.
  virtual ReceiverOutput take();

 protected:
  /// The header's stamp; of a message without one the arrival, with a warning.
  Stamp stamp_of(const MessageView& message, Stamp arrival);
  void warn_once(const std::string& warning);

  ReceiverOutput output_;

 private:
  std::set<std::string> said_;
};

}  // namespace urban_gnss
