#include "urban_gnss_localization/simulation/yuma.hpp"

#include <boost/algorithm/string/case_conv.hpp>
#include <boost/algorithm/string/predicate.hpp>
#include <boost/algorithm/string/trim.hpp>
#include <cmath>
#include <fstream>
#include <limits>
#include <locale>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>

#include "urban_gnss_localization/geometry/angles.hpp"

namespace urban_gnss {
namespace {

constexpr double kWeek_s = 604800.0;
constexpr int kWeeksOfEra = 1024;
constexpr Stamp kGpsEpoch = std::chrono::seconds(315964800);  // 1980-01-06 00:00 UTC

/// A field by the beginning of its name, as far as the programs that write almanacs agree ("Right Ascen at Week(rad)",
/// "Right Ascen at TOA(rad)").
struct Field {
  const char* prefix;
  double low;
  double high;
  bool is_whole;
};

constexpr double kAngle_rad = 2.0 * kPi;
constexpr double kAny = std::numeric_limits<double>::max();
enum FieldIndex {
  kId,
  kHealth,
  kEccentricity,
  kTime,
  kInclination,
  kNodeRate,
  kRootAxis,
  kNode,
  kPerigee,
  kAnomaly,
  kAf0,
  kAf1,
  kWeek,
  kFieldCount
};
constexpr Field kFields[kFieldCount] = {
    {"id", 1.0, 63.0, true},
    {"health", 0.0, 255.0, true},
    {"eccentricity", 0.0, 0.5, false},
    {"time of applicability", 0.0, kWeek_s, false},
    {"orbital inclination", 0.0, kPi, false},
    {"rate of right ascen", -1e-6, 1e-6, false},
    {"sqrt(a)", 2530.0, 8192.0, false},
    {"right ascen at", -kAngle_rad, kAngle_rad, false},
    {"argument of perigee", -kAngle_rad, kAngle_rad, false},
    {"mean anom", -kAngle_rad, kAngle_rad, false},
    {"af0", -kAny, kAny, false},
    {"af1", -kAny, kAny, false},
    {"week", 0.0, 8191.0, true},
};
bool is_required(int field) { return field != kAf0 && field != kAf1; }

std::optional<double> number(const std::string& text) {
  std::istringstream in(text);
  in.imbue(std::locale::classic());
  double value = 0.0;
  if (!(in >> value) || !(in >> std::ws).eof() || !std::isfinite(value)) return std::nullopt;
  return value;
}

/// The week since 1980 that an almanac's week stands for.
int full_week(int week, Stamp near) {
  if (week >= kWeeksOfEra) return week;
  const double weeks = to_seconds(near - kGpsEpoch) / kWeek_s;
  const double eras = std::round((weeks - week) / kWeeksOfEra);
  return week + kWeeksOfEra * static_cast<int>(std::max(eras, 0.0));
}

class YumaReader {
 public:
  YumaReader(std::string name, Stamp near) : name_(std::move(name)), near_(near) {}

  std::vector<OrbitingSatellite> read(std::istream& text) {
    std::string line;
    while (std::getline(text, line)) {
      ++line_;
      boost::algorithm::trim(line);
      if (line.empty()) continue;
      if (boost::algorithm::starts_with(line, "**")) {
        finish_block();
        block_line_ = line_;
      } else {
        add_field(line);
      }
    }
    finish_block();
    if (block_line_ == 0) fail(line_, "is no YUMA almanac: it has no heading of asterisks");
    return std::move(satellites_);
  }

 private:
  [[noreturn]] void fail(int line, const std::string& reason) const {
    throw std::runtime_error(name_ + ":" + std::to_string(line) + ": " + reason);
  }

  void add_field(const std::string& line) {
    if (block_line_ == 0) fail(line_, "\"" + line + "\" stands before the first heading of asterisks");
    const std::size_t colon = line.find(':');
    if (colon == std::string::npos) fail(line_, "\"" + line + "\" is not of the form \"name: value\"");
    const std::string label = boost::algorithm::to_lower_copy(line.substr(0, colon), std::locale::classic());
    const std::string text = boost::algorithm::trim_copy(line.substr(colon + 1));

    int index = 0;
    while (index < kFieldCount && !boost::algorithm::starts_with(label, kFields[index].prefix)) ++index;
    if (index == kFieldCount) fail(line_, "\"" + line.substr(0, colon) + "\" is no field of a YUMA almanac");
    const Field& field = kFields[index];
    const std::optional<double> value = number(text);
    const bool is_valid =
        value && *value >= field.low && *value <= field.high && (!field.is_whole || *value == std::floor(*value));
    if (!is_valid) {
      std::ostringstream reason;
      reason << field.prefix << " = \"" << text << "\": must be a " << (field.is_whole ? "whole " : "") << "number";
      if (field.high < kAny) reason << " from " << field.low << " to " << field.high;
      fail(line_, reason.str());
    }
    if (!values_.emplace(index, *value).second) fail(line_, std::string(field.prefix) + " comes twice in this block");
  }

  void finish_block() {
    if (block_line_ == 0) return;
    for (int field = 0; field < kFieldCount; ++field) {
      if (is_required(field) && values_.count(field) == 0) {
        fail(block_line_, std::string("the block has no field \"") + kFields[field].prefix + "\"");
      }
    }
    const int svid = static_cast<int>(values_[kId]);
    if (!seen_.insert(svid).second) fail(block_line_, "satellite " + std::to_string(svid) + " comes twice");
    if (values_[kHealth] == 0.0) satellites_.push_back({{Constellation::kGps, svid}, orbit()});
    values_.clear();
  }

  KeplerElements orbit() {
    KeplerElements orbit;
    const auto weeks = std::chrono::hours(7 * 24) * full_week(static_cast<int>(values_[kWeek]), near_);
    orbit.reference = kGpsEpoch + weeks + from_seconds(values_[kTime] - kGpsMinusUtc_s);
    orbit.semi_major_axis_m = values_[kRootAxis] * values_[kRootAxis];
    orbit.eccentricity = values_[kEccentricity];
    orbit.inclination_rad = values_[kInclination];
    orbit.node_rate_radps = values_[kNodeRate];
    orbit.argument_of_perigee_rad = values_[kPerigee];
    orbit.mean_anomaly_rad = values_[kAnomaly];
    // The almanac counts the node from where the prime meridian is at the start of the week.
    orbit.node_reference = NodeReference::kEarthFixed;
    orbit.node_rad = values_[kNode] - kEarthRate_radps * values_[kTime];
    return orbit;
  }

  std::string name_;
  Stamp near_;
  int line_{0};
  int block_line_{0};  ///< of the heading; 0 before the first
  std::map<int, double> values_;
  std::set<int> seen_;
  std::vector<OrbitingSatellite> satellites_;
};

}  // namespace

std::vector<OrbitingSatellite> read_yuma(std::istream& text, const std::string& name, Stamp near) {
  return YumaReader(name, near).read(text);
}

std::vector<OrbitingSatellite> read_yuma_file(const std::string& path, Stamp near) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path + ": cannot be read");
  return read_yuma(file, path, near);
}

}  // namespace urban_gnss
