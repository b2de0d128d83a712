// Scenarios, files of parameters, and what is put over them on a command line.

#include "memory_file.hpp"
#include "urban_gnss_localization/localizers/registry.hpp"
#include "urban_gnss_localization/parameters/assignment.hpp"
#include "urban_gnss_localization/parameters/parameter_list.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"
#include "urban_gnss_localization/parameters/params_file.hpp"
#include "urban_gnss_localization/pipeline/bias_pipeline.hpp"
#include "urban_gnss_localization/pipeline/localization_parameters.hpp"
#include "urban_gnss_localization/pipeline/occlusion_pipeline.hpp"
#include "urban_gnss_localization/simulation/city_simulator.hpp"

namespace urban_gnss::fuzz {
namespace {

/// What replay and the nodes read from a map of one section.
template <class P>
void read_section(const YAML::Node& map, const std::string& path, P& parameters) {
  ParameterReader reader(map, path, "", Layout::kTiered);
  reader.read(parameters);
  const std::vector<std::string> faults = reader.finish();
  for (const std::string& fault : faults) {
    require(fault.rfind(path, 0) == 0, "a fault that does not name the file: " + fault);
  }
  if (!faults.empty()) throw ParameterError(path, faults);
  ParameterList().add(parameters).values(Layout::kTiered);
}

struct WholeLocalizer {
  LocalizationParameters pipeline;
  std::shared_ptr<LocalizerSettings> localizer;

  void visit(ParameterVisitor& v) {
    v.include(pipeline);
    v.include(*localizer);
  }
};

/// Small enough to be driven in a few milliseconds.
bool is_small(const Scenario& scenario) {
  const bool has_lidar = scenario.lidar.type != LidarType::kNone;
  return scenario.world.buildings.size() < 40 && scenario.world.trees.size() < 40 && scenario.cars.size() < 20 &&
         !has_lidar;
}

}  // namespace

void read_scenario(const std::string& bytes) {
  read_as_file(bytes, [](const std::string& path) {
    Scenario scenario = load_scenario(path);
    if (!is_small(scenario)) return;
    CitySimulator simulator(std::move(scenario));
    std::vector<SimulationEvent> events;
    for (int i = 0; i < 5 && !simulator.is_finished(); ++i) simulator.step(std::nullopt, events);
    require(is_finite(simulator.truth()), "a drive to nowhere");
  });
}

void read_parameters(const std::string& bytes) {
  read_as_file(bytes, [](const std::string& path) {
    const YAML::Node map = load_map(path);
    look_through_params(map, {"imm_ekf"});
    const YAML::Node bias = map["gps_bias"];
    if (bias.IsDefined()) {
      BiasPipelineParameters parameters;
      read_section(bias, path, parameters);
    }
    const YAML::Node occlusion = map["occlusion"];
    if (occlusion.IsDefined()) {
      OcclusionPipelineParameters parameters;
      read_section(occlusion, path, parameters);
    }
    static const LocalizerRegistry localizers = standard_localizers();
    for (const LocalizerEntry& entry : localizers.entries()) {
      const YAML::Node section = map[entry.name];
      if (!section.IsDefined()) continue;
      WholeLocalizer parameters{{}, entry.settings()};
      read_section(section, path, parameters);
      parameters.localizer->make();
    }
  });
}

/// Lines NAME=VALUE, one over the other.
void read_assignment(const std::string& bytes) {
  YAML::Node map(YAML::NodeType::Map);
  for (std::size_t begin = 0; begin < bytes.size();) {
    const std::size_t end = std::min(bytes.find('\n', begin), bytes.size());
    const std::string line = bytes.substr(begin, end - begin);
    begin = end + 1;
    try {
      assign(map, line);
      YAML::Node other(YAML::NodeType::Map);
      merge(other, map);
      BiasPipelineParameters parameters;
      read_section(other, "--set", parameters);
    } catch (const std::runtime_error& error) {
      const std::string text = error.what();
      require(text.rfind(line.c_str(), 0) == 0 || text.rfind("--set", 0) == 0, "a refusal of something else: " + text);
    }
  }
}

}  // namespace urban_gnss::fuzz
