#include "urban_gnss_localization/common/parameters.hpp"

#include <algorithm>
#include <numeric>
#include <sstream>

namespace urban_gnss {
namespace {

std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

std::string number(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

}  // namespace

std::string Range::describe() const {
  const bool has_low = std::isfinite(low);
  const bool has_high = std::isfinite(high);
  if (has_low && has_high) {
    return (low_open ? "greater than " : "at least ") + number(low) + " and at most " + number(high);
  }
  if (has_low) return (low_open ? "a finite number greater than " : "a finite number of at least ") + number(low);
  if (has_high) return "a finite number of at most " + number(high);
  return "a finite number";
}

bool ParameterReader::has(const std::string& name) const { return map_.IsMap() && map_[name].IsDefined(); }

YAML::Node ParameterReader::child(const std::string& name) {
  known_.insert(name);
  return has(name) ? map_[name] : YAML::Node();
}

std::string ParameterReader::at(const YAML::Node& place) const {
  if (source_.empty()) return "";
  const int line = place.Mark().line;  // from 0; negative where the node was not read from a text
  return source_ + (line >= 0 ? ":" + std::to_string(line + 1) : "") + ": ";
}

std::string ParameterReader::at(const std::string& name) const { return at(has(name) ? map_[name] : map_); }

void ParameterReader::bad_value(const std::string& name, const std::string& fault) {
  faults_.push_back(at(name) + path_ + name + " = " + text(name) + ": " + fault);
}

std::string ParameterReader::text(const std::string& name) const {
  if (!has(name)) return "(default)";
  YAML::Emitter out;
  out.SetMapFormat(YAML::Flow);
  out.SetSeqFormat(YAML::Flow);
  const YAML::Node node = map_[name];
  if (node.IsScalar()) return node.Scalar();
  out << node;
  return out.c_str();
}

std::vector<std::string> ParameterReader::finish() const {
  std::vector<std::string> faults = faults_;
  if (!map_.IsNull() && !map_.IsMap()) {
    const std::string name = path_.empty() ? "parameters" : path_.substr(0, path_.find_last_not_of('.') + 1);
    faults.push_back(at(map_) + name + " must be a map of names to values");
  }
  if (!map_.IsMap()) return faults;
  for (const auto& entry : map_) {
    if (!entry.first.IsScalar()) {
      faults.push_back(at(entry.first) + "a parameter's name must be a text");
      continue;
    }
    const auto name = entry.first.Scalar();
    if (known_.count(name) > 0) continue;
    const auto nearest = std::min_element(known_.begin(), known_.end(), [&](const auto& a, const auto& b) {
      return edit_distance(name, a) < edit_distance(name, b);
    });
    const bool is_near = nearest != known_.end() && edit_distance(name, *nearest) <= 1 + name.size() / 3;
    faults.push_back(at(entry.first) + path_ + name + ": no such parameter" +
                     (is_near ? "; did you mean " + *nearest + "?" : ""));
  }
  return faults;
}

ParameterError::ParameterError(const std::string& where, const std::vector<std::string>& faults)
    : std::runtime_error([&] {
        std::string message =
            where + ": " + std::to_string(faults.size()) + (faults.size() == 1 ? " bad parameter" : " bad parameters");
        for (const auto& fault : faults) message += "\n  - " + fault;
        return message;
      }()) {}

}  // namespace urban_gnss
