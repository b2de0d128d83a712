#include "urban_gnss_localization/receivers/nmea_clock.hpp"

namespace urban_gnss {
namespace {

constexpr Stamp kDay = std::chrono::hours(24);

}  // namespace

void NmeaClock::set(Day day, Stamp time_of_day) {
  if (takes_dates_) last_ = day * kDay + time_of_day;
}

std::optional<Stamp> NmeaClock::utc(Stamp time_of_day) const {
  if (!last_) return std::nullopt;
  const auto midnight = *last_ - *last_ % kDay;
  Stamp utc = midnight + time_of_day;
  if (utc - *last_ > kDay / 2) utc -= kDay;
  if (*last_ - utc > kDay / 2) utc += kDay;
  return utc;
}

std::optional<Stamp> NmeaClock::advance(Stamp time_of_day) {
  const auto moment = utc(time_of_day);
  if (moment) last_ = moment;
  return moment;
}

}  // namespace urban_gnss
