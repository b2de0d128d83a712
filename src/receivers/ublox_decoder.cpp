#include "urban_gnss_localization/receivers/ublox_decoder.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "urban_gnss_localization/receivers/gps_time.hpp"
#include "urban_gnss_localization/receivers/message_parts.hpp"
#include "urban_gnss_localization/receivers/satellite_numbers.hpp"

namespace urban_gnss {
namespace {

constexpr std::size_t kMaxSolutions = 64;
constexpr std::size_t kMaxWaiting = 16;
constexpr int kPatience = 3;              ///< solutions for which satellites wait for their own
constexpr double kNavPvtSilence_s = 1.5;  ///< after which `fix` is taken again
constexpr double kSameSolution_s = 1e-3;
constexpr std::int64_t kStampTolerance_ms = 10;  ///< of a time of week that comes of a stamp
constexpr std::int64_t kMaxFar_ms = 60000;       ///< of satellites from the nearest solution

// NAV-PVT
constexpr std::int64_t kValidUtc = 7;              ///< of `valid`: date, time, fully resolved
constexpr std::int64_t kConfirmable = 32;          ///< of `flags2`
constexpr std::int64_t kFixOk = 1;                 ///< of `flags`
constexpr std::int64_t k2dFix = 2, kTimeOnly = 5;  ///< of `fixType`

bool holds(const std::deque<Stamp>& stamps, Stamp stamp) {
  return std::any_of(stamps.begin(), stamps.end(),
                     [&](Stamp each) { return std::abs(to_seconds(each - stamp)) <= kSameSolution_s; });
}

void remember(std::deque<Stamp>& stamps, Stamp stamp) {
  stamps.push_back(stamp);
  if (stamps.size() > kMaxSolutions) stamps.pop_front();
}

/// The driver's rule: the receiver's UTC where it is resolved, else the time at which the message came; also where the
/// UTC is none.
Stamp stamp_of_navpvt(const MessageView& message, Stamp arrival) {
  const bool is_resolved = (message.integer("valid") & kValidUtc) == kValidUtc;
  const bool is_confirmable = !message.has("flags2") || (message.integer("flags2") & kConfirmable) != 0;
  if (!is_resolved || !is_confirmable) return arrival;
  UtcTime time;
  time.year = static_cast<int>(message.integer("year"));
  time.month = static_cast<int>(message.integer("month"));
  time.day = static_cast<int>(message.integer("day"));
  time.hour = static_cast<int>(message.integer("hour"));
  time.minute = static_cast<int>(message.integer("min"));
  time.second = static_cast<int>(message.integer("sec"));
  time.nanosecond = message.integer("nano");
  return is_time(time) ? to_stamp(time) : arrival;
}

SatelliteObservation observation_of(const MessageView& satellite) {
  SatelliteObservation observation;
  observation.look = look_angles(satellite.number("azim"), satellite.number("elev"));
  observation.cn0_dbhz = cn0_or_unknown(satellite.number("cno"));
  return observation;
}

/// Whether code is locked, by u-blox's indicator of quality.
bool is_tracked(std::int64_t quality, const SatelliteObservation& satellite) {
  constexpr std::int64_t kCodeLocked = 4;
  return (quality & 7) >= kCodeLocked && has_cn0(satellite);
}

SatelliteEpoch epoch_of_navsat(const MessageView& message) {
  constexpr std::int64_t kUsed = 8;
  constexpr std::int64_t kUnknownSatellite = 255;
  constexpr double kResidualUnit_m = 0.1;
  SatelliteEpoch epoch;
  epoch.angle_resolution_rad = whole_degrees_rad();
  for (const MessageView& satellite : message.items("sv")) {
    SatelliteObservation observation = observation_of(satellite);
    const std::int64_t system = satellite.integer("gnssId");
    const std::int64_t number = satellite.integer("svId");
    const std::int64_t flags = satellite.integer("flags");
    const double residual_m = kResidualUnit_m * satellite.number("prRes");
    if (number == kUnknownSatellite || system > static_cast<std::int64_t>(Constellation::kNavic)) continue;
    observation.id = {static_cast<Constellation>(system), static_cast<int>(number)};
    observation.tracked = is_tracked(flags, observation);
    if (observation.tracked && (flags & kUsed) != 0) observation.residual_m = residual_m;
    epoch.satellites.push_back(observation);
  }
  return epoch;
}

SatelliteEpoch epoch_of_navsvinfo(const MessageView& message) {
  constexpr std::int64_t kUsed = 1;
  constexpr double kResidualUnit_m = 0.01;
  SatelliteEpoch epoch;
  epoch.angle_resolution_rad = whole_degrees_rad();
  for (const MessageView& satellite : message.items("sv")) {
    SatelliteObservation observation = observation_of(satellite);
    const auto id = satellite_of_ublox_svinfo(static_cast<int>(satellite.integer("svid")));
    const double residual_m = kResidualUnit_m * satellite.number("prRes");
    const std::int64_t quality = satellite.integer("quality");
    const bool is_used = (satellite.integer("flags") & kUsed) != 0;
    if (!id) continue;
    observation.id = *id;
    observation.tracked = is_tracked(quality, observation);
    if (observation.tracked && is_used) observation.residual_m = residual_m;
    epoch.satellites.push_back(observation);
  }
  return epoch;
}

}  // namespace

void UbloxDecoder::add(ReceiverRole role, const MessageView& message, Stamp arrival) {
  switch (role) {
    case ReceiverRole::kNavPvt: return add_navpvt(message, arrival);
    case ReceiverRole::kNavSat: return add_satellites(message.integer("iTOW"), epoch_of_navsat(message));
    case ReceiverRole::kNavSvinfo: return add_satellites(message.integer("iTOW"), epoch_of_navsvinfo(message));
    case ReceiverRole::kFix: return add_fix(message, arrival);
    case ReceiverRole::kVelocity: return add_velocity(message, arrival);
    default: return;
  }
}

void UbloxDecoder::add_navpvt(const MessageView& message, Stamp arrival) {
  const Stamp stamp = stamp_of_navpvt(message, arrival);
  const std::int64_t type = message.integer("fixType");
  RawFix fix;
  fix.stamp = stamp;
  fix.has_fix = (message.integer("flags") & kFixOk) != 0 && type >= k2dFix && type < kTimeOnly;
  fix.position = {1e-7 * message.number("lat"), 1e-7 * message.number("lon"), 1e-3 * message.number("height")};
  const double horizontal_m = 1e-3 * message.number("hAcc");
  const double vertical_m = 1e-3 * message.number("vAcc");
  fix.covariance.diagonal() << horizontal_m * horizontal_m, horizontal_m * horizontal_m, vertical_m * vertical_m;
  fix.covariance_type = CovarianceType::kDiagonalKnown;
  RawVelocity velocity;
  velocity.stamp = stamp;
  velocity.velocity = {1e-3 * message.number("velE"), 1e-3 * message.number("velN")};
  const double speed_sigma_mps = 1e-3 * message.number("sAcc");
  velocity.covariance = Eigen::Matrix2d::Identity() * speed_sigma_mps * speed_sigma_mps;
  const std::int64_t time_of_week_ms = message.integer("iTOW");

  last_navpvt_ = stamp;
  give_fix(fix);
  if (fix.has_fix) give_velocity(velocity);
  note({time_of_week_ms, stamp, 0, fix.has_fix});
}

void UbloxDecoder::add_fix(const MessageView& message, Stamp arrival) {
  const RawFix fix = navsat_fix_of(message, stamp_of(message, arrival));
  if (navpvt_comes(fix.stamp)) return;
  give_fix(fix);
  note({time_of_week_ms(fix.stamp), fix.stamp, kStampTolerance_ms, fix.has_fix});
}

void UbloxDecoder::add_velocity(const MessageView& message, Stamp arrival) {
  const RawVelocity velocity = velocity_of(message, stamp_of(message, arrival));
  if (!navpvt_comes(velocity.stamp)) give_velocity(velocity);
}

bool UbloxDecoder::navpvt_comes(Stamp stamp) const {
  return last_navpvt_ && std::abs(to_seconds(stamp - *last_navpvt_)) < kNavPvtSilence_s;
}

void UbloxDecoder::give_fix(const RawFix& fix) {
  if (holds(given_fixes_, fix.stamp)) return;
  remember(given_fixes_, fix.stamp);
  output_.fixes.push_back(fix);
}

void UbloxDecoder::give_velocity(const RawVelocity& velocity) {
  if (holds(given_velocities_, velocity.stamp)) return;
  remember(given_velocities_, velocity.stamp);
  output_.velocities.push_back(velocity);
}

void UbloxDecoder::add_satellites(std::int64_t time_of_week_ms, SatelliteEpoch epoch) {
  Waiting waiting{time_of_week_ms, std::move(epoch)};
  if (give_with_solution(waiting)) return;
  waiting_.push_back(std::move(waiting));
  if (waiting_.size() > kMaxWaiting) waiting_.pop_front();
}

void UbloxDecoder::note(const Solution& solution) {
  solutions_.push_back(solution);
  if (solutions_.size() > kMaxSolutions) solutions_.pop_front();
  std::deque<Waiting> still_waiting;
  for (Waiting& waiting : waiting_) {
    if (give_with_solution(waiting)) continue;
    if (++waiting.solutions_since < kPatience) {
      still_waiting.push_back(std::move(waiting));
    } else {
      give_without_solution(std::move(waiting));
    }
  }
  waiting_ = std::move(still_waiting);
}

bool UbloxDecoder::give_with_solution(const Waiting& waiting) {
  const auto own = std::find_if(solutions_.rbegin(), solutions_.rend(), [&](const Solution& solution) {
    const std::int64_t apart_ms = time_of_week_difference_ms(waiting.time_of_week_ms, solution.time_of_week_ms);
    return std::abs(apart_ms) <= solution.tolerance_ms;
  });
  if (own == solutions_.rend()) return false;
  SatelliteEpoch epoch = waiting.epoch;
  epoch.stamp = own->stamp;
  if (!own->has_fix) {
    for (SatelliteObservation& satellite : epoch.satellites) satellite.residual_m = SatelliteObservation::kUnknown;
  }
  output_.satellites.push_back(std::move(epoch));
  return true;
}

void UbloxDecoder::give_without_solution(Waiting waiting) {
  const auto apart_ms = [&](const Solution& solution) {
    return time_of_week_difference_ms(waiting.time_of_week_ms, solution.time_of_week_ms);
  };
  const auto nearest = std::min_element(
      solutions_.begin(), solutions_.end(),
      [&](const Solution& a, const Solution& b) { return std::abs(apart_ms(a)) < std::abs(apart_ms(b)); });
  if (nearest == solutions_.end() || std::abs(apart_ms(*nearest)) > kMaxFar_ms) {
    warn_once("satellites left out: their time of week (iTOW) is not near that of any fix; are the fixes' stamps UTC?");
    return;
  }
  warn_once("satellites without a fix of the same time of week (iTOW): their residuals are left out");
  waiting.epoch.stamp = nearest->stamp + std::chrono::milliseconds(apart_ms(*nearest));
  for (SatelliteObservation& each : waiting.epoch.satellites) each.residual_m = SatelliteObservation::kUnknown;
  output_.satellites.push_back(std::move(waiting.epoch));
}

void UbloxDecoder::finish() {
  for (Waiting& waiting : std::exchange(waiting_, {})) give_without_solution(std::move(waiting));
}

}  // namespace urban_gnss
