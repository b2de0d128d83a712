#include "urban_gnss_localization/receivers/gps_common_decoder.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "urban_gnss_localization/receivers/gps_fix_reader.hpp"

namespace urban_gnss {
namespace {

constexpr double kAgreement_s = 2.0;
constexpr int kTrust = 10;  ///< agreements in a row after which `time` is believed again

bool is_same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

/// Puts satellites that are new or have changed into the list; whether there were any.
bool merge(const std::vector<SatelliteObservation>& more, std::vector<SatelliteObservation>& into) {
  bool has_changed = false;
  for (const SatelliteObservation& each : more) {
    const auto known = std::find_if(into.begin(), into.end(), [&](const auto& other) { return other.id == each.id; });
    if (known == into.end()) {
      into.push_back(each);
      has_changed = true;
    } else if (!is_same(known->cn0_dbhz, each.cn0_dbhz)) {
      *known = each;
      has_changed = true;
    }
  }
  return has_changed;
}

}  // namespace

void GpsCommonDecoder::add(ReceiverRole role, const MessageView& message, Stamp arrival) {
  if (role == ReceiverRole::kGpsFix) return add_fix(message, arrival);
  if (role != ReceiverRole::kGpsStatus || lists_satellites_) return;
  SatelliteEpoch epoch = gps_status_satellites_of(message, "", settings_.satellite_of);
  epoch.stamp = stamp_of(message, arrival);
  if (!epoch.satellites.empty()) statuses_.add_satellites(std::move(epoch));
  take_matched();
}

void GpsCommonDecoder::add_fix(const MessageView& message, Stamp arrival) {
  const Stamp stamp = stamp_of_fix(message, arrival);
  const double time = message.number_or("time", 0.0);
  const double key = std::isfinite(time) && time > 0.0 ? time : to_seconds(stamp);
  RawFix fix = gps_fix_of(message, stamp);
  const auto velocity = gps_fix_velocity_of(message, stamp);
  SatelliteEpoch satellites = gps_status_satellites_of(message, "status.", settings_.satellite_of);

  const bool is_new = !last_time_ || key != *last_time_;
  if (is_new) {
    last_time_ = key;
    last_stamp_ = stamp;
    if (fix.has_fix && velocity) output_.velocities.push_back(*velocity);
    output_.fixes.push_back(std::move(fix));
  }
  lists_satellites_ = lists_satellites_ || !satellites.satellites.empty();
  add_satellites(std::move(satellites), is_new);
  if (!is_new) return;
  statuses_.add_fix(stamp_of(message, arrival), stamp);  // a GPSStatus is stamped as the GPSFix is, and has no time
  take_matched();
  on_fix(stamp);
}

void GpsCommonDecoder::add_satellites(SatelliteEpoch epoch, bool is_new_fix) {
  if (is_new_fix) last_satellites_ = {last_stamp_, {}, epoch.angle_resolution_rad};
  if (merge(epoch.satellites, last_satellites_.satellites)) output_.satellites.push_back(last_satellites_);
}

Stamp GpsCommonDecoder::stamp_of_fix(const MessageView& message, Stamp arrival) {
  const Stamp header = stamp_of(message, arrival);
  const double time = message.number_or("time", 0.0);
  constexpr double kMaxTime_s = 4294967295.0;
  if (!settings_.time_is_utc || !(time > 0.0 && time < kMaxTime_s)) return header;
  const Stamp utc = from_seconds(time);
  if (std::abs(to_seconds(utc - header)) > kAgreement_s) {
    warn_once(message.definition().type() + ": time and header.stamp are " +
              std::to_string(std::llround(to_seconds(utc - header))) +
              " s apart; header.stamp is taken, the time of arrival");
    has_disagreed_ = true;
    agreements_ = 0;
    return header;
  }
  ++agreements_;
  return has_disagreed_ && agreements_ <= kTrust ? header : utc;
}

void GpsCommonDecoder::take_matched() {
  for (SatelliteEpoch& epoch : statuses_.take()) output_.satellites.push_back(std::move(epoch));
}

void GpsCommonDecoder::finish() {
  statuses_.finish();
  take_matched();
}

}  // namespace urban_gnss
