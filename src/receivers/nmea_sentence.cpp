#include "urban_gnss_localization/receivers/nmea_sentence.hpp"

#include <algorithm>

namespace urban_gnss {
namespace {

constexpr std::size_t kMaxLength = 1024;  // the standard has 82; receivers with many satellites send more

int hexadecimal(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return -1;
}

bool is_printable(char c) { return c >= ' ' && c <= '~'; }
bool is_capital_or_digit(char c) { return (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9'); }

NmeaParsing refused(NmeaRefusal why) { return {std::nullopt, why}; }

std::vector<std::string> split(std::string_view text) {
  std::vector<std::string> fields;
  std::size_t begin = 0;
  while (true) {
    const std::size_t comma = text.find(',', begin);
    fields.emplace_back(text.substr(begin, comma == std::string_view::npos ? comma : comma - begin));
    if (comma == std::string_view::npos) return fields;
    begin = comma + 1;
  }
}

}  // namespace

const char* to_string(NmeaRefusal refusal) {
  switch (refusal) {
    case NmeaRefusal::kNone: return "it is used";
    case NmeaRefusal::kNoStart: return "it has no '$'";
    case NmeaRefusal::kTooLong: return "it is too long";
    case NmeaRefusal::kBadCharacter: return "it has bytes that are no text";
    case NmeaRefusal::kNoChecksum: return "it has no checksum";
    case NmeaRefusal::kWrongChecksum: return "its checksum is wrong";
    case NmeaRefusal::kBadAddress: return "its address is no talker with a type";
  }
  return "?";
}

NmeaParsing parse_nmea_sentence(std::string_view line) {
  const std::size_t start = line.rfind('$');
  if (start == std::string_view::npos) return refused(NmeaRefusal::kNoStart);
  line.remove_prefix(start + 1);
  const std::size_t star = line.find('*');
  const std::string_view body = line.substr(0, star);
  if (body.size() > kMaxLength) return refused(NmeaRefusal::kTooLong);
  if (star == std::string_view::npos || line.size() < star + 3) return refused(NmeaRefusal::kNoChecksum);
  if (!std::all_of(body.begin(), body.end(), is_printable)) return refused(NmeaRefusal::kBadCharacter);

  const int high = hexadecimal(line[star + 1]);
  const int low = hexadecimal(line[star + 2]);
  if (high < 0 || low < 0) return refused(NmeaRefusal::kNoChecksum);
  int sum = 0;
  for (const char c : body) sum ^= c;
  if (sum != 16 * high + low) return refused(NmeaRefusal::kWrongChecksum);

  NmeaSentence sentence;
  sentence.fields = split(body);
  const std::string address = sentence.fields.front();
  sentence.fields.erase(sentence.fields.begin());
  if (address.size() < 4 || !std::all_of(address.begin(), address.end(), is_capital_or_digit)) {
    return refused(NmeaRefusal::kBadAddress);
  }
  // P is for proprietary; but PQ is what Quectel's receivers call BeiDou.
  const bool is_proprietary = address[0] == 'P' && !(address[1] == 'Q' && address.size() == 5);
  if (is_proprietary) {
    sentence.type = address;
  } else if (address.size() == 5) {
    sentence.talker = address.substr(0, 2);
    sentence.type = address.substr(2);
  } else {
    return refused(NmeaRefusal::kBadAddress);
  }
  return {std::move(sentence), NmeaRefusal::kNone};
}

std::vector<std::string_view> split_nmea_lines(std::string_view log) {
  constexpr std::string_view kEnds("\r\n\0", 3);
  std::vector<std::string_view> lines;
  std::size_t begin = 0;
  while (begin < log.size()) {
    std::size_t end = begin;
    do ++end;
    while (end < log.size() && log[end] != '$' && kEnds.find(log[end]) == std::string_view::npos);
    const std::string_view line = log.substr(begin, end - begin);
    if (kEnds.find(line.front()) == std::string_view::npos) {
      lines.push_back(line);
    } else if (line.size() > 1) {
      lines.push_back(line.substr(1));
    }
    begin = end;
  }
  return lines;
}

}  // namespace urban_gnss
