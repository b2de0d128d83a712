// The files in config/ and scenarios/ and the structs that read them: neither may have a parameter that the other does
// not know, and the files that document the defaults must state them.

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <sstream>

#include "matchers.hpp"
#include "package_directory.hpp"
#include "urban_gnss_localization/control/waypoint_controller.hpp"
#include "urban_gnss_localization/localizers/kim/complementary_ekf.hpp"
#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"
#include "urban_gnss_localization/localizers/nishida/particle_filter.hpp"
#include "urban_gnss_localization/localizers/maier/ukf.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"
#include "urban_gnss_localization/pipeline/bias_pipeline.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"
#include "urban_gnss_localization/pipeline/occlusion_pipeline.hpp"
#include "urban_gnss_localization/simulation/city_simulator.hpp"
#include "urban_gnss_localization/simulation/paper_field.hpp"
#include "urban_gnss_localization/simulation/scenario_world.hpp"

namespace urban_gnss {
namespace {

using Values = std::map<std::string, YAML::Node>;

std::string read_text(const std::string& file) {
  std::ifstream in(package_directory() + "/" + file);
  EXPECT_TRUE(in) << file;
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

YAML::Node load(const std::string& file) { return YAML::Load(read_text("config/" + file)); }

Values values_of(const YAML::Node& map) {
  Values values;
  for (const auto& entry : map) {
    EXPECT_TRUE(values.emplace(entry.first.as<std::string>(), entry.second).second) << entry.first << " twice";
  }
  return values;
}

template <class... P>
Values defaults_of(const P&... parameters) {
  ParameterWriter writer;
  (writer.write(parameters), ...);
  return values_of(writer.map());
}

/// Names and defaults that a file of the ROS side declares, read from its text: these tests know no ROS.
Values declared_in(const std::string& source) {
  const std::string text = read_text(source);
  const std::regex visited("\\bv\\(\"(\\w+)\", (\\w+)");
  Values values;
  for (std::sregex_iterator it(text.begin(), text.end(), visited), end; it != end; ++it) {
    const std::regex declared("\\b" + (*it)[2].str() + "\\{([^}]*)\\};");
    std::smatch match;
    EXPECT_TRUE(std::regex_search(text, match, declared)) << source << ": " << (*it)[2] << " has no default";
    const std::string value = match.empty() ? "" : match[1].str();
    values[(*it)[1].str()] = YAML::Load(value.find(',') != std::string::npos ? "[" + value + "]" : value);
  }
  EXPECT_FALSE(values.empty()) << source;
  return values;
}

Values merged(Values a, const Values& b) {
  for (const auto& [name, value] : b) EXPECT_TRUE(a.emplace(name, value).second) << name << " twice";
  return a;
}

std::string text_of(const YAML::Node& value) {
  if (value.IsScalar()) return value.Scalar();
  YAML::Emitter out;
  out << YAML::Flow << value;
  return out.c_str();
}

bool is_equal(const YAML::Node& a, const YAML::Node& b) {
  if (a.IsSequence() && b.IsSequence()) {
    return a.size() == b.size() &&
           std::equal(a.begin(), a.end(), b.begin(), [](const auto& x, const auto& y) { return is_equal(x, y); });
  }
  if (!a.IsScalar() || !b.IsScalar()) return false;
  double x = 0.0;
  double y = 0.0;
  if (YAML::convert<double>::decode(a, x) && YAML::convert<double>::decode(b, y)) return x == y;
  return a.Scalar() == b.Scalar();
}

void expect_states(const Values& file, const Values& defaults) {
  for (const auto& [name, value] : defaults) {
    const auto stated = file.find(name);
    if (stated == file.end()) {
      ADD_FAILURE() << name << " is missing; its default is " << text_of(value);
    } else {
      EXPECT_TRUE(is_equal(stated->second, value))
          << name << " = " << text_of(stated->second) << "; the default is " << text_of(value);
    }
  }
  for (const auto& entry : file) EXPECT_TRUE(defaults.count(entry.first)) << entry.first << ": no such parameter";
}

/// The faults that the core's structs find in the values of a node, beside the names that its ROS side reads.
template <class... P>
std::vector<std::string> faults_in(const Values& values, const Values& others, P... parameters) {
  YAML::Node map;
  for (const auto& [name, value] : values) map[name] = value;
  ParameterReader reader(map);
  for (const auto& other : others) reader.ignore(other.first);
  (reader.read(parameters), ...);
  return reader.finish();
}

/// `base` with what the later file says otherwise, as rosparam does when one is loaded after the other.
Values overlaid(Values base, const Values& over) {
  for (const auto& [name, value] : over) base[name] = value;
  return base;
}

const char* const kNoFault = "";
std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

Values frames() { return declared_in("include/urban_gnss_localization/ros/conversions.hpp"); }
Values shell() { return merged(frames(), declared_in("include/urban_gnss_localization/ros/localizer_node.hpp")); }
Values filter_node() { return merged(shell(), declared_in("src/nodes/particle_filter_node.cpp")); }
Values controller_node() { return declared_in("src/nodes/waypoint_controller_node.cpp"); }
Values occlusion_node() {
  return merged(frames(), declared_in("include/urban_gnss_localization/ros/occlusion_node.hpp"));
}
Values simulator_node() {
  return merged(merged(frames(), declared_in("include/urban_gnss_localization/simulation_ros/simulation_messages.hpp")),
                declared_in("src/nodes/simulator_node.cpp"));
}

TEST(Config, LocalizationStatesEveryDefault) {
  expect_states(values_of(load("localization.yaml")), merged(shell(), defaults_of(LocalizationParameters())));
}

TEST(Config, ParticleFilterStatesEveryDefault) {
  expect_states(values_of(load("particle_filter.yaml")),
                merged(declared_in("src/nodes/particle_filter_node.cpp"),
                       merged(defaults_of(ParticleFilterParameters()), defaults_of(MotionParameters()))));
}

TEST(Config, UkfStatesEveryDefault) {
  expect_states(values_of(load("ukf.yaml")), merged(defaults_of(UkfParameters()), defaults_of(MotionParameters())));
}

TEST(Config, ImmEkfStatesEveryDefault) {
  const Values file = values_of(load("imm_ekf.yaml"));
  expect_states(file, merged(defaults_of(ImmEkfParameters()), defaults_of(MotionParameters())));
  EXPECT_EQ(joined(faults_in(merged(values_of(load("localization.yaml")), file), shell(), LocalizationParameters(),
                             ImmEkfParameters(), MotionParameters())),
            kNoFault);
}

TEST(Config, ComplementaryEkfStatesEveryDefault) {
  const Values file = values_of(load("complementary_ekf.yaml"));
  expect_states(file, defaults_of(ComplementaryEkfParameters()));
  EXPECT_EQ(joined(faults_in(merged(values_of(load("localization.yaml")), file), shell(), LocalizationParameters(),
                             ComplementaryEkfParameters())),
            kNoFault);
}

TEST(Config, GpsBiasStatesEveryDefault) {
  expect_states(values_of(load("gps_bias.yaml")), merged(frames(), defaults_of(BiasPipelineParameters())));
}

TEST(Config, WaypointControllerStatesEveryDefault) {
  expect_states(values_of(load("waypoint_controller.yaml")),
                merged(controller_node(), defaults_of(WaypointControllerParameters())));
}

TEST(Config, OcclusionStatesEveryDefault) {
  const Values file = values_of(load("occlusion.yaml"));
  // Each group by itself, so that a name that two of them use is found.
  const OcclusionPipelineParameters p;
  Values defaults = occlusion_node();
  for (const Values& group :
       {defaults_of(p.occlusion), defaults_of(p.visibility), defaults_of(p.local_map), defaults_of(p.voxels),
        defaults_of(p.aligner), defaults_of(p.voxel_tracer), defaults_of(p.covariance), defaults_of(p.consistency)}) {
    defaults = merged(defaults, group);
  }
  expect_states(file, defaults);
  EXPECT_EQ(joined(faults_in(file, occlusion_node(), p)), kNoFault);
}

TEST(Config, DefaultsAreReadWithoutFault) {
  const Values localizer = merged(values_of(load("localization.yaml")), values_of(load("particle_filter.yaml")));
  EXPECT_EQ(joined(faults_in(localizer, filter_node(), LocalizationParameters(), ParticleFilterParameters(),
                             MotionParameters())),
            kNoFault);
  EXPECT_EQ(joined(faults_in(merged(values_of(load("localization.yaml")), values_of(load("ukf.yaml"))), shell(),
                             LocalizationParameters(), UkfParameters(), MotionParameters())),
            kNoFault);
  EXPECT_EQ(joined(faults_in(values_of(load("gps_bias.yaml")), frames(), BiasPipelineParameters())), kNoFault);
  EXPECT_EQ(
      joined(faults_in(values_of(load("waypoint_controller.yaml")), controller_node(), WaypointControllerParameters())),
      kNoFault);
}

TEST(Config, PaperFieldIsReadWithoutFault) {
  const auto file = [](const char* name) { return values_of(load(std::string("paper_field/") + name)); };
  const Values localizer =
      overlaid(merged(values_of(load("localization.yaml")), values_of(load("particle_filter.yaml"))),
               merged(file("localization.yaml"), file("particle_filter.yaml")));
  EXPECT_EQ(joined(faults_in(localizer, filter_node(), LocalizationParameters(), ParticleFilterParameters(),
                             MotionParameters())),
            kNoFault);
  EXPECT_EQ(joined(faults_in(overlaid(values_of(load("gps_bias.yaml")), file("gps_bias.yaml")), frames(),
                             BiasPipelineParameters())),
            kNoFault);
  EXPECT_EQ(joined(faults_in(overlaid(values_of(load("waypoint_controller.yaml")), file("waypoint_controller.yaml")),
                             controller_node(), WaypointControllerParameters())),
            kNoFault);
  EXPECT_EQ(joined(faults_in(file("simulator.yaml"), simulator_node(), PaperFieldParameters(), MotionParameters())),
            kNoFault);
}

// What the localizer is told about the paper's field must be what the simulator and the controller do.
TEST(Config, PaperFieldAgreesWithItself) {
  const YAML::Node localizer = load("paper_field/localization.yaml");
  PaperFieldParameters field;
  ParameterReader(load("paper_field/simulator.yaml")).read(field);
  const auto start = localizer["initial_pose"].as<std::vector<double>>();
  ASSERT_EQ(start.size(), 3u);
  EXPECT_TRUE(near({start[0], start[1], start[2]}, field.start(), 1e-8));
  EXPECT_EQ(localizer["initial_position_sigma"].as<double>(), field.start_position_sigma);
  EXPECT_EQ(localizer["initial_heading_sigma"].as<double>(), field.start_heading_sigma);
  EXPECT_TRUE(is_equal(localizer["datum"], simulator_node().at("datum")));
  EXPECT_LT(localizer["fix_sigma_floor"].as<double>(), field.fix_direct_sigma);

  WaypointControllerParameters steering;
  ParameterReader(load("paper_field/waypoint_controller.yaml")).read(steering);
  const std::vector<double> targets = field.targets();
  ASSERT_EQ(steering.targets.size(), targets.size());
  for (std::size_t i = 0; i < targets.size(); ++i) EXPECT_NEAR(steering.targets[i], targets[i], 1e-8) << i;
}

TEST(Config, EveryScenarioIsReadWithoutFault) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(package_directory() + "/scenarios")) {
    ASSERT_EQ(entry.path().extension(), ".yaml") << entry.path();
    ++count;
    try {
      const Scenario scenario = load_scenario(entry.path().string());
      EXPECT_EQ(joined(world_faults(scenario.world, scenario.start.position())), kNoFault) << entry.path();
      EXPECT_NO_THROW(CitySimulator{scenario}) << entry.path();
    } catch (const std::exception& error) {
      ADD_FAILURE() << error.what();
    }
  }
  EXPECT_GE(count, 6);
}

// rosparam (YAML 1.1) and yaml-cpp (1.2) must take every value for the same thing.
TEST(Config, RosparamReadsTheSameValues) {
  const std::regex text_for_rosparam("[-+]?[0-9]+[eE].*|[-+]?[0-9.]+[eE][0-9].*");
  const std::regex boolean_for_rosparam("on|off|yes|no|y|n", std::regex::icase);
  for (const char* name :
       {"localization.yaml", "particle_filter.yaml", "complementary_ekf.yaml", "imm_ekf.yaml", "ukf.yaml",
        "gps_bias.yaml", "occlusion.yaml", "waypoint_controller.yaml", "paper_field/localization.yaml",
        "paper_field/particle_filter.yaml", "paper_field/gps_bias.yaml", "paper_field/waypoint_controller.yaml",
        "paper_field/simulator.yaml"}) {
    for (const auto& [key, value] : values_of(load(name))) {
      const YAML::Node list = value.IsSequence() ? value : YAML::Load("[" + text_of(value) + "]");
      for (const auto& element : list) {
        EXPECT_FALSE(std::regex_match(element.Scalar(), text_for_rosparam)) << name << ": " << key << " is a text";
        EXPECT_FALSE(std::regex_match(element.Scalar(), boolean_for_rosparam))
            << name << ": " << key << " is a boolean";
      }
    }
  }
}

TEST(Config, EveryDefaultIsExplained) {
  const std::regex parameter("(\\w+):.*");
  const std::regex explained("\\w+: .*# \\S.*");
  for (const char* name : {"localization.yaml", "particle_filter.yaml", "complementary_ekf.yaml", "imm_ekf.yaml",
                           "ukf.yaml", "gps_bias.yaml", "occlusion.yaml", "waypoint_controller.yaml"}) {
    std::istringstream lines(read_text(std::string("config/") + name));
    for (std::string line; std::getline(lines, line);) {
      if (!std::regex_match(line, parameter)) continue;
      EXPECT_TRUE(std::regex_match(line, explained)) << name << ": " << line;
    }
  }
}

}  // namespace
}  // namespace urban_gnss
