#include "urban_gnss_localization/parameters/assignment.hpp"

#include <stdexcept>

namespace urban_gnss {
namespace {

constexpr int kDeepest = 40;
constexpr int kMostNodes = 1000000;

/// Whether whoever walks through the tree comes to an end: an alias may stand for what holds it, and aliases of aliases
/// for more than fits anywhere.
bool is_finite(const YAML::Node& node, int depth, int& nodes) {
  if (depth > kDeepest || ++nodes > kMostNodes) return false;
  if (!node.IsMap() && !node.IsSequence()) return true;
  for (const auto& each : node) {
    if (node.IsMap() && !is_finite(each.first, depth + 1, nodes)) return false;
    if (!is_finite(node.IsMap() ? each.second : each, depth + 1, nodes)) return false;
  }
  return true;
}

}  // namespace

void assign(YAML::Node map, const std::string& text) {
  const auto equal = text.find('=');
  const std::string path = equal == std::string::npos ? "" : text.substr(0, equal);
  YAML::Node value;
  try {
    if (!path.empty()) value = YAML::Load(text.substr(equal + 1));
  } catch (const YAML::Exception& error) {
    throw std::runtime_error(text + ": " + error.what());
  }
  if (value.IsScalar()) value = YAML::Node(value.Scalar());
  std::size_t begin = 0;
  while (true) {
    const auto dot = path.find('.', begin);
    const std::string name = path.substr(begin, dot == std::string::npos ? dot : dot - begin);
    if (name.empty()) throw std::runtime_error(text + ": must be NAME=VALUE or SECTION.NAME=VALUE");
    if (dot == std::string::npos) {
      map[name] = value;
      return;
    }
    const YAML::Node below = map[name];
    if (below.IsDefined() && !below.IsNull() && !below.IsMap()) {
      throw std::runtime_error(text + ": " + path.substr(0, dot) + " is no section");
    }
    if (!below.IsDefined() || below.IsNull()) map[name] = YAML::Node(YAML::NodeType::Map);
    map.reset(map[name]);
    begin = dot + 1;
  }
}

void merge(YAML::Node map, const YAML::Node& over) {
  for (const auto& entry : over) {
    const YAML::Node below = map[entry.first];
    if (below.IsDefined() && below.IsMap() && entry.second.IsMap()) {
      merge(below, entry.second);
    } else {
      map[entry.first] = entry.second;
    }
  }
}

YAML::Node load_map(const std::string& file) {
  YAML::Node map;
  try {
    map = YAML::LoadFile(file);
  } catch (const YAML::BadFile&) {
    throw std::runtime_error(file + ": cannot be read");
  } catch (const YAML::ParserException& error) {
    const bool is_of_spaces = error.msg == YAML::ErrorMsg::MAP_VALUE;
    throw std::runtime_error(file + ":" + std::to_string(error.mark.line + 1) + ": " + error.msg +
                             (is_of_spaces ? " (a tab in place of spaces?)" : ""));
  } catch (const std::exception& error) {
    throw std::runtime_error(file + ": is no YAML: " + error.what());
  }
  int nodes = 0;
  if (!is_finite(map, 0, nodes)) throw std::runtime_error(file + ": is nested too deeply, or has aliases without end");
  if (map.IsNull()) return YAML::Node(YAML::NodeType::Map);
  if (!map.IsMap()) throw std::runtime_error(file + ": must be a map of names to values");
  return map;
}

}  // namespace urban_gnss
