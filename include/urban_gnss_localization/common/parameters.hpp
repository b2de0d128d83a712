#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
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
  /// For an error: "must be " + "at least 0 and at most 1".
  std::string describe() const;
};

/// Both ends belong to a range, except for positive(), which leaves out 0, and open_between(), which leaves out `low`.
inline Range positive() { return {0.0, std::numeric_limits<double>::infinity(), true}; }
inline Range non_negative() { return {0.0, std::numeric_limits<double>::infinity(), false}; }
inline Range between(double low, double high) { return {low, high, false}; }
inline Range open_between(double low, double high) { return {low, high, true}; }
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

/// What is known of a parameter beside its value and range.
struct ParameterKey {
  const char* name;
  const char* unit;     ///< "m", "rad/s"; "" for a text, a choice or a count without unit
  const char* meaning;  ///< one sentence, with symbol and equation where it has one
  bool is_basic;        ///< tier one: what a user sets. The others stand below `expert:`
};

/// Goes through a struct of parameters: to read it, to write it, to check it, to document it.
///
/// A parameter struct lists its fields once, in `void visit(ParameterVisitor& v)`:
///   v("gate_timeout", gate_timeout, positive(), "s", "time with nothing but rejected fixes after which it restarts");
///   v("mode", mode, "variant of the filter");                                 // enumeration, bool or text
///   v.basic()("datum", datum, "deg, deg, m", "origin of the map frame");      // tier one; a list of numbers
///   v.group("noise", noise, "Noise of the fixes.");                           // a struct below a name of its own
///   v.include(motion);                                                        // a struct beside the fields
/// and its conditions between fields in `void check(std::vector<std::string>& faults) const`, where it has any; a fault
/// begins with the field's name. Ranges and conditions of all structs within are checked by whoever visits.
class ParameterVisitor {
 public:
  virtual ~ParameterVisitor() = default;

  void operator()(const char* name, double& value, const Range& range, const char* unit, const char* meaning) {
    on_number(key(name, unit, meaning), value, range);
  }
  void operator()(const char* name, int& value, const Range& range, const char* unit, const char* meaning) {
    on_integer(key(name, unit, meaning), value, range);
  }
  void operator()(const char* name, std::vector<double>& value, const char* unit, const char* meaning) {
    on_list(key(name, unit, meaning), value);
  }
  template <class T>
  void operator()(const char* name, T& value, const char* meaning) {
    if constexpr (std::is_enum_v<T>) {
      const EnumNames<T> names = enum_names(value);
      std::vector<const char*> choices;
      std::size_t chosen = 0;
      for (std::size_t i = 0; i < names.size(); ++i) {
        choices.push_back(names[i].first);
        if (names[i].second == value) chosen = i;
      }
      on_choice(key(name, "", meaning), chosen, choices);
      value = names[chosen].second;
    } else if constexpr (std::is_same_v<T, bool>) {
      on_boolean(key(name, "", meaning), value);
    } else {
      static_assert(std::is_same_v<T, std::string>, "a number needs a range and a unit, a list a unit");
      on_text(key(name, "", meaning), value);
    }
  }

  /// The next parameter is one of tier one.
  ParameterVisitor& basic() {
    next_is_basic_ = true;
    return *this;
  }

  template <class P>
  void group(const char* name, P& parameters, const char* meaning) {
    on_begin(name, meaning);
    parameters.visit(*this);
    on_end(conditions_broken_by(parameters));
  }

  template <class P>
  void include(P& parameters) {
    group(nullptr, parameters, "");
  }

 protected:
  virtual void on_number(const ParameterKey& key, double& value, const Range& range) = 0;
  virtual void on_integer(const ParameterKey& key, int& value, const Range& range) = 0;
  virtual void on_list(const ParameterKey& key, std::vector<double>& value) = 0;
  virtual void on_boolean(const ParameterKey& key, bool& value) = 0;
  virtual void on_text(const ParameterKey& key, std::string& value) = 0;
  /// `chosen` is an index of `choices`.
  virtual void on_choice(const ParameterKey& key, std::size_t& chosen, const std::vector<const char*>& choices) = 0;
  /// A struct begins; below no name of its own where `group` is null.
  virtual void on_begin(const char* group, const char* meaning) = 0;
  /// It ends; `faults` are the conditions that its fields break.
  virtual void on_end(const std::vector<std::string>& faults) = 0;

 private:
  ParameterKey key(const char* name, const char* unit, const char* meaning) {
    return {name, unit, meaning, std::exchange(next_is_basic_, false)};
  }

  template <class P>
  static auto check_of(const P& parameters, std::vector<std::string>& faults, int)
      -> decltype(parameters.check(faults)) {
    parameters.check(faults);
  }
  template <class P>
  static void check_of(const P&, std::vector<std::string>&, long) {}
  template <class P>
  static std::vector<std::string> conditions_broken_by(const P& parameters) {
    std::vector<std::string> faults;
    check_of(parameters, faults, 0);
    return faults;
  }

  bool next_is_basic_{false};
};

/// Thrown where parameters cannot be used; what() lists every fault, one a line.
class ParameterError : public std::runtime_error {
 public:
  ParameterError(const std::string& where, const std::vector<std::string>& faults);
};

/// Collects what is wrong with the values of structs: ranges and conditions.
class ParameterCheck : public ParameterVisitor {
 public:
  const std::vector<std::string>& faults() const { return faults_; }

 protected:
  void on_number(const ParameterKey& key, double& value, const Range& range) override;
  void on_integer(const ParameterKey& key, int& value, const Range& range) override;
  void on_list(const ParameterKey& key, std::vector<double>& value) override;
  void on_boolean(const ParameterKey&, bool&) override {}
  void on_text(const ParameterKey&, std::string&) override {}
  void on_choice(const ParameterKey&, std::size_t&, const std::vector<const char*>&) override {}
  void on_begin(const char*, const char*) override {}
  void on_end(const std::vector<std::string>& faults) override;

 private:
  std::vector<std::string> faults_;
};

/// What is wrong with the values of a struct; empty where it can be used.
template <class P>
std::vector<std::string> faults_of(P parameters) {
  ParameterCheck check;
  check.include(parameters);
  return check.faults();
}

/// Throws ParameterError where the values of a struct cannot be used; `where` says whose they are.
template <class P>
void require_usable(const std::string& where, const P& parameters) {
  const std::vector<std::string> faults = faults_of(parameters);
  if (!faults.empty()) throw ParameterError(where, faults);
}

}  // namespace urban_gnss
