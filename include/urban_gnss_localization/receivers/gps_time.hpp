#pragma once

#include <cstdint>

#include "urban_gnss_localization/common/stamp.hpp"

namespace urban_gnss {

/// UTC as receivers say it. No field is checked: `second` may be 60, `nanosecond` negative.
struct UtcTime {
  int year{0}, month{0}, day{0}, hour{0}, minute{0}, second{0};
  std::int64_t nanosecond{0};
};

/// Whether it is a time of the years 1980 to 2261, which a Stamp can be; a second of 60, and nanoseconds of a second to
/// either side, as receivers have them.
bool is_time(const UtcTime& time);

/// Days since 1970-01-01 of a day of the Gregorian calendar. Nothing is checked; month 13 is the next January.
std::int64_t days_from_civil(std::int64_t year, std::int64_t month, std::int64_t day);

/// Since 1970-01-01, without leap seconds, as ROS counts. Requires is_time(), or another time that a Stamp can be.
Stamp to_stamp(const UtcTime& time);

/// ms, of the week of GPS, 0 to 604799999: UTC plus the leap seconds since 1980 (18 since 2017; of those after this was
/// written it knows nothing).
std::int64_t time_of_week_ms(Stamp utc);

/// ms from time of week `from` to `to`, by the shorter way round the week.
std::int64_t time_of_week_difference_ms(std::int64_t to, std::int64_t from);

}  // namespace urban_gnss
