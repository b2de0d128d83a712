#include "urban_gnss_localization/parameters/parameter_list.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ostream>
#include <sstream>

namespace urban_gnss {
namespace {

constexpr std::size_t kLongestLine = 120;

/// The shortest text that reads as the same number, and as a floating-point one in YAML 1.1 (1.0e-05, not 1e-05).
std::string text_of(double value) {
  constexpr double kLeastWithoutExponent = 1e-4;
  constexpr double kMostWithoutExponent = 1e7;
  char buffer[64];
  const double size = std::abs(value);
  const bool is_plain = value == 0.0 || (size >= kLeastWithoutExponent && size < kMostWithoutExponent);
  for (int digits = 1; digits <= 17; ++digits) {
    std::snprintf(buffer, sizeof(buffer), is_plain ? "%.*f" : "%.*e", digits, value);
    if (std::strtod(buffer, nullptr) == value) break;
  }
  return buffer;
}

std::string joined(const std::vector<std::string>& names) {
  std::string path;
  for (const std::string& name : names) path += (path.empty() ? "" : ".") + name;
  return path;
}

/// Words of `text` in lines of at most `width` characters.
std::vector<std::string> wrapped(const std::string& text, std::size_t width) {
  std::vector<std::string> lines;
  std::istringstream words(text);
  std::string word;
  while (words >> word) {
    if (lines.empty() || lines.back().size() + 1 + word.size() > width) {
      lines.push_back(word);
    } else {
      lines.back() += " " + word;
    }
  }
  return lines;
}

/// "m, largest standard deviation that is kept".
std::string comment_of(const ListedParameter& parameter) {
  return parameter.unit.empty() ? parameter.meaning : parameter.unit + ", " + parameter.meaning;
}

void write_entries(std::ostream& out, const std::vector<const ListedParameter*>& entries, const std::string& indent) {
  std::size_t widest = 0;
  for (const ListedParameter* each : entries) widest = std::max(widest, each->name.size() + each->value.size() + 2);
  const std::size_t column = indent.size() + widest + 2;
  for (const ListedParameter* each : entries) {
    std::string line = indent + each->name + ": " + each->value;
    for (const std::string& part : wrapped(comment_of(*each), kLongestLine - column - 2)) {
      line.resize(column, ' ');
      out << line << "# " << part << '\n';
      line.clear();
    }
  }
}

/// The groups directly below `parent`, and what stands in them.
void write_group(std::ostream& out, const ParameterList& list, const std::vector<std::string>& parent,
                 const std::string& indent) {
  std::vector<const ListedParameter*> entries;
  for (const ListedParameter& each : list.parameters()) {
    if (!each.is_basic && each.groups == parent) entries.push_back(&each);
  }
  write_entries(out, entries, indent);
  for (const ListedGroup& group : list.groups()) {
    if (group.names.size() != parent.size() + 1 || !std::equal(parent.begin(), parent.end(), group.names.begin())) {
      continue;
    }
    std::ostringstream inside;
    write_group(inside, list, group.names, indent + "  ");
    if (inside.str().empty()) continue;
    for (const std::string& line : wrapped(group.meaning, kLongestLine - indent.size() - 2)) {
      out << indent << "# " << line << '\n';
    }
    out << indent << group.names.back() << ":\n" << inside.str();
  }
}

void write_row(std::ostream& out, const ListedParameter& each) {
  out << "| `" << each.path(Layout::kTiered) << "` | `" << each.value << "` | " << each.unit << " | " << each.range
      << " | " << each.meaning << " |\n";
}

}  // namespace

std::string ListedParameter::path(Layout layout) const {
  if (layout == Layout::kFlat || is_basic) return name;
  std::vector<std::string> names = groups;
  names.insert(names.begin(), "expert");
  names.push_back(name);
  return joined(names);
}

void ParameterList::list(const ParameterKey& key, std::string value, std::string range) {
  parameters_.push_back({key.name, open_, key.is_basic, std::move(value), key.unit, std::move(range), key.meaning});
}

void ParameterList::on_number(const ParameterKey& key, double& value, const Range& range) {
  list(key, text_of(value), range.describe());
}

void ParameterList::on_integer(const ParameterKey& key, int& value, const Range& range) {
  list(key, std::to_string(value), range.describe());
}

void ParameterList::on_list(const ParameterKey& key, std::vector<double>& value) {
  std::string text;
  for (const double each : value) text += (text.empty() ? "" : ", ") + text_of(each);
  list(key, "[" + text + "]", "finite numbers");
}

void ParameterList::on_boolean(const ParameterKey& key, bool& value) {
  list(key, value ? "true" : "false", "true or false");
}

void ParameterList::on_text(const ParameterKey& key, std::string& value) {
  list(key, value.empty() ? "\"\"" : value, "a text");
}

void ParameterList::on_choice(const ParameterKey& key, std::size_t& chosen, const std::vector<const char*>& choices) {
  std::string range;
  for (const char* each : choices) range += (range.empty() ? "" : ", ") + std::string(each);
  list(key, choices[chosen], range);
}

void ParameterList::on_begin(const char* group, const char* meaning) {
  struct_is_group_.push_back(group != nullptr);
  if (group == nullptr) return;
  open_.emplace_back(group);
  const auto same = [this](const ListedGroup& other) { return other.names == open_; };
  if (std::none_of(groups_.begin(), groups_.end(), same)) groups_.push_back({open_, meaning});
}

void ParameterList::on_end(const std::vector<std::string>&) {
  if (struct_is_group_.back()) open_.pop_back();
  struct_is_group_.pop_back();
}

bool ParameterList::has(const ListedParameter& parameter) const {
  return std::any_of(parameters_.begin(), parameters_.end(), [&](const ListedParameter& each) {
    return each.path(Layout::kTiered) == parameter.path(Layout::kTiered);
  });
}

ParameterList ParameterList::kept(const std::function<bool(const ListedParameter&)>& is_kept) const {
  ParameterList list = *this;
  auto& all = list.parameters_;
  all.erase(std::remove_if(all.begin(), all.end(), [&](const ListedParameter& each) { return !is_kept(each); }),
            all.end());
  return list;
}

YAML::Node ParameterList::values(Layout layout) const {
  YAML::Node root(YAML::NodeType::Map);
  for (const ListedParameter& each : parameters_) {
    YAML::Node map;
    map.reset(root);
    std::istringstream names(each.path(layout));
    std::string name;
    std::getline(names, name, '.');
    for (std::string next; std::getline(names, next, '.'); name = next) {
      const YAML::Node below = map[name];
      map.reset(below);
    }
    map[name] = YAML::Load(each.value);
  }
  return root;
}

void write_yaml(std::ostream& out, const std::string& title, const ParameterList& list) {
  for (const std::string& line : wrapped(title, kLongestLine - 2)) out << "# " << line << '\n';
  out << '\n';
  std::vector<const ListedParameter*> basic;
  for (const ListedParameter& each : list.parameters()) {
    if (each.is_basic) basic.push_back(&each);
  }
  write_entries(out, basic, "");
  std::ostringstream expert;
  write_group(expert, list, {}, "  ");
  if (expert.str().empty()) return;
  out << (basic.empty() ? "" : "\n") << "expert:\n" << expert.str();
}

void write_markdown(std::ostream& out, const ParameterList& list) {
  for (const bool is_basic : {true, false}) {
    bool has_header = false;
    for (const ListedParameter& each : list.parameters()) {
      if (each.is_basic != is_basic) continue;
      if (!has_header) out << "| parameter | default | unit | range | meaning |\n|---|---|---|---|---|\n";
      has_header = true;
      write_row(out, each);
    }
    if (has_header) out << '\n';
  }
}

}  // namespace urban_gnss
