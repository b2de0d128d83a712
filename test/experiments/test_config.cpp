// The files in config/paper_field and scenarios/ and the structs that read them. Those in config/ are made of the structs
// (test/python/test_parameters.py).

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <filesystem>

#include "matchers.hpp"
#include "package_directory.hpp"
#include "urban_gnss_localization/control/waypoint_controller.hpp"
#include "urban_gnss_localization/parameters/assignment.hpp"
#include "urban_gnss_localization/pipeline/bias_pipeline.hpp"
#include "urban_gnss_localization/pipeline/localization_parameters.hpp"
#include "urban_gnss_localization/simulation/city_simulator.hpp"
#include "urban_gnss_localization/simulation/paper_field.hpp"
#include "urban_gnss_localization/simulation/paper_field_simulator.hpp"
#include "urban_gnss_localization/simulation/scenario_world.hpp"

namespace urban_gnss {
namespace {

/// The struct as the file of the paper's field says.
template <class P>
P read_field_file(const std::string& name, P parameters = {}) {
  const std::string file = package_directory() + "/config/paper_field/" + name + ".yaml";
  ParameterReader reader(load_map(file), file, "", Layout::kTiered);
  reader.ignore("field");
  for (const std::string& fault : reader.read(parameters).finish()) ADD_FAILURE() << fault;
  return parameters;
}

struct FieldFile {
  PaperFieldParameters field;
  MotionParameters motion;

  void visit(ParameterVisitor& v) { WithMotion<PaperFieldParameters>{field, motion}.visit(v); }
};

// What the localizer is told about the paper's field must be what the simulator and the controller do.
TEST(Config, PaperFieldAgreesWithItself) {
  const PaperFieldParameters field = read_field_file<FieldFile>("simulator").field;
  const LocalizationParameters localizer = read_field_file<LocalizationParameters>("localization");
  const std::vector<double>& start = localizer.start.initial_pose;
  ASSERT_EQ(start.size(), 3u);
  EXPECT_TRUE(near({start[0], start[1], start[2]}, field.start(), 1e-8));
  EXPECT_EQ(localizer.start.initial_position_sigma, field.start_position_sigma);
  EXPECT_EQ(localizer.start.initial_heading_sigma, field.start_heading_sigma);
  const GeodeticPosition datum = PaperFieldSimulator::kDatum;
  EXPECT_EQ(localizer.datum.datum, (std::vector<double>{datum.latitude_deg, datum.longitude_deg, datum.altitude_m}));
  EXPECT_LT(localizer.input.fix_validation.fix_sigma_floor, field.fix_direct_sigma);
  const BiasPipelineParameters bias = read_field_file<BiasPipelineParameters>("gps_bias");
  EXPECT_EQ(bias.input.fix_validation.fix_sigma_floor, localizer.input.fix_validation.fix_sigma_floor);

  const auto steering = read_field_file<WaypointControllerParameters>("waypoint_controller");
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
      for (const auto& fault : world_faults(scenario.world, scenario.start.position())) ADD_FAILURE() << fault;
      EXPECT_NO_THROW(CitySimulator{scenario}) << entry.path();
    } catch (const std::exception& error) {
      ADD_FAILURE() << error.what();
    }
  }
  EXPECT_GE(count, 6);
}

}  // namespace
}  // namespace urban_gnss
