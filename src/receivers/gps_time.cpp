#include "urban_gnss_localization/receivers/gps_time.hpp"

#include <cmath>

namespace urban_gnss {
namespace {

constexpr std::int64_t kSecond_ns = 1000000000;
constexpr std::int64_t kWeek_ms = 604800000;
constexpr std::int64_t kGpsEpoch_s = 315964800;  ///< 1980-01-06

/// IERS Bulletin C: from these instants on (s, UTC) GPS has been ahead by 13 s, 14 s, ...
constexpr std::int64_t kLeapSeconds[] = {915148800, 1136073600, 1230768000, 1341100800, 1435708800, 1483228800};
constexpr std::int64_t kFirstLead_s = 13;

}  // namespace

bool is_time(const UtcTime& time) {
  const auto is_within = [](std::int64_t value, std::int64_t low, std::int64_t high) {
    return value >= low && value <= high;
  };
  return is_within(time.year, 1980, 2261) && is_within(time.month, 1, 12) && is_within(time.day, 1, 31) &&
         is_within(time.hour, 0, 23) && is_within(time.minute, 0, 59) && is_within(time.second, 0, 60) &&
         is_within(time.nanosecond, -kSecond_ns, kSecond_ns);
}

std::int64_t days_from_civil(std::int64_t year, std::int64_t month, std::int64_t day) {
  const std::int64_t y = month <= 2 ? year - 1 : year;
  const std::int64_t era = (y >= 0 ? y : y - 399) / 400;
  const std::int64_t year_of_era = y - 400 * era;
  const std::int64_t day_of_year = (153 * (month + (month > 2 ? -3 : 9)) + 2) / 5 + day - 1;
  return 146097 * era + 365 * year_of_era + year_of_era / 4 - year_of_era / 100 + day_of_year - 719468;
}

Stamp to_stamp(const UtcTime& time) {
  const std::int64_t days = days_from_civil(time.year, time.month, time.day);
  const std::int64_t seconds = 86400 * days + 3600 * time.hour + 60 * time.minute + time.second;
  return Stamp(seconds * kSecond_ns + time.nanosecond);
}

std::int64_t time_of_week_ms(Stamp utc) {
  std::int64_t lead_s = kFirstLead_s - 1;
  for (const std::int64_t since : kLeapSeconds) {
    if (utc.count() >= since * kSecond_ns) ++lead_s;
  }
  const double gps_ms = static_cast<double>((utc.count() - kGpsEpoch_s * kSecond_ns) / 1000) * 1e-3;
  const std::int64_t since_epoch_ms = std::llround(gps_ms) + 1000 * lead_s;
  return ((since_epoch_ms % kWeek_ms) + kWeek_ms) % kWeek_ms;
}

std::int64_t time_of_week_difference_ms(std::int64_t to, std::int64_t from) {
  const std::int64_t forwards = (((to - from) % kWeek_ms) + kWeek_ms) % kWeek_ms;
  return forwards > kWeek_ms / 2 ? forwards - kWeek_ms : forwards;
}

}  // namespace urban_gnss
