#pragma once

#include <cstddef>
#include <string>

namespace urban_gnss {

/// How many letters must be put in, left out or changed to make one name of the other (Levenshtein).
std::size_t edit_distance(const std::string& a, const std::string& b);

}  // namespace urban_gnss
