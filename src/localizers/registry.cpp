#include "urban_gnss_localization/localizers/registry.hpp"

#include <algorithm>
#include <stdexcept>

// Every localizer of the package, a line each. A folder below localizers/ provides `LocalizerEntry NAME_entry()`;
// CMakeLists.txt reads these lines, too, and builds the node NAME_node.
#define URBAN_GNSS_LOCALIZERS(X) \
  X(imm_ekf)                     \
  X(switching_particle_filter)   \
  X(ukf)                         \
  X(complementary_ekf)           \
  X(particle_filter)

namespace urban_gnss {

#define DECLARE_ENTRY(name) LocalizerEntry name##_entry();
URBAN_GNSS_LOCALIZERS(DECLARE_ENTRY)
#undef DECLARE_ENTRY

LocalizerRegistry standard_localizers() {
#define CALL_ENTRY(name) name##_entry(),
  return LocalizerRegistry({URBAN_GNSS_LOCALIZERS(CALL_ENTRY)});
#undef CALL_ENTRY
}

std::string LocalizerRegistry::names() const {
  std::string all;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    all += (i == 0 ? "" : i + 1 < entries_.size() ? ", " : " or ") + entries_[i].name;
  }
  return all;
}

const LocalizerEntry& LocalizerRegistry::find(const std::string& name) const {
  const auto found = std::find_if(entries_.begin(), entries_.end(), [&](const auto& each) { return each.name == name; });
  if (found == entries_.end()) throw std::runtime_error(name + ": no such localizer; there are " + names());
  return *found;
}

}  // namespace urban_gnss
