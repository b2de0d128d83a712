#include "urban_gnss_localization/localizers/registry.hpp"

#include <algorithm>
#include <iterator>
#include <stdexcept>

#include "urban_gnss_localization/common/edit_distance.hpp"

// Every localizer of the package, a line each. A folder below localizers/ provides `LocalizerEntry NAME_entry()`;
// CMakeLists.txt reads these lines, too, and builds the node NAME_node.
#define URBAN_GNSS_LOCALIZERS(X) \
  X(particle_filter)             \
  X(complementary_ekf)           \
  X(ukf)                         \
  X(imm_ekf)                     \
  X(switching_particle_filter)

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
  const auto found =
      std::find_if(entries_.begin(), entries_.end(), [&](const auto& each) { return each.name == name; });
  if (found == entries_.end()) {
    throw std::runtime_error(name + ": no such localizer; " + guess(name) + "there are " + names());
  }
  return *found;
}

LocalizerChoice LocalizerRegistry::choose(const std::string& name) const {
  for (const LocalizerEntry& entry : entries_) {
    if (entry.name == name) return {&entry, {}};
    for (const LocalizerVariant& variant : entry.variants) {
      if (variant.name == name) return {&entry, variant.assignments};
    }
  }
  throw std::runtime_error(name + ": no such localizer; " + guess(name) + "there are " + names() +
                           ", in comparisons also as " + variant_names());
}

std::string LocalizerRegistry::guess(const std::string& name) const {
  std::vector<std::string> known;
  for (const LocalizerEntry& entry : entries_) {
    known.push_back(entry.name);
    for (const LocalizerVariant& variant : entry.variants) known.push_back(variant.name);
  }
  const auto nearest = nearest_name(name, known);
  return nearest ? "did you mean " + known[*nearest] + "? Else " : "";
}

std::vector<LocalizerVariant> LocalizerRegistry::variants(bool on_request) const {
  std::vector<LocalizerVariant> all;
  for (const LocalizerEntry& entry : entries_) {
    std::copy_if(entry.variants.begin(), entry.variants.end(), std::back_inserter(all),
                 [&](const LocalizerVariant& variant) { return variant.on_request == on_request; });
  }
  return all;
}

std::string LocalizerRegistry::variant_names() const {
  std::string all;
  for (bool on_request : {false, true}) {
    for (const LocalizerVariant& variant : variants(on_request)) all += (all.empty() ? "" : ", ") + variant.name;
  }
  return all;
}

}  // namespace urban_gnss
