#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace urban_gnss {

/// How many letters must be put in, left out or changed to make one name of the other (Levenshtein).
std::size_t edit_distance(const std::string& a, const std::string& b);

/// Which of the names was probably meant, the first of those that are nearest; nothing where more than one letter and
/// a third of them are others.
std::optional<std::size_t> nearest_name(const std::string& name, const std::vector<std::string>& known);

}  // namespace urban_gnss
