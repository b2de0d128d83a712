#include "replay_settings.hpp"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <optional>
#include <utility>

#include "find_scenario.hpp"
#include "overrides.hpp"
#include "urban_gnss_localization/parameters/parameter_list.hpp"
#include "urban_gnss_localization/parameters/params_file.hpp"
#include "urban_gnss_localization/parameters/yaml_files.hpp"

namespace urban_gnss {
namespace {

constexpr const char* kGpsBias = "gps_bias";
constexpr const char* kOcclusion = "occlusion";

/// The parameters by node, as they come together.
struct Maps {
  std::string entry;  ///< name of the localizer's node
  YAML::Node of_localizer{YAML::NodeType::Map};
  YAML::Node of_gps_bias{YAML::NodeType::Map};
  YAML::Node of_occlusion{YAML::NodeType::Map};

  std::vector<std::pair<std::string, YAML::Node>> by_node() const {
    return {{entry, of_localizer}, {kGpsBias, of_gps_bias}, {kOcclusion, of_occlusion}};
  }
};

/// Merges the sections that this run reads; those of other nodes are left out.
void merge_sections(const YAML::Node& file, Maps& maps) {
  for (const auto& [node, map] : maps.by_node()) {
    if (file[node].IsDefined()) merge(map, file[node]);
  }
}

/// A file of --params. Adds to `faults` what of it nobody would read.
void merge_params(const std::string& file, Maps& maps, std::vector<std::string>& faults) {
  std::vector<std::string> nodes;
  for (const auto& [node, map] : maps.by_node()) nodes.push_back(node);
  const ParamsFile found = read_params_file(file, nodes);
  faults.insert(faults.end(), found.faults.begin(), found.faults.end());
  for (const std::string& node : nodes) {
    if (found.sections[node].IsDefined() || !holds_section(found.sections, node)) continue;
    faults.push_back(file + ": section " + node + " stands in a namespace: replay has none");
  }
  if (!found.hint.empty()) std::cerr << found.hint << '\n';
  if (found.faults.empty()) merge_sections(found.sections, maps);
}

/// What is known of a kind of robot. Throws ParameterError that lists the kinds where there is none of this name.
std::string robot_file(const std::string& robot) {
  namespace fs = std::filesystem;
  const fs::path folder = package_path() / "config" / "robots";
  const fs::path file = folder / (robot + ".yaml");
  if (fs::is_regular_file(file)) return file;
  std::string known;
  for (const std::string& name : yaml_files(folder)) known += " " + name;
  throw ParameterError("--robot", {robot + ": must be one of" + known});
}

void assign_option(const std::string& text, Maps& maps) {
  for (const auto& [node, map] : {std::pair(kGpsBias, maps.of_gps_bias), std::pair(kOcclusion, maps.of_occlusion)}) {
    const std::string prefix = std::string(node) + ".";
    if (text.compare(0, prefix.size(), prefix) != 0) continue;
    YAML::Node of_node = map;  // the same map: a YAML::Node is a reference
    return assign(of_node, text.substr(prefix.size()));
  }
  assign(maps.of_localizer, text);
}

/// Where the odometry is made of what the receiver says (odometry_of_velocities()): its errors are the velocity's, they
/// come with every sample, and it tells neither how late the receiver is nor whether its speed is right.
constexpr std::pair<const char*, const char*> kWithoutOdometry[] = {
    {"position_walk", "2.0"},  {"parked_walk", "1.0"}, {"heading_walk", "0.3"},
    {"check_wheels", "false"}, {"fix_delay", "\"0\""}, {"initialization_timeout", "10.0"},
};

void assign_without_odometry(const LocalizerNodeSettings& localizer, YAML::Node& map) {
  const std::vector<ListedParameter> all = ParameterList().add(localizer).parameters();
  for (const ListedParameter& each : all) {
    for (const auto& [name, value] : kWithoutOdometry) {
      if (each.name == name) assign(map, each.path(Layout::kTiered) + "=" + value);
    }
  }
}

/// Where the parameters come from, for people.
std::string sources_of(const ReplayOptions& options) {
  std::vector<std::string> sources = options.params;
  if (!options.occlusion_params.empty()) sources.push_back(options.occlusion_params);
  if (!options.overrides.empty()) sources.push_back("--set");
  if (!options.datum.empty()) sources.push_back("--datum");
  std::string text;
  for (const std::string& source : sources) text += (text.empty() ? "" : ", ") + source;
  return text.empty() ? "the package's files of parameters" : text;
}

/// The seed of the localizer's random numbers; nothing where it draws none.
std::optional<ListedParameter> find_seed(const LocalizerNodeSettings& localizer) {
  const std::vector<ListedParameter> all = ParameterList().add(localizer).parameters();
  const auto found = std::find_if(all.begin(), all.end(), [](const auto& each) { return each.name == "seed"; });
  return found == all.end() ? std::nullopt : std::make_optional(*found);
}

}  // namespace

ReplaySettings read_settings(const ReplayOptions& options, const LocalizerRegistry& localizers) {
  const LocalizerChoice choice = localizers.choose(options.localizer);
  ReplaySettings settings{LocalizerNodeSettings(*choice.entry), {}, {}};
  Maps maps{choice.entry->name};
  if (options.without_odometry) assign_without_odometry(settings.localizer, maps.of_localizer);
  if (!options.robot.empty()) merge_sections(load_map(robot_file(options.robot)), maps);
  if (!options.occlusion_params.empty()) merge(maps.of_occlusion, load_map(options.occlusion_params));
  std::vector<std::string> faults;
  for (const std::string& file : options.params) merge_params(file, maps, faults);
  for (const std::string& text : choice.assignments) assign(maps.of_localizer, text);
  if (options.wants_imu) assign(maps.of_localizer, "expert.imu.use_imu_yaw_rate=true");
  for (const std::string& text : options.overrides) assign_option(text, maps);
  const auto seed = find_seed(settings.localizer);
  if (seed && options.seed >= 0) {
    assign(maps.of_localizer, seed->path(Layout::kTiered) + "=" + std::to_string(options.seed));
  }
  if (!options.datum.empty()) maps.of_localizer["datum"] = options.datum;

  // Of the live nodes alone.
  for (YAML::Node map : {maps.of_localizer, maps.of_gps_bias}) map.remove("diagnostic_period");
  maps.of_localizer.remove(kStateFile);

  const auto of_localizer = read_tiered(maps.of_localizer, "", settings.localizer);
  faults.insert(faults.end(), of_localizer.begin(), of_localizer.end());
  // What both nodes are told alike is told once: to the localizer.
  settings.gps_bias.frames = settings.localizer.shell.frames;
  read_tiered(maps.of_localizer, "", settings.gps_bias.bias);  // its faults are those of the localizer
  const auto of_gps_bias = read_tiered(maps.of_gps_bias, std::string(kGpsBias) + ".", settings.gps_bias);
  faults.insert(faults.end(), of_gps_bias.begin(), of_gps_bias.end());
  if (options.occlusion) {
    settings.occlusion.emplace();
    settings.occlusion->frames = settings.localizer.shell.frames;
    const auto of_occlusion = read_tiered(maps.of_occlusion, std::string(kOcclusion) + ".", *settings.occlusion);
    faults.insert(faults.end(), of_occlusion.begin(), of_occlusion.end());
  }
  if (!faults.empty()) throw ParameterError(sources_of(options), faults);
  if (seed) settings.seed = std::stoi(find_seed(settings.localizer)->value);
  return settings;
}

}  // namespace urban_gnss
