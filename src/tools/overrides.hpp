#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"

namespace urban_gnss {

/// Reads a map and, put over it, texts "NAME=VALUE", given with the command-line option `option`, into parameter
/// structs. Throws std::runtime_error for any other text, ParameterError where no struct has the name or the value is
/// none.
template <class... P>
void read_overrides(const std::string& option, YAML::Node map, const std::vector<std::string>& overrides,
                    P&... parameters) {
  for (const std::string& text : overrides) {
    const auto equal = text.find('=');
    if (equal == std::string::npos) throw std::runtime_error(option + " " + text + ": must be NAME=VALUE");
    map[text.substr(0, equal)] = YAML::Load(text.substr(equal + 1));
  }
  ParameterReader reader(map);
  (reader.read(parameters), ...);
  const auto faults = reader.finish();
  if (!faults.empty()) throw ParameterError(option, faults);
}

}  // namespace urban_gnss
