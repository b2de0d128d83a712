#include <gtest/gtest.h>

#include "urban_gnss_localization/parameters/parameter_reader.hpp"
#include "urban_gnss_localization/parameters/params_file.hpp"

namespace urban_gnss {
namespace {

ParamsFile look(const std::string& yaml, const std::vector<std::string>& nodes = {"imm_ekf"}) {
  return look_through_params(YAML::Load(yaml), nodes);
}

TEST(ParamsFile, SectionsOfNodesAreFine) {
  for (const char* yaml : {"imm_ekf: {direct_sigma: 4}", "{imm_ekf: {direct_sigma: 4}, ukf: {expert: {}}}",
                           "/imm_ekf/direct_sigma: 4", "/robot1: {imm_ekf: {direct_sigma: 4}}"}) {
    const auto found = look(yaml);
    EXPECT_TRUE(found.faults.empty()) << yaml << ": " << found.faults[0];
    EXPECT_EQ(found.hint, "") << yaml;
  }
}

TEST(ParamsFile, WhatNobodyReadsIsRefused) {
  const std::pair<const char*, const char*> cases[] = {
      {"{direct_sigma: 4, antenna_offset: [0.1, 0]}", "direct_sigma stands outside of a section"},
      {"imm_ekf_node: {direct_sigma: 4}", "the node is called imm_ekf"},
      {"{imm_efk: {direct_sigma: 4}, ukf: {}}", "section imm_efk is not read; did you mean imm_ekf?"},
      {"{imm_ekf: {direct_sigma: 4}, publish_tf: false}", "publish_tf stands outside"},
      {"expert: {imu: {use_imu_yaw_rate: false}}", "expert stands outside"},
      {"imm_ekf: [4]", "imm_ekf must be a map"},
      {"{imm_ekf: {}, ukf: }", "ukf is empty: write ukf: {}"},
      {"[1, 2]", "must be a map"},
      {"", "must be a map"}};
  for (const auto& [yaml, fault] : cases) {
    const auto found = look(yaml);
    ASSERT_FALSE(found.faults.empty()) << yaml;
    EXPECT_NE(found.faults[0].find(fault), std::string::npos) << found.faults[0];
  }
  EXPECT_EQ(look("{direct_sigma: 4, antenna_offset: [0.1, 0]}").faults.size(), 2u);
}

TEST(ParamsFile, OfSeveralNodesOneSectionIsEnough) {
  const std::vector<std::string> nodes{"imm_ekf", "gps_bias"};
  EXPECT_EQ(look("gps_bias: {mode: paper}", nodes).hint, "");
  EXPECT_NE(look("ukf: {}", nodes).hint, "");
  EXPECT_FALSE(holds_section(YAML::Load("imm_ekf: {expert: {gps_bias: {bias_timeout: 1}}}"), "gps_bias"));
  EXPECT_EQ(look("{imm_ekf: {}, gps_bais: {}}", nodes).faults,
            std::vector<std::string>{"section gps_bais is not read; did you mean gps_bias?"});
  EXPECT_EQ(look("{imm_ekf: {}, mode: paper}", nodes).faults,
            std::vector<std::string>{"mode stands outside of a section and is not read: write imm_ekf: {mode: ...}"});
}

TEST(ParamsFile, OneThatIsOfOtherNodesIsAHint) {
  const auto found = look("{ukf: {direct_sigma: 4}, imm: {}}");
  EXPECT_TRUE(found.faults.empty());
  EXPECT_EQ(found.hint, "has no section imm_ekf, but ukf, imm: nothing is taken from it");
}

struct WithList {
  std::vector<double> datum;
  void visit(ParameterVisitor& v) { v("datum", datum, "deg, deg, m", "a list"); }
};

TEST(ParameterReader, TextThatIsAListIsAList) {
  WithList parameters;
  ParameterReader reader(YAML::Load("datum: '[48.1374, 11.5755, 520.0]'"));
  reader.read(parameters);
  EXPECT_TRUE(reader.finish().empty());
  EXPECT_EQ(parameters.datum, (std::vector<double>{48.1374, 11.5755, 520.0}));
  for (const char* bad : {"'[48.1, north]'", "north", "'48.1'", "'[1, .nan]'"}) {
    ParameterReader refusing(YAML::Load(std::string("datum: ") + bad));
    refusing.read(parameters);
    EXPECT_EQ(refusing.finish().size(), 1u) << bad;
  }
}

}  // namespace
}  // namespace urban_gnss
