#pragma once

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace urban_gnss {

/// The values that a numeric parameter may take; NaN is in no range.
struct Range {
  double low{-std::numeric_limits<double>::infinity()};
  double high{std::numeric_limits<double>::infinity()};
  bool low_open{false};  ///< low itself is not allowed

  bool contains(double value) const {
    return std::isfinite(value) && (low_open ? value > low : value >= low) && value <= high;
  }
  std::string describe() const;
};

inline Range positive() { return {0.0, std::numeric_limits<double>::infinity(), true}; }
inline Range non_negative() { return {0.0, std::numeric_limits<double>::infinity(), false}; }
inline Range between(double low, double high) { return {low, high, false}; }
inline Range at_least(double low) { return {low, std::numeric_limits<double>::infinity(), false}; }
inline Range any_number() { return {}; }

/// Names of an enumeration's values, in the order in which an error lists them. A parameter's enumeration provides
/// `EnumNames<E> enum_names(E)` beside itself.
template <class E>
using EnumNames = std::vector<std::pair<const char*, E>>;

template <class E>
const char* enum_name(E value) {
  for (const auto& [name, candidate] : enum_names(value)) {
    if (candidate == value) return name;
  }
  return "?";
}

/// Reads parameter structs out of one YAML map and collects every fault instead of stopping at the first.
///
/// A parameter struct lists its fields once, in `template <class V> void visit(V& v)`, as
/// `v("name", field, range)` for numbers and `v("name", field)` for booleans, strings, enumerations and lists; and its
/// conditions between fields in `void check(std::vector<std::string>& faults) const`. A name that is absent keeps its
/// default; a name that nothing asked for is a fault, with the nearest known name.
///
/// A fault names the file and the line where it is known: `city.yaml:12: receiver.rate = 99: must be at most 20`.
class ParameterReader {
 public:
  /// `map` may be undefined or null (all defaults). `source` is the name of the file that it was read from, empty where
  /// there is none or a fault needs no place. `path` stands before each name in the faults, as `receiver.` or
  /// `buildings[2].` does.
  explicit ParameterReader(const YAML::Node& map, std::string source = "", std::string path = "")
      : map_(map.IsDefined() ? map : YAML::Node()), source_(std::move(source)), path_(std::move(path)) {}

  template <class P>
  ParameterReader& read(P& parameters) {
    parameters.visit(*this);
    std::vector<std::string> faults;
    parameters.check(faults);
    for (const std::string& text : faults)
      faults_.push_back(at(text.substr(0, text.find_first_of(" :"))) + path_ + text);
    return *this;
  }

  template <class T>
  void operator()(const std::string& name, T& value, const Range& range) {
    static_assert(std::is_arithmetic_v<T>, "a range belongs to a number");
    const bool was_read = convert(name, value, std::is_integral_v<T> ? "a whole number" : "a number");
    if (was_read && !range.contains(static_cast<double>(value))) {
      bad_value(name, "must be " + range.describe());
    }
  }

  template <class T>
  void operator()(const std::string& name, T& value) {
    if constexpr (std::is_enum_v<T>) {
      read_enum(name, value);
    } else if constexpr (std::is_same_v<T, bool>) {
      convert(name, value, "true or false");
    } else if constexpr (std::is_same_v<T, std::string>) {
      convert(name, value, "a text");
    } else {
      if (convert(name, value, "a list of numbers")) {
        for (const double element : value) {
          if (!std::isfinite(element)) bad_value(name, "must be finite numbers");
        }
      }
    }
  }

  /// Allows a name that someone else reads.
  void ignore(const std::string& name) { known_.insert(name); }

  /// Whether the map has a value under the name.
  bool has(const std::string& name) const;
  /// The value under the name, for the caller to read; null where there is none.
  YAML::Node child(const std::string& name);

  /// Adds a fault that the caller found in what stands under the name: `name: text`.
  void fault(const std::string& name, const std::string& text) {
    faults_.push_back(at(name) + path_ + name + ": " + text);
  }
  /// The same with the place of an element of it.
  void fault(const YAML::Node& place, const std::string& name, const std::string& text) {
    faults_.push_back(at(place) + path_ + name + ": " + text);
  }
  /// Takes over faults that already say where they are: those of a reader of a child, or of another file.
  void add(const std::vector<std::string>& faults) { faults_.insert(faults_.end(), faults.begin(), faults.end()); }

  const std::string& source() const { return source_; }

  /// Every fault, in the order found, the unknown names last. Empty where the parameters can be used.
  std::vector<std::string> finish() const;

 private:
  template <class T>
  bool convert(const std::string& name, T& value, const char* expected) {
    known_.insert(name);
    if (!has(name)) return true;
    try {
      // Older yaml-cpp lets a minus sign wrap round to a huge unsigned number.
      constexpr bool is_unsigned_number = std::is_unsigned_v<T> && !std::is_same_v<T, bool>;
      if (is_unsigned_number && text(name).rfind('-', 0) == 0) throw YAML::BadConversion(map_[name].Mark());
      value = map_[name].as<T>();
      return true;
    } catch (const YAML::Exception&) {
      bad_value(name, std::string("must be ") + expected);
      return false;
    }
  }

  template <class E>
  void read_enum(const std::string& name, E& value) {
    known_.insert(name);
    if (!has(name)) return;
    std::string choices;
    for (const auto& [choice, candidate] : enum_names(value)) {
      if (text(name) == choice) {
        value = candidate;
        return;
      }
      choices += (choices.empty() ? "" : ", ") + std::string(choice);
    }
    bad_value(name, "must be one of " + choices);
  }

  /// `file:line: `, as far as it is known.
  std::string at(const YAML::Node& place) const;
  /// The place of the value under the name; of the map where it has none.
  std::string at(const std::string& name) const;
  std::string text(const std::string& name) const;
  void bad_value(const std::string& name, const std::string& text);

  YAML::Node map_;
  std::string source_;
  std::string path_;
  std::set<std::string> known_;
  std::vector<std::string> faults_;
};

/// Writes parameter structs as YAML text, one `name: value` a line: what a run's report says it ran with.
class ParameterWriter {
 public:
  template <class P>
  ParameterWriter& write(P parameters) {
    parameters.visit(*this);
    return *this;
  }
  template <class T>
  void operator()(const std::string& name, T& value, const Range&) {
    (*this)(name, value);
  }
  template <class T>
  void operator()(const std::string& name, T& value) {
    if constexpr (std::is_enum_v<T>) {
      map_[name] = std::string(enum_name(value));
    } else {
      map_[name] = value;
    }
  }
  const YAML::Node& map() const { return map_; }

 private:
  YAML::Node map_;
};

/// Thrown where parameters cannot be used; what() lists every fault, one a line.
class ParameterError : public std::runtime_error {
 public:
  ParameterError(const std::string& where, const std::vector<std::string>& faults);
};

}  // namespace urban_gnss
