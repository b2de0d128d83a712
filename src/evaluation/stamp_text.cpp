#include "urban_gnss_localization/evaluation/stamp_text.hpp"

#include <cctype>
#include <cstdint>
#include <cstdio>
#include <limits>

namespace urban_gnss {
namespace {

bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

/// Removes leading digits from the text and returns them.
std::string_view take_digits(std::string_view& text) {
  std::size_t count = 0;
  while (count < text.size() && is_digit(text[count])) ++count;
  const std::string_view digits = text.substr(0, count);
  text.remove_prefix(count);
  return digits;
}

/// Removes a leading sign from the text; true where it was a minus.
bool take_minus(std::string_view& text) {
  const bool negative = !text.empty() && text.front() == '-';
  if (negative || (!text.empty() && text.front() == '+')) text.remove_prefix(1);
  return negative;
}

}  // namespace

std::optional<Stamp> parse_stamp(std::string_view text) {
  constexpr int kMaxExponent = 1000;
  const bool negative = take_minus(text);
  std::string digits(take_digits(text));
  int point = static_cast<int>(digits.size());  // place of the decimal point within the digits
  if (!text.empty() && text.front() == '.') {
    text.remove_prefix(1);
    digits += take_digits(text);
  }
  if (digits.empty()) return std::nullopt;
  if (!text.empty() && (text.front() == 'e' || text.front() == 'E')) {
    text.remove_prefix(1);
    const bool negative_exponent = take_minus(text);
    const std::string_view exponent_digits = take_digits(text);
    if (exponent_digits.empty()) return std::nullopt;
    int exponent = 0;
    for (const char c : exponent_digits) {
      exponent = exponent * 10 + (c - '0');
      if (exponent > kMaxExponent) return std::nullopt;
    }
    point += negative_exponent ? -exponent : exponent;
  }
  if (!text.empty()) return std::nullopt;

  const int end = point + 9;  // the digits before this place are whole nanoseconds
  const auto digit_at = [&](int place) {
    return place >= 0 && place < static_cast<int>(digits.size()) ? digits[static_cast<std::size_t>(place)] - '0' : 0;
  };
  constexpr std::int64_t kLargest = std::numeric_limits<std::int64_t>::max();
  std::int64_t count = 0;
  for (int place = 0; place < end; ++place) {
    if (count > (kLargest - 10) / 10) return std::nullopt;
    count = count * 10 + digit_at(place);
  }
  if (digit_at(end) >= 5) ++count;
  return Stamp(negative ? -count : count);
}

std::string format_stamp(Stamp stamp) {
  constexpr std::uint64_t kPerSecond = 1000000000U;
  const bool negative = stamp.count() < 0;
  const std::uint64_t bits = static_cast<std::uint64_t>(stamp.count());
  const std::uint64_t magnitude = negative ? 0U - bits : bits;
  char text[32];
  std::snprintf(text, sizeof(text), "%s%llu.%09llu", negative ? "-" : "",
                static_cast<unsigned long long>(magnitude / kPerSecond),
                static_cast<unsigned long long>(magnitude % kPerSecond));
  return text;
}

}  // namespace urban_gnss
