#pragma once

#include <yaml-cpp/yaml.h>

#include <functional>
#include <iosfwd>
#include <string>
#include <utility>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"

namespace urban_gnss {

/// A parameter as its documentation shows it.
struct ListedParameter {
  std::string name;
  std::vector<std::string> groups;  ///< it stands below, outermost first
  bool is_basic{false};             ///< tier one
  std::string value;                ///< as YAML text: the default
  std::string unit;
  std::string range;  ///< "at least 0", "one of a, b", "true or false"
  std::string meaning;

  /// Its place in a file of the layout: "datum", "expert.noise.fix_scale_rate".
  std::string path(Layout layout) const;
};

struct ListedGroup {
  std::vector<std::string> names;  ///< outermost first, its own last
  std::string meaning;
};

/// Lists the parameters of structs, in the order in which they are visited.
class ParameterList : public ParameterVisitor {
 public:
  template <class P>
  ParameterList& add(P parameters) {
    include(parameters);
    return *this;
  }

  const std::vector<ListedParameter>& parameters() const { return parameters_; }
  /// Whether it has this parameter, at the same place.
  bool has(const ListedParameter& parameter) const;
  /// Those for which `is_kept` is true.
  ParameterList kept(const std::function<bool(const ListedParameter&)>& is_kept) const;
  const std::vector<ListedGroup>& groups() const { return groups_; }

  /// The values as a map, as ParameterReader reads it.
  YAML::Node values(Layout layout) const;

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
  void list(const ParameterKey& key, std::string value, std::string range);

  std::vector<std::string> open_;      ///< names of the groups that are being visited
  std::vector<bool> struct_is_group_;  ///< of the structs that are being visited
  std::vector<ListedGroup> groups_;
  std::vector<ListedParameter> parameters_;
};

/// Writes a YAML file of the tiered layout: `title` as a comment, tier one, then `expert:` with the groups; each value
/// with unit and meaning behind it. No line is longer than 120 characters.
void write_yaml(std::ostream& out, const std::string& title, const ParameterList& list);

/// Writes a Markdown table of the parameters of tier one, and one of the others: path, default, unit, range, meaning.
void write_markdown(std::ostream& out, const ParameterList& list);

}  // namespace urban_gnss
