#include "urban_gnss_localization/receivers/novatel_decoder.hpp"

#include <cmath>
#include <utility>

#include "urban_gnss_localization/receivers/message_parts.hpp"
#include "urban_gnss_localization/receivers/satellite_numbers.hpp"

namespace urban_gnss {
namespace {

constexpr double kDirectionAge_s = 60.0;  ///< a satellite moves by half a degree
constexpr double kTrackstatSilence_s = 5.0;

/// By TRACKSTAT's table of range reject codes: 0, which the driver writes as text.
bool is_used(const MessageView& channel) {
  return channel.has_text("reject") ? channel.text("reject") == "GOOD" : channel.integer("reject") == 0;
}

}  // namespace

NovatelDecoder::NovatelDecoder() : GpsCommonDecoder({satellite_of_gpsd, false}) {}

void NovatelDecoder::add(ReceiverRole role, const MessageView& message, Stamp arrival) {
  switch (role) {
    case ReceiverRole::kTrackstat: return add_trackstat(message, stamp_of(message, arrival));
    case ReceiverRole::kGpgsv: return add_gpgsv(message, stamp_of(message, arrival));
    default: return GpsCommonDecoder::add(role, message, arrival);
  }
}

void NovatelDecoder::on_fix(Stamp stamp) {
  matcher_.add_fix(stamp);
  take_matched_satellites();
}

void NovatelDecoder::add_trackstat(const MessageView& message, Stamp stamp) {
  struct Channel {
    SatelliteObservation observation;
    bool is_used;
  };
  std::map<SatelliteId, Channel> satellites;
  for (const MessageView& channel : message.items("channels")) {
    const auto status = static_cast<std::uint32_t>(channel.integer("ch_tr_status"));
    const auto id = satellite_of_novatel(static_cast<int>(channel.integer("prn")), status);
    Channel read{{}, is_used(channel)};
    const double residual_m = channel.number("psr_res");
    read.observation.cn0_dbhz = cn0_or_unknown(channel.number("c_no"));
    if (!id) continue;
    read.observation.id = *id;
    read.observation.tracked = has_cn0(read.observation);
    if (read.is_used) read.observation.residual_m = residual_m;
    const auto [known, is_new] = satellites.try_emplace(*id, read);
    if (is_new || known->second.is_used) continue;
    const bool is_stronger = !(read.observation.cn0_dbhz <= known->second.observation.cn0_dbhz);
    if (read.is_used || is_stronger) known->second = read;
  }
  SatelliteEpoch epoch;
  epoch.stamp = stamp;
  epoch.angle_resolution_rad = whole_degrees_rad();
  for (auto& [id, channel] : satellites) {
    channel.observation.look = look_angles(SatelliteObservation::kUnknown, SatelliteObservation::kUnknown);
    const auto direction = directions_.find(id);
    if (direction != directions_.end() && std::abs(to_seconds(stamp - direction->second.stamp)) <= kDirectionAge_s) {
      channel.observation.look = direction->second.look;
    }
    epoch.satellites.push_back(channel.observation);
  }
  last_trackstat_ = stamp;
  if (epoch.satellites.empty()) return;
  matcher_.add_satellites(std::move(epoch));
  take_matched_satellites();
}

void NovatelDecoder::add_gpgsv(const MessageView& message, Stamp stamp) {
  if (message.integer("msg_number") == 1) {
    give_gpgsv();
    gpgsv_ = {stamp, {}, whole_degrees_rad()};
  }
  for (const MessageView& satellite : message.items("satellites")) {
    const auto id = satellite_of_gpsd(static_cast<int>(satellite.integer("prn")));
    SatelliteObservation observation;
    observation.look = look_angles(satellite.number("azimuth"), satellite.number("elevation"));
    observation.cn0_dbhz = cn0_or_unknown(satellite.number("snr"));
    if (!id) continue;
    observation.id = *id;
    observation.tracked = has_cn0(observation);
    directions_[*id] = {observation.look, stamp};
    gpgsv_.satellites.push_back(observation);
  }
  if (message.integer("msg_number") >= message.integer("n_msgs")) give_gpgsv();
}

void NovatelDecoder::give_gpgsv() {
  SatelliteEpoch epoch = std::exchange(gpgsv_, {});
  const bool trackstat_comes =
      last_trackstat_ && std::abs(to_seconds(epoch.stamp - *last_trackstat_)) < kTrackstatSilence_s;
  if (epoch.satellites.empty() || trackstat_comes) return;
  matcher_.add_satellites(std::move(epoch));
  take_matched_satellites();
}

void NovatelDecoder::take_matched_satellites() {
  for (SatelliteEpoch& epoch : matcher_.take()) output_.satellites.push_back(std::move(epoch));
}

void NovatelDecoder::finish() {
  give_gpgsv();
  matcher_.finish();
  take_matched_satellites();
  GpsCommonDecoder::finish();
}

}  // namespace urban_gnss
