#include "urban_gnss_localization/receivers/receiver_presets.hpp"

#include <algorithm>
#include <stdexcept>

#include "urban_gnss_localization/receivers/gps_common_decoder.hpp"
#include "urban_gnss_localization/receivers/mavros_decoder.hpp"
#include "urban_gnss_localization/receivers/novatel_decoder.hpp"
#include "urban_gnss_localization/receivers/satellite_numbers.hpp"
#include "urban_gnss_localization/receivers/sentence_decoder.hpp"
#include "urban_gnss_localization/receivers/ublox_decoder.hpp"

namespace urban_gnss {
namespace {

using Role = ReceiverRole;

constexpr char kFixType[] = "sensor_msgs/NavSatFix";
constexpr char kVelocityTypes[] = "geometry_msgs/TwistWithCovarianceStamped, geometry_msgs/TwistStamped";
constexpr char kGpsFixTypes[] = "gps_common/GPSFix, gps_msgs/GPSFix";

template <class Decoder>
std::unique_ptr<ReceiverDecoder> make() {
  return std::make_unique<Decoder>();
}
std::unique_ptr<ReceiverDecoder> make_gpsd() {
  return std::make_unique<GpsCommonDecoder>(GpsCommonSettings{satellite_of_gpsd, true});
}
std::unique_ptr<ReceiverDecoder> make_septentrio() {
  return std::make_unique<GpsCommonDecoder>(GpsCommonSettings{satellite_of_septentrio, false});
}

}  // namespace

const std::vector<ReceiverPreset>& receiver_presets() {
  static const std::vector<ReceiverPreset> presets = {
      {"ublox",
       "ublox_gps",
       "ublox_gps",
       {{"navpvt", "ublox_msgs/NavPVT, ublox_msgs/NavPVT7", Role::kNavPvt, "fix, velocity, both with covariance, UTC"},
        {"navsat", "ublox_msgs/NavSAT", Role::kNavSat, "satellites with residuals"},
        {"navsvinfo", "ublox_msgs/NavSVINFO", Role::kNavSvinfo, "the same of firmware 6 and 7"},
        {"fix", kFixType, Role::kFix, "fix, while no navpvt comes"},
        {"fix_velocity", kVelocityTypes, Role::kVelocity, "velocity, while no navpvt comes"}},
       make<UbloxDecoder>},
      {"gpsd",
       "gpsd_client",
       "",
       {{"extended_fix", kGpsFixTypes, Role::kGpsFix, "fix with covariance, velocity, satellites"},
        {"status", "gps_common/GPSStatus, gps_msgs/GPSStatus", Role::kGpsStatus, "satellites, where the fix has none"}},
       make_gpsd},
      {"nmea",
       "nmea_navsat_driver and others",
       "",
       {{"nmea_sentence", "nmea_msgs/Sentence", Role::kSentence,
         "fix, velocity, satellites, residuals, as sentences have them"}},
       make<SentenceDecoder>},
      {"septentrio",
       "septentrio_gnss_driver",
       "septentrio_gnss",
       {{"gpsfix", kGpsFixTypes, Role::kGpsFix, "fix with covariance, velocity, satellites"}},
       make_septentrio},
      {"novatel",
       "novatel_gps_driver",
       "",
       {{"gps", kGpsFixTypes, Role::kGpsFix, "fix with covariance, velocity"},
        {"trackstat", "novatel_gps_msgs/Trackstat, novatel_msgs/Trackstat", Role::kTrackstat,
         "residuals, reject codes, C/N0"},
        {"gpgsv", "novatel_gps_msgs/Gpgsv, novatel_msgs/Gpgsv", Role::kGpgsv, "azimuth, elevation"}},
       make<NovatelDecoder>},
      {"mavros",
       "mavros",
       "mavros",
       {{"global_position/raw/fix", kFixType, Role::kFix, "fix"},
        {"global_position/raw/gps_vel", kVelocityTypes, Role::kVelocity, "velocity"}},
       make<MavrosDecoder>},
      {"navsatfix",
       "any other",
       "gps",
       {{"fix", kFixType, Role::kFix, "fix"}, {"velocity", kVelocityTypes, Role::kVelocity, "velocity"}},
       nullptr},
  };
  return presets;
}

std::string receiver_preset_names() {
  std::string names;
  for (const ReceiverPreset& preset : receiver_presets()) names += (names.empty() ? "" : ", ") + preset.name;
  return names;
}

const ReceiverPreset& find_receiver_preset(const std::string& name) {
  for (const ReceiverPreset& preset : receiver_presets()) {
    if (preset.name == name) return preset;
  }
  throw std::invalid_argument("\"" + name + "\" is no receiver; there are " + receiver_preset_names());
}

bool is_type_of(const ReceiverTopic& topic, const std::string& type) {
  const auto own_name = [](const std::string& full) { return full.substr(full.rfind('/') + 1); };
  const std::string types = topic.types;
  for (std::size_t begin = 0; begin < types.size();) {
    const std::size_t end = std::min(types.find(", ", begin), types.size());
    if (own_name(types.substr(begin, end - begin)) == own_name(type)) return true;
    begin = end + 2;
  }
  return false;
}

std::string full_name(const std::string& ns, const ReceiverTopic& topic) {
  if (ns.empty()) return topic.name;
  return ns.back() == '/' ? ns + topic.name : ns + "/" + topic.name;
}

std::optional<std::string> namespace_of(const std::string& full, const ReceiverTopic& topic) {
  if (full == topic.name) return "/";
  const std::string end = std::string("/") + topic.name;
  if (full.size() <= end.size() || full.compare(full.size() - end.size(), end.size(), end) != 0) return std::nullopt;
  return full.substr(0, full.size() - end.size());
}

std::string why_not_a_receiver(const std::string& topic) {
  for (const std::string fused : {"global_position/global", "global_position/local"}) {
    const bool is_it = topic.size() >= fused.size() && topic.substr(topic.size() - fused.size()) == fused;
    if (is_it) return topic + " is the autopilot's estimate, already fused; take global_position/raw/fix";
  }
  return {};
}

std::string describe_receiver_presets() {
  std::string text;
  for (const ReceiverPreset& preset : receiver_presets()) {
    for (const ReceiverTopic& topic : preset.topics) {
      text += preset.name + '\t' + preset.driver + '\t' + full_name(preset.ns, topic) + '\t' + topic.types + '\t' +
              topic.use + '\n';
    }
  }
  return text;
}

}  // namespace urban_gnss
