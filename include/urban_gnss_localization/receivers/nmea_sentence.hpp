#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace urban_gnss {

/// One sentence of NMEA 0183 whose checksum is right: `$GPGGA,…*hh`.
struct NmeaSentence {
  std::string talker;               ///< "GP", "GN", …; empty for a proprietary sentence
  std::string type;                 ///< "GGA"; of a proprietary sentence all of the address ("PUBX")
  std::vector<std::string> fields;  ///< after the address, as sent

  /// Empty where the sentence is shorter.
  std::string_view field(std::size_t index) const {
    return index < fields.size() ? std::string_view(fields[index]) : std::string_view();
  }
};

/// Why a line is no sentence that can be used.
enum class NmeaRefusal { kNone, kNoStart, kTooLong, kBadCharacter, kNoChecksum, kWrongChecksum, kBadAddress };

/// For people: "its checksum is wrong".
const char* to_string(NmeaRefusal refusal);

struct NmeaParsing {
  std::optional<NmeaSentence> sentence;
  NmeaRefusal refusal{NmeaRefusal::kNone};  ///< kNone exactly where there is a sentence
};

/// Parses the sentence that begins at the last '$' of a line; what stands before it (a logger's time) and behind the
/// checksum is left out. A sentence without a checksum is refused: it may be cut off. Takes any bytes, never throws.
NmeaParsing parse_nmea_sentence(std::string_view line);

/// The lines of a log, which may have binary messages between its sentences: what stands between ends of lines, zeros
/// and '$'. Each begins with its '$', where it has one.
std::vector<std::string_view> split_nmea_lines(std::string_view log);

}  // namespace urban_gnss
