#include "urban_gnss_localization/common/edit_distance.hpp"

#include <algorithm>
#include <numeric>
#include <vector>

namespace urban_gnss {

std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

std::optional<std::size_t> nearest_name(const std::string& name, const std::vector<std::string>& known) {
  std::optional<std::size_t> nearest;
  std::size_t least = 1 + name.size() / 3;
  for (std::size_t i = 0; i < known.size(); ++i) {
    const std::size_t distance = edit_distance(name, known[i]);
    if (distance > least || (nearest && distance == least)) continue;
    nearest = i;
    least = distance;
  }
  return nearest;
}

}  // namespace urban_gnss
