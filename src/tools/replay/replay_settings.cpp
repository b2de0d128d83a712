#include "replay_settings.hpp"

#include <algorithm>
#include <stdexcept>

#include "urban_gnss_localization/parameters/assignment.hpp"
#include "urban_gnss_localization/parameters/parameter_list.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"

namespace urban_gnss {
namespace {

constexpr const char* kGpsBias = "gps_bias";
constexpr const char* kSeed = "seed";

/// The parameters by node, as they come together.
struct Maps {
  std::string localizer;  ///< its name
  std::string entry;      ///< that of its node
  YAML::Node of_localizer{YAML::NodeType::Map};
  YAML::Node of_gps_bias{YAML::NodeType::Map};
};

void merge_file(const std::string& file, const LocalizerRegistry& localizers, Maps& maps) {
  YAML::Node map = load_map(file);
  std::vector<std::string> sections{kGpsBias};
  for (const LocalizerEntry& each : localizers.entries()) sections.push_back(each.name);
  for (const std::string& section : sections) {
    if (!map[section].IsDefined()) continue;
    if (section == maps.entry) merge(maps.of_localizer, map[section]);
    if (section == kGpsBias) merge(maps.of_gps_bias, map[section]);
    map.remove(section);  // of another node
  }
  merge(maps.of_localizer, map);
}

void assign_option(const std::string& text, Maps& maps) {
  const std::string prefix = std::string(kGpsBias) + ".";
  if (text.compare(0, prefix.size(), prefix) == 0) {
    assign(maps.of_gps_bias, text.substr(prefix.size()));
  } else {
    assign(maps.of_localizer, text);
  }
}

template <class P>
void read(const YAML::Node& map, const std::string& whose, P& parameters, std::vector<std::string>& faults) {
  ParameterReader reader(map, "", "", Layout::kTiered);
  reader.ignore("diagnostic_period");  // of the live node alone
  for (const std::string& fault : reader.read(parameters).finish()) faults.push_back(whose + fault);
}

}  // namespace

ReplaySettings read_settings(const ReplayOptions& options, const LocalizerRegistry& localizers) {
  const LocalizerChoice choice = localizers.choose(options.localizer);
  ReplaySettings settings{LocalizerNodeSettings(*choice.entry), {}};
  Maps maps{options.localizer, choice.entry->name};
  for (const std::string& file : options.params) merge_file(file, localizers, maps);
  for (const std::string& text : choice.assignments) assign(maps.of_localizer, text);
  if (options.wants_imu) assign(maps.of_localizer, "expert.imu.use_imu_yaw_rate=true");
  for (const std::string& text : options.overrides) assign_option(text, maps);
  const std::vector<ListedParameter> known = ParameterList().add(settings.localizer).parameters();
  const auto seed = std::find_if(known.begin(), known.end(), [](const auto& each) { return each.name == kSeed; });
  if (seed != known.end() && options.seed >= 0) {
    assign(maps.of_localizer, seed->path(Layout::kTiered) + "=" + std::to_string(options.seed));
  }
  if (!options.datum.empty()) maps.of_localizer["datum"] = options.datum;

  std::vector<std::string> faults;
  read(maps.of_localizer, "", settings.localizer, faults);
  // What both nodes are told alike is told once: to the localizer.
  settings.gps_bias.frames = settings.localizer.shell.frames;
  settings.gps_bias.bias.input = settings.localizer.shell.localization.input;
  read(maps.of_gps_bias, std::string(kGpsBias) + ".", settings.gps_bias, faults);
  if (!faults.empty()) throw ParameterError("replay", faults);
  ParameterList read_list;
  read_list.add(settings.localizer);
  for (const ListedParameter& each : read_list.parameters()) {
    if (each.name == kSeed) settings.seed = std::stoi(each.value);
  }
  return settings;
}

}  // namespace urban_gnss
