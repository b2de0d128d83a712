#pragma once

#include <string>
#include <vector>

#include "urban_gnss_localization/localizers/localizer_entry.hpp"

namespace urban_gnss {

/// The name of the localizer that serves where nobody chooses.
inline constexpr char kDefaultLocalizer[] = "imm_ekf";

/// A localizer with what is set of its parameters.
struct LocalizerChoice {
  const LocalizerEntry* entry;
  std::vector<std::string> assignments;
};

/// The localizers that a program offers.
class LocalizerRegistry {
 public:
  /// Requires names that differ.
  explicit LocalizerRegistry(std::vector<LocalizerEntry> entries) : entries_(std::move(entries)) {}

  const std::vector<LocalizerEntry>& entries() const { return entries_; }
  /// Throws std::runtime_error, with all names, where there is none of this name.
  const LocalizerEntry& find(const std::string& name) const;
  /// By its name or by that of a variant. Throws std::runtime_error, with all names, where there is none.
  LocalizerChoice choose(const std::string& name) const;
  /// Of all, in their order: those who take part in a comparison, or those who do so only where they are named.
  std::vector<LocalizerVariant> variants(bool on_request = false) const;
  /// "a, b or c", for people.
  std::string names() const;
  /// "a, b, c", the names of all variants, for people.
  std::string variant_names() const;

 private:
  /// "did you mean ukf? Else "; empty where no name is near.
  std::string guess(const std::string& name) const;

  std::vector<LocalizerEntry> entries_;
};

/// Those of this package.
LocalizerRegistry standard_localizers();

}  // namespace urban_gnss
