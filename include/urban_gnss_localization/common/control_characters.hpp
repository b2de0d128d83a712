#pragma once

namespace urban_gnss {

/// Whether it is a character that a terminal obeys in place of showing it (ASCII).
inline bool is_control(char character) {
  constexpr unsigned char kFirstShown = 0x20;
  constexpr unsigned char kDelete = 0x7f;
  const auto code = static_cast<unsigned char>(character);
  return code < kFirstShown || code == kDelete;
}

}  // namespace urban_gnss
