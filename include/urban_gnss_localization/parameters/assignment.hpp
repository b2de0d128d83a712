#pragma once

#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

namespace urban_gnss {

/// Puts "a.b.c=value" over a map, whose maps on the way are made where they are missing. A scalar is set as text
/// without a place in a file, so that a fault names none. Throws std::runtime_error with the text where it is no
/// assignment, where the value is no YAML, and where a name on the way is no map.
void assign(YAML::Node map, const std::string& text);

/// Puts a map over another, name by name; what is no map in both is replaced.
void merge(YAML::Node map, const YAML::Node& over);

/// Reads a file that holds a map, or nothing. Throws std::runtime_error that names file and line otherwise.
YAML::Node load_map(const std::string& file);

}  // namespace urban_gnss
