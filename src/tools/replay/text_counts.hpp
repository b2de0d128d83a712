#pragma once

#include <cctype>
#include <cstddef>
#include <map>
#include <string>

namespace urban_gnss {

/// Counts texts by their kind: those that differ in their numbers only are of one.
class TextCounts {
 public:
  struct Kind {
    std::size_t count{0};
    std::string first;  ///< text of this kind
  };

  /// How many there have been of its kind, with this one.
  std::size_t add(const std::string& text) {
    Kind& kind = kinds_[kind_of(text)];
    if (kind.count == 0) kind.first = text;
    return ++kind.count;
  }
  const std::map<std::string, Kind>& kinds() const { return kinds_; }

  /// The text without its numbers.
  static std::string kind_of(const std::string& text) {
    std::string kind;
    for (const char c : text) {
      const bool is_of_number = std::isdigit(static_cast<unsigned char>(c)) != 0 || c == '.' || c == '-' || c == '+';
      if (!is_of_number) kind += c;
    }
    return kind;
  }

 private:
  std::map<std::string, Kind> kinds_;
};

}  // namespace urban_gnss
