#include "urban_gnss_localization/parameters/parameter_reader.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "urban_gnss_localization/common/edit_distance.hpp"

namespace urban_gnss {
namespace {

constexpr const char* kExpert = "expert";

/// Names that parameters had once, and those that they have.
constexpr std::pair<const char*, const char*> kFormerNames[] = {
    {"odom_scale_sigma", "speed_scale_sigma"},
    {"odom_scale_walk", "speed_scale_walk"},
    {"odom_yaw_bias_sigma", "yaw_rate_bias_sigma"},
    {"odom_yaw_bias_walk", "yaw_rate_bias_walk"},
    {"odom_position_noise", "position_walk"},
    {"odom_heading_noise", "heading_walk"},
    {"odom_speed_noise", "odom_alpha1"},     // of which it was the root
    {"odom_yaw_rate_noise", "odom_alpha4"},  // likewise
    {"reflected_range", "nlos_mean"},
    {"reflected_range_sigma", "nlos_sigma"},
    {"reflected_elevation_exponent", "nlos_elevation_exponent"},
    {"weak_cn0_drop", "nlos_cn0_drop"},
    {"weak_cn0_width", "nlos_cn0_width"},
    {"antenna_cn0_rise", "nlos_cn0_rise"},
    {"satellites_timeout", "satellites_wait"},
    {"satellites_timeout", "satellites_max_age"},
};

std::string last_name(const std::string& path) { return path.substr(path.rfind('.') + 1); }

std::string text_of(const YAML::Node& node) {
  if (!node.IsDefined()) return "(default)";
  if (node.IsScalar()) return node.Scalar();
  YAML::Emitter out;
  out.SetMapFormat(YAML::Flow);
  out.SetSeqFormat(YAML::Flow);
  out << node;
  return out.c_str();
}

/// The numbers of a list of lists of equal length, e.g. of pairs; nothing where it is none.
std::optional<std::vector<double>> flattened(const YAML::Node& list) {
  if (!list.IsDefined() || !list.IsSequence() || list.size() == 0) return std::nullopt;
  std::vector<double> numbers;
  for (const YAML::Node& row : list) {
    if (!row.IsSequence() || row.size() != list[0].size()) return std::nullopt;
    try {
      const auto values = row.as<std::vector<double>>();
      numbers.insert(numbers.end(), values.begin(), values.end());
    } catch (const YAML::Exception&) {
      return std::nullopt;
    }
  }
  return numbers;
}

}  // namespace

ParameterReader::ParameterReader(const YAML::Node& map, std::string source, std::string path, Layout layout)
    : map_(map.IsDefined() ? map : YAML::Node()),
      source_(std::move(source)),
      prefix_(std::move(path)),
      layout_(layout) {}

void ParameterReader::ignore(const std::string& name) { ignored_.insert(name); }

YAML::Node ParameterReader::child(const std::string& name) {
  known_.insert(name);
  return has(name) ? map_[name] : YAML::Node();
}

std::string ParameterReader::path_of(const ParameterKey& key) const {
  if (layout_ == Layout::kFlat || key.is_basic) return key.name;
  std::string path = std::string(kExpert) + ".";
  for (const std::string& group : groups_) path += group + ".";
  return path + key.name;
}

YAML::Node ParameterReader::at_path(const std::string& path) const {
  YAML::Node node = map_;
  std::size_t begin = 0;
  while (true) {
    const std::size_t dot = path.find('.', begin);
    const std::string name = path.substr(begin, dot == std::string::npos ? dot : dot - begin);
    if (!has(node, name)) return YAML::Node(YAML::NodeType::Undefined);
    node.reset(node[name]);
    if (dot == std::string::npos) return node;
    begin = dot + 1;
  }
}

YAML::Node ParameterReader::find(const ParameterKey& key) {
  const std::string path = path_of(key);
  known_.insert(path);
  if (!structs_.empty()) structs_.back().path_of[key.name] = path;
  return at_path(path);
}

std::string ParameterReader::place(const YAML::Node& node) const {
  if (source_.empty()) return "";
  const int line = node.IsDefined() ? node.Mark().line : -1;  // from 0; negative where it was not read from a text
  return source_ + (line >= 0 ? ":" + std::to_string(line + 1) : "") + ": ";
}

std::string ParameterReader::place_of(const std::string& path) const {
  const YAML::Node node = at_path(path);
  return place(node.IsDefined() ? node : map_);
}

void ParameterReader::fault(const std::string& name, const std::string& text) {
  faults_.push_back(place_of(name) + prefix_ + name + ": " + text);
}

void ParameterReader::fault(const YAML::Node& node, const std::string& name, const std::string& text) {
  faults_.push_back(place(node) + prefix_ + name + ": " + text);
}

void ParameterReader::bad_value(const ParameterKey& key, const std::string& fault) {
  const std::string path = path_of(key);
  faults_.push_back(place_of(path) + prefix_ + path + " = " + text_of(at_path(path)) + ": " + fault);
}

template <class T>
bool ParameterReader::convert(const ParameterKey& key, T& value, const char* expected) {
  const YAML::Node node = find(key);
  if (!node.IsDefined()) return false;
  try {
    value = node.as<T>();
    return true;
  } catch (const YAML::Exception&) {
    bad_value(key, std::string("must be ") + expected);
    return false;
  }
}

void ParameterReader::on_number(const ParameterKey& key, double& value, const Range& range) {
  if (convert(key, value, "a number") && !range.contains(value)) bad_value(key, "must be " + range.describe());
}

void ParameterReader::on_integer(const ParameterKey& key, int& value, const Range& range) {
  if (convert(key, value, "a whole number") && !range.contains(value)) bad_value(key, "must be " + range.describe());
}

void ParameterReader::on_list(const ParameterKey& key, std::vector<double>& value) {
  YAML::Node node = find(key);
  if (node.IsDefined() && node.IsScalar()) {
    // A command line gives a text, _datum:="[48.1, 11.6, 520.0]", and so does a launch file.
    try {
      node = YAML::Load(node.Scalar());
      value = node.as<std::vector<double>>();
    } catch (const YAML::Exception&) {
      const auto flat = flattened(node);
      if (!flat) return bad_value(key, "must be a list of numbers");
      value = *flat;
    }
  } else if (const auto flat = flattened(node)) {
    value = *flat;
  } else if (!convert(key, value, "a list of numbers")) {
    return;
  }
  if (!std::all_of(value.begin(), value.end(), [](double element) { return std::isfinite(element); })) {
    bad_value(key, "must be finite numbers");
  }
}

void ParameterReader::on_boolean(const ParameterKey& key, bool& value) { convert(key, value, "true or false"); }

void ParameterReader::on_text(const ParameterKey& key, std::string& value) { convert(key, value, "a text"); }

void ParameterReader::on_choice(const ParameterKey& key, std::size_t& chosen, const std::vector<const char*>& choices) {
  const YAML::Node node = find(key);
  if (!node.IsDefined()) return;
  std::string all;
  for (std::size_t i = 0; i < choices.size(); ++i) {
    if (text_of(node) == choices[i]) {
      chosen = i;
      return;
    }
    all += (i == 0 ? "" : ", ") + std::string(choices[i]);
  }
  bad_value(key, "must be one of " + all);
}

void ParameterReader::on_begin(const char* group, const char*) {
  structs_.push_back({group != nullptr, {}});
  if (group != nullptr) groups_.emplace_back(group);
}

void ParameterReader::on_end(const std::vector<std::string>& faults) {
  const Struct& ended = structs_.back();
  for (const std::string& text : faults) {
    const std::string name = text.substr(0, text.find_first_of(" :"));
    const auto path = ended.path_of.find(name);
    if (path == ended.path_of.end()) {
      faults_.push_back(place(map_) + prefix_ + text);
    } else {
      faults_.push_back(place_of(path->second) + prefix_ + path->second + text.substr(name.size()));
    }
  }
  if (ended.has_group) groups_.pop_back();
  structs_.pop_back();
}

/// What someone may have meant who wrote `path`; empty where nothing is like it.
std::string ParameterReader::hint(const std::string& path) const {
  const std::string name = last_name(path);
  const std::string group = "." + path + ".";
  for (const std::string& known : known_) {
    const auto at = known.find(group);
    if (at != std::string::npos) return "; it is " + known.substr(0, at + group.size() - 1);
    if (last_name(known) == name) return "; it is " + known;
    for (const auto& [former, now] : kFormerNames) {
      if (name == former && last_name(known) == now) return "; it is now " + known;
    }
  }
  const std::vector<std::string> paths(known_.begin(), known_.end());
  std::vector<std::string> names;
  for (const std::string& known : paths) names.push_back(last_name(known));
  const auto nearest = nearest_name(name, names);
  return nearest ? "; did you mean " + paths[*nearest] + "?" : "";
}

void ParameterReader::find_unknown(const YAML::Node& map, const std::string& prefix,
                                   std::vector<std::string>& faults) const {
  for (const auto& entry : map) {
    if (!entry.first.IsScalar()) {
      faults.push_back(place(entry.first) + "a parameter's name must be a text");
      continue;
    }
    const std::string path = prefix + entry.first.Scalar();
    if (known_.count(path) > 0 || ignored_.count(path) > 0) continue;
    const std::string group = path + ".";
    const auto first_below = known_.lower_bound(group);
    const bool is_group = first_below != known_.end() && first_below->compare(0, group.size(), group) == 0;
    if (!is_group) {
      faults.push_back(place(entry.first) + prefix_ + path + ": no such parameter" + hint(path));
    } else if (entry.second.IsMap()) {
      find_unknown(entry.second, group, faults);
    } else if (!entry.second.IsNull()) {
      faults.push_back(place(entry.first) + prefix_ + path + ": must be a map of names to values");
    }
  }
}

std::vector<std::string> ParameterReader::finish() const {
  std::vector<std::string> faults = faults_;
  if (map_.IsMap()) {
    find_unknown(map_, "", faults);
  } else if (!map_.IsNull()) {
    const std::string name = prefix_.empty() ? "parameters" : prefix_.substr(0, prefix_.find_last_not_of('.') + 1);
    faults.push_back(place(map_) + name + " must be a map of names to values");
  }
  return faults;
}

}  // namespace urban_gnss
