#include "urban_gnss_localization/receivers/nmea_fields.hpp"

#include <cmath>

#include "urban_gnss_localization/receivers/gps_time.hpp"

namespace urban_gnss {
namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Degrees and minutes in one number, as NMEA writes them.
std::optional<double> to_degrees(std::string_view field, double limit_deg) {
  const auto number = to_number(field);
  if (!number || *number < 0.0) return std::nullopt;
  const double degrees = std::floor(*number / 100.0);
  const double minutes = *number - 100.0 * degrees;
  const double angle_deg = degrees + minutes / 60.0;
  if (minutes >= 60.0 || angle_deg > limit_deg) return std::nullopt;
  return angle_deg;
}

std::optional<double> with_sign(std::optional<double> angle_deg, std::string_view hemisphere, char positive,
                                char negative) {
  if (!angle_deg || hemisphere.size() != 1) return std::nullopt;
  if (hemisphere[0] == positive) return angle_deg;
  if (hemisphere[0] == negative) return -*angle_deg;
  return std::nullopt;
}

}  // namespace

std::optional<double> to_number(std::string_view field) {
  constexpr double kMostExact = 9e14;  // more digits do not fit into a double
  bool is_negative = false;
  if (!field.empty() && (field[0] == '-' || field[0] == '+')) {
    is_negative = field[0] == '-';
    field.remove_prefix(1);
  }
  double digits = 0.0;
  double scale = 1.0;
  bool has_digit = false;
  bool is_behind_point = false;
  for (const char c : field) {
    if (c == '.' && !is_behind_point) {
      is_behind_point = true;
      continue;
    }
    if (!is_digit(c)) return std::nullopt;
    has_digit = true;
    if (digits > kMostExact) {
      if (!is_behind_point) return std::nullopt;  // no field has such a number
      continue;
    }
    digits = 10.0 * digits + (c - '0');
    if (is_behind_point) scale *= 10.0;
  }
  if (!has_digit) return std::nullopt;
  return (is_negative ? -digits : digits) / scale;
}

std::optional<int> to_count(std::string_view field) {
  if (field.empty() || field.size() > 9) return std::nullopt;
  int count = 0;
  for (const char c : field) {
    if (!is_digit(c)) return std::nullopt;
    count = 10 * count + (c - '0');
  }
  return count;
}

std::optional<Stamp> to_time_of_day(std::string_view field) {
  if (field.size() < 6 || (field.size() > 6 && field[6] != '.')) return std::nullopt;
  const auto hours = to_count(field.substr(0, 2));
  const auto minutes = to_count(field.substr(2, 2));
  const auto seconds = to_count(field.substr(4, 2));
  if (!hours || !minutes || !seconds || *hours > 23 || *minutes > 59 || *seconds > 60) return std::nullopt;
  std::int64_t nanoseconds = 0;
  std::int64_t unit = 100'000'000;
  for (std::size_t i = 7; i < field.size(); ++i, unit /= 10) {
    if (!is_digit(field[i])) return std::nullopt;
    nanoseconds += unit * (field[i] - '0');
  }
  return std::chrono::hours(*hours) + std::chrono::minutes(*minutes) + std::chrono::seconds(*seconds) +
         Stamp(nanoseconds);
}

std::optional<Day> to_day(int year, int month, int day) {
  if (year < 1970 || year > 2200 || month < 1 || month > 12 || day < 1) return std::nullopt;
  const std::int64_t first = days_from_civil(year, month, 1);
  if (day > days_from_civil(year, month + 1, 1) - first) return std::nullopt;
  return static_cast<Day>(first + day - 1);
}

std::optional<Day> to_day(std::string_view ddmmyy) {
  if (ddmmyy.size() != 6) return std::nullopt;
  const auto day = to_count(ddmmyy.substr(0, 2));
  const auto month = to_count(ddmmyy.substr(2, 2));
  const auto year = to_count(ddmmyy.substr(4, 2));
  if (!day || !month || !year) return std::nullopt;
  return to_day(*year + (*year < 80 ? 2000 : 1900), *month, *day);
}

std::optional<double> to_latitude_deg(std::string_view field, std::string_view hemisphere) {
  return with_sign(to_degrees(field, 90.0), hemisphere, 'N', 'S');
}

std::optional<double> to_longitude_deg(std::string_view field, std::string_view hemisphere) {
  return with_sign(to_degrees(field, 180.0), hemisphere, 'E', 'W');
}

}  // namespace urban_gnss
