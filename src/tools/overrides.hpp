#pragma once

#include <string>
#include <vector>

#include "urban_gnss_localization/parameters/assignment.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"

namespace urban_gnss {

/// Reads a map and, put over it, texts "NAME=VALUE", given with the command-line option `option`, into parameter
/// structs, all in the tiered layout. Throws std::runtime_error for any other text, ParameterError where no struct has
/// the name or the value is none.
template <class... P>
void read_overrides(const std::string& option, YAML::Node map, const std::vector<std::string>& overrides,
                    P&... parameters) {
  for (const std::string& text : overrides) assign(map, text);
  ParameterReader reader(map, "", "", Layout::kTiered);
  (reader.read(parameters), ...);
  const auto faults = reader.finish();
  if (!faults.empty()) throw ParameterError(option, faults);
}

}  // namespace urban_gnss
