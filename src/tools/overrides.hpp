#pragma once

#include <string>
#include <vector>

#include "urban_gnss_localization/parameters/assignment.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"

namespace urban_gnss {

/// Reads a map of the tiered layout into parameter structs, and returns the faults. `path` stands before each name in
/// them, as `gps_bias.` does.
template <class... P>
std::vector<std::string> read_tiered(const YAML::Node& map, const std::string& path, P&... parameters) {
  ParameterReader reader(map, "", path, Layout::kTiered);
  (reader.read(parameters), ...);
  return reader.finish();
}

/// Reads a map and, put over it, texts "NAME=VALUE", given with the command-line option `option`, into parameter
/// structs. Throws std::runtime_error for any other text, ParameterError where no struct has the name or the value is
/// none.
template <class... P>
void read_overrides(const std::string& option, YAML::Node map, const std::vector<std::string>& overrides,
                    P&... parameters) {
  for (const std::string& text : overrides) assign(map, text);
  const auto faults = read_tiered(map, "", parameters...);
  if (!faults.empty()) throw ParameterError(option, faults);
}

}  // namespace urban_gnss
