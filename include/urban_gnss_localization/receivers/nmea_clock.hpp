#pragma once

#include <optional>

#include "urban_gnss_localization/receivers/nmea_fields.hpp"

namespace urban_gnss {

/// UTC out of the times of day that sentences have, and the dates that some of them have. A time without a date is on
/// the day that brings it nearest to the last moment that is known, so that midnight needs no date.
class NmeaClock {
 public:
  /// Nothing is known before the first date.
  NmeaClock() = default;
  /// A moment that the first time of day is near to, within twelve hours.
  static NmeaClock near(Stamp moment) { return NmeaClock(moment, true); }
  /// The day of the first sentence, whatever the sentences say: for receivers that get the date wrong.
  static NmeaClock from_day(Day day) { return NmeaClock(std::chrono::hours(24 * day + 12), false); }

  /// A date was sent with this time of day.
  void set(Day day, Stamp time_of_day);

  /// UTC of a time of day, which becomes the last known moment; nothing before there is one.
  std::optional<Stamp> advance(Stamp time_of_day);
  /// The same without a change.
  std::optional<Stamp> utc(Stamp time_of_day) const;

 private:
  NmeaClock(Stamp moment, bool takes_dates) : last_(moment), takes_dates_(takes_dates) {}

  std::optional<Stamp> last_;
  bool takes_dates_{true};
};

}  // namespace urban_gnss
