#pragma once

#include <cstdio>
#include <string>

namespace urban_gnss {

/// A sentence: `body` ("GPGGA,…") between its '$' and its checksum.
inline std::string nmea(const std::string& body) {
  int sum = 0;
  for (const char c : body) sum ^= c;
  char tail[4];
  std::snprintf(tail, sizeof tail, "*%02X", static_cast<unsigned>(sum) & 0xFFU);
  return "$" + body + tail;
}

}  // namespace urban_gnss
