#pragma once

#include <sstream>
#include <string>

namespace urban_gnss {

inline std::string seconds_text(double seconds) {
  std::ostringstream out;
  out.precision(3);
  out << seconds << " s";
  return out.str();
}

}  // namespace urban_gnss
