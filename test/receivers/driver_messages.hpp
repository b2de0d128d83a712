#pragma once

#include <string>
#include <utility>
#include <vector>

#include "message_bytes.hpp"
#include "urban_gnss_localization/receivers/receiver_input.hpp"

/// Small stand-ins of drivers' messages: the same names and types of the fields that decoders read.
namespace urban_gnss::driver {

inline const std::string kBetween =
    "\n================================================================================\n";

struct Connection {
  std::string type, definition;
};

inline const Connection kNavPvt = {"ublox_msgs/NavPVT",
                                   "uint8 CLASS_ID = 1\nuint32 iTOW\nuint16 year\nuint8 month\nuint8 day\nuint8 hour\n"
                                   "uint8 min\nuint8 sec\nuint8 valid\nuint32 tAcc\nint32 nano\nuint8 fixType\n"
                                   "uint8 flags\nuint8 flags2\nuint8 numSV\nint32 lon\nint32 lat\nint32 height\n"
                                   "int32 hMSL\nuint32 hAcc\nuint32 vAcc\nint32 velN\nint32 velE\nint32 velD\n"
                                   "int32 gSpeed\nint32 heading\nuint32 sAcc\n"};
inline const Connection kNavSat = {
    "ublox_msgs/NavSAT", "uint32 iTOW\nuint8 version\nuint8 numSvs\nuint8[2] reserved0\nNavSAT_SV[] sv\n" + kBetween +
                             "MSG: ublox_msgs/NavSAT_SV\nuint8 gnssId\nuint8 svId\nuint8 cno\nint8 elev\n"
                             "int16 azim\nint16 prRes\nuint32 flags\n"};
inline const Connection kNavSvinfo = {"ublox_msgs/NavSVINFO",
                                      "uint32 iTOW\nuint8 numCh\nuint8 globalFlags\nuint16 reserved2\n"
                                      "NavSVINFO_SV[] sv\n" +
                                          kBetween +
                                          "MSG: ublox_msgs/NavSVINFO_SV\nuint8 chn\nuint8 svid\nuint8 flags\n"
                                          "uint8 quality\nuint8 cno\nint8 elev\nint16 azim\nint32 prRes\n"};
inline const Connection kNavSatFix = {
    "sensor_msgs/NavSatFix",
    "Header header\nNavSatStatus status\nfloat64 latitude\nfloat64 longitude\nfloat64 altitude\n"
    "float64[9] position_covariance\nuint8 position_covariance_type\n" +
        kHeaderDefinition + kBetween + "MSG: sensor_msgs/NavSatStatus\nint8 status\nuint16 service\n"};
inline const Connection kTwist = {"geometry_msgs/TwistStamped",
                                  "Header header\nTwist twist\n" + kHeaderDefinition + kBetween +
                                      "MSG: geometry_msgs/Twist\nVector3 linear\nVector3 angular\n" + kBetween +
                                      "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"};
inline const std::string kGpsStatusFields =
    "Header header\nuint16 satellites_used\nint32[] satellite_used_prn\nuint16 satellites_visible\n"
    "int32[] satellite_visible_prn\nint32[] satellite_visible_z\nint32[] satellite_visible_azimuth\n"
    "int32[] satellite_visible_snr\nint16 status\nuint16 motion_source\n";
inline const Connection kGpsStatus = {"gps_common/GPSStatus", kGpsStatusFields + kHeaderDefinition};
inline const Connection kGpsFix = {
    "gps_common/GPSFix",
    "Header header\nGPSStatus status\nfloat64 latitude\nfloat64 longitude\nfloat64 altitude\nfloat64 track\n"
    "float64 speed\nfloat64 climb\nfloat64 time\nfloat64 err\nfloat64 err_horz\nfloat64 err_vert\nfloat64 err_track\n"
    "float64 err_speed\nfloat64[9] position_covariance\nuint8 position_covariance_type\n" +
        kHeaderDefinition + kBetween + "MSG: gps_common/GPSStatus\n" + kGpsStatusFields};
inline const Connection kTrackstat = {
    "novatel_gps_msgs/Trackstat",
    "Header header\nstring solution_status\nstring position_type\nfloat32 cutoff\nTrackstatChannel[] channels\n" +
        kHeaderDefinition + kBetween +
        "MSG: novatel_gps_msgs/TrackstatChannel\nint16 prn\nint16 glofreq\nuint32 ch_tr_status\nfloat64 psr\n"
        "float32 doppler\nfloat32 c_no\nfloat32 locktime\nfloat32 psr_res\nstring reject\nfloat32 psr_weight\n"};
inline const Connection kGpgsv = {
    "novatel_gps_msgs/Gpgsv",
    "Header header\nstring message_id\nuint8 n_msgs\nuint8 msg_number\nuint8 n_satellites\nSatellite[] satellites\n" +
        kHeaderDefinition + kBetween +
        "MSG: novatel_gps_msgs/Satellite\nuint8 prn\nuint8 elevation\nuint16 azimuth\nint8 snr\n"};
inline const Connection kSentence = {"nmea_msgs/Sentence", "Header header\nstring sentence\n" + kHeaderDefinition};

/// 2018-03-29 17:23:27 UTC and its time of week, as in a real recording.
constexpr std::uint32_t kSecond = 1522344207;
constexpr std::uint32_t kTimeOfWeek_ms = 408225000;

/// Messages into the decoder of a preset.
class Feed {
 public:
  explicit Feed(const std::string& preset) : preset_(find_receiver_preset(preset)), input_(preset_) {}

  void add(ReceiverRole role, const Connection& connection, const MessageBytes& message,
           Stamp arrival = Stamp(kSecond * 1000000000LL)) {
    for (const ReceiverTopic& topic : preset_.topics) {
      if (topic.role != role) continue;
      const MessageConnection full{topic.name, connection.type, "md5of" + connection.type, connection.definition};
      input_.add(topic, full, message.bytes().data(), message.bytes().size(), arrival);
    }
    collect();
  }
  void finish() {
    input_.finish();
    collect();
  }
  const ReceiverOutput& output() const { return output_; }
  const ReceiverCounts& counts() const { return input_.counts(); }
  const ReceiverInput& input() const { return input_; }

 private:
  void collect() {
    ReceiverOutput more = input_.take();
    const auto append = [](auto& to, auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    append(output_.fixes, more.fixes);
    append(output_.velocities, more.velocities);
    append(output_.satellites, more.satellites);
    append(output_.warnings, more.warnings);
  }

  const ReceiverPreset& preset_;
  ReceiverInput input_;
  ReceiverOutput output_;
};

}  // namespace urban_gnss::driver
