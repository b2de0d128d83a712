#pragma once

#include <yaml-cpp/yaml.h>

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"

namespace urban_gnss {

/// Where a reader looks for a parameter.
enum class Layout {
  kFlat,    ///< `name`, whatever its tier and group
  kTiered,  ///< tier one as `name`, the others as `expert.group.name`
};

/// Reads parameter structs (common/parameters.hpp) out of one YAML map and collects every fault instead of stopping at
/// the first. A name that is absent keeps its default; a name that nothing asked for is a fault, with the nearest known
/// name, or the place that it has now where it stands elsewhere.
///
/// A fault names the file and the line where it is known: `city.yaml:12: receiver.rate = 99: must be at most 20`.
class ParameterReader : public ParameterVisitor {
 public:
  /// `map` may be undefined or null (all defaults). `source` is the name of the file that it was read from, empty where
  /// there is none or a fault needs no place. `path` stands before each name in the faults, as `receiver.` or
  /// `buildings[2].` does.
  explicit ParameterReader(const YAML::Node& map, std::string source = "", std::string path = "",
                           Layout layout = Layout::kFlat);

  template <class P>
  ParameterReader& read(P& parameters) {
    include(parameters);
    return *this;
  }

  /// Allows a name that someone else reads.
  void ignore(const std::string& name);

  /// Whether the map has a value under the name.
  bool has(const std::string& name) const { return has(map_, name); }
  /// The value under the name, for the caller to read; null where there is none.
  YAML::Node child(const std::string& name);

  /// Adds a fault that the caller found in what stands under the name: `name: text`.
  void fault(const std::string& name, const std::string& text);
  /// The same with the place of an element of it.
  void fault(const YAML::Node& place, const std::string& name, const std::string& text);
  /// Takes over faults that already say where they are: those of a reader of a child, or of another file.
  void add(const std::vector<std::string>& faults) { faults_.insert(faults_.end(), faults.begin(), faults.end()); }

  const std::string& source() const { return source_; }

  /// Every fault, in the order found, the unknown names last. Empty where the parameters can be used.
  std::vector<std::string> finish() const;

 protected:
  void on_number(const ParameterKey& key, double& value, const Range& range) override;
  void on_integer(const ParameterKey& key, int& value, const Range& range) override;
  void on_list(const ParameterKey& key, std::vector<double>& value) override;
  void on_boolean(const ParameterKey& key, bool& value) override;
  void on_text(const ParameterKey& key, std::string& value) override;
  void on_choice(const ParameterKey& key, std::size_t& chosen, const std::vector<const char*>& choices) override;
  void on_begin(const char* group, const char* meaning) override;
  void on_end(const std::vector<std::string>& faults) override;

 private:
  /// A struct that is being visited.
  struct Struct {
    bool has_group;
    std::map<std::string, std::string> path_of;  ///< of its own fields, by name
  };

  static bool has(const YAML::Node& map, const std::string& name) { return map.IsMap() && map[name].IsDefined(); }
  /// The value of a parameter, which is known from now on; undefined where it is absent.
  YAML::Node find(const ParameterKey& key);
  std::string path_of(const ParameterKey& key) const;
  YAML::Node at_path(const std::string& path) const;
  template <class T>
  bool convert(const ParameterKey& key, T& value, const char* expected);
  void bad_value(const ParameterKey& key, const std::string& text);
  void find_unknown(const YAML::Node& map, const std::string& prefix, std::vector<std::string>& faults) const;
  std::string hint(const std::string& path) const;
  /// `file:line: `, as far as it is known.
  std::string place(const YAML::Node& node) const;
  std::string place_of(const std::string& path) const;

  YAML::Node map_;
  std::string source_;
  std::string prefix_;
  Layout layout_;
  std::vector<std::string> groups_;
  std::vector<Struct> structs_;
  std::set<std::string> known_;    ///< paths of parameters
  std::set<std::string> ignored_;  ///< paths that are another's
  std::vector<std::string> faults_;
};

}  // namespace urban_gnss
