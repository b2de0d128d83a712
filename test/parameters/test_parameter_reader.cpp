#include <gtest/gtest.h>

#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "urban_gnss_localization/parameters/parameter_list.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"

namespace urban_gnss {
namespace {

enum class Colour { kRed, kBlue };
EnumNames<Colour> enum_names(Colour) { return {{"red", Colour::kRed}, {"blue", Colour::kBlue}}; }

struct Example {
  double gate_probability{0.99};
  double mass_kg{2.0};
  int particle_count{500};
  bool enabled{true};
  std::string frame{"map"};
  Colour colour{Colour::kBlue};
  std::vector<double> offset{1.0, 2.0};

  void visit(ParameterVisitor& v) {
    v("gate_probability", gate_probability, between(0.0, 1.0), "", "of a good fix");
    v("mass_kg", mass_kg, positive(), "kg", "of the robot");
    v("particle_count", particle_count, at_least(1), "", "of particles");
    v("enabled", enabled, "whether it runs");
    v("frame", frame, "of the map");
    v("colour", colour, "of the robot");
    v("offset", offset, "m", "of the antenna");
  }
  void check(std::vector<std::string>& faults) const {
    if (mass_kg > 100.0 && particle_count < 10) faults.push_back("mass_kg: too heavy for so few particles");
  }
};

struct Outcome {
  Example parameters;
  std::vector<std::string> faults;
};

Outcome read(const std::string& yaml) {
  Outcome outcome;
  ParameterReader reader(YAML::Load(yaml));
  reader.read(outcome.parameters);
  outcome.faults = reader.finish();
  return outcome;
}

/// The only fault; a failure where there is none or there are several.
std::string fault(const std::string& yaml) {
  const Outcome outcome = read(yaml);
  EXPECT_EQ(outcome.faults.size(), 1u) << yaml;
  return outcome.faults.empty() ? "" : outcome.faults.front();
}

TEST(Parameters, ReadsEveryKind) {
  const auto [parameters, faults] = read(
      "{gate_probability: 0.5, mass_kg: 3, particle_count: 7, enabled: false, frame: world, "
      "colour: red, offset: [4, 5, 6]}");
  EXPECT_TRUE(faults.empty());
  EXPECT_EQ(parameters.gate_probability, 0.5);
  EXPECT_EQ(parameters.mass_kg, 3.0);
  EXPECT_EQ(parameters.particle_count, 7);
  EXPECT_FALSE(parameters.enabled);
  EXPECT_EQ(parameters.frame, "world");
  EXPECT_EQ(parameters.colour, Colour::kRed);
  EXPECT_EQ(parameters.offset, (std::vector<double>{4.0, 5.0, 6.0}));
}

TEST(Parameters, AListOfListsOfOneLengthIsOneList) {
  const auto [parameters, faults] = read("{offset: [[1, 2], [3, 4], [5, 6]]}");
  EXPECT_TRUE(faults.empty());
  EXPECT_EQ(parameters.offset, (std::vector<double>{1.0, 2.0, 3.0, 4.0, 5.0, 6.0}));
  for (const char* bad : {"[[1, 2], [3]]", "[[1, 2], 3]", "[[1, x], [2, 3]]", "[[[1]], [[2]]]"}) {
    EXPECT_NE(fault("{offset: " + std::string(bad) + "}").find("must be a list of numbers"), std::string::npos) << bad;
  }
  EXPECT_NE(fault("{offset: [[1, .nan]]}").find("finite"), std::string::npos);
}

TEST(Parameters, WhatIsAbsentKeepsItsDefault) {
  for (const char* yaml : {"{mass_kg: 3}", "{}", "", "~"}) {
    const auto [parameters, faults] = read(yaml);
    EXPECT_TRUE(faults.empty()) << yaml;
    EXPECT_EQ(parameters.gate_probability, 0.99);
    EXPECT_EQ(parameters.colour, Colour::kBlue);
    EXPECT_EQ(parameters.offset.size(), 2u);
  }
}

TEST(Parameters, MapMayBeUndefined) {
  const YAML::Node constant = YAML::Load("{a: 1}");
  YAML::Node variable = YAML::Load("{a: 1}");
  Example example;
  EXPECT_TRUE(ParameterReader(constant["absent"]).read(example).finish().empty());
  EXPECT_TRUE(ParameterReader(variable["absent"]).read(example).finish().empty());
  EXPECT_TRUE(ParameterReader(YAML::Node()).read(example).finish().empty());
}

TEST(Parameters, EveryFaultIsListedAtOnce) {
  const auto [parameters, faults] = read(
      "{gate_probability: 1.5, mass_kg: heavy, particle_count: 2.5, enabled: perhaps, colour: green, offset: 3, "
      "wings: 2}");
  ASSERT_EQ(faults.size(), 7u);
  EXPECT_EQ(faults[0], "gate_probability = 1.5: must be at least 0 and at most 1");
  EXPECT_EQ(faults[1], "mass_kg = heavy: must be a number");
  EXPECT_EQ(faults[2], "particle_count = 2.5: must be a whole number");
  EXPECT_EQ(faults[3], "enabled = perhaps: must be true or false");
  EXPECT_EQ(faults[4], "colour = green: must be one of red, blue");
  EXPECT_EQ(faults[5], "offset = 3: must be a list of numbers");
  EXPECT_EQ(faults[6], "wings: no such parameter");
}

TEST(Parameters, UnknownNameComesWithTheNearest) {
  EXPECT_EQ(fault("{gate_probabilty: 0.9}"), "gate_probabilty: no such parameter; did you mean gate_probability?");
  EXPECT_EQ(fault("{color: red}"), "color: no such parameter; did you mean colour?");
  EXPECT_EQ(fault("{[1, 2]: 3}"), "a parameter's name must be a text");
}

TEST(Parameters, NameThatSomeoneElseReadsIsIgnored) {
  Example example;
  ParameterReader reader(YAML::Load("{wings: 2}"));
  reader.ignore("wings");
  EXPECT_TRUE(reader.read(example).finish().empty());
}

TEST(Parameters, NotANumberIsInNoRange) {
  EXPECT_NE(fault("{gate_probability: .nan}").find("gate_probability = .nan"), std::string::npos);
  EXPECT_NE(fault("{mass_kg: .inf}").find("must be a finite number"), std::string::npos);
  EXPECT_NE(fault("{mass_kg: nan}").find("mass_kg"), std::string::npos);
  EXPECT_NE(fault("{offset: [1, .nan]}").find("finite"), std::string::npos);
  for (const double value : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    for (const Range& range : {any_number(), positive(), non_negative(), at_least(0.0), between(0.0, 1.0)}) {
      EXPECT_FALSE(range.contains(value));
      EXPECT_FALSE(range.contains(-value));
    }
  }
}

TEST(Parameters, RangesIncludeWhatTheySay) {
  EXPECT_FALSE(positive().contains(0.0));
  EXPECT_TRUE(positive().contains(1e-300));
  EXPECT_TRUE(non_negative().contains(0.0));
  EXPECT_TRUE(between(0.0, 1.0).contains(1.0));
  EXPECT_FALSE(between(0.0, 1.0).contains(1.0000001));
  EXPECT_EQ(positive().describe(), "a finite number greater than 0");
  EXPECT_EQ(between(0.0, 1.0).describe(), "at least 0 and at most 1");
}

TEST(Parameters, WholeNumbersDoNotWrapRound) {
  EXPECT_NE(fault("{particle_count: 99999999999}").find("whole number"), std::string::npos);
}

TEST(Parameters, ConditionsBetweenFieldsAreChecked) {
  EXPECT_EQ(fault("{mass_kg: 200, particle_count: 5}"), "mass_kg: too heavy for so few particles");
}

TEST(Parameters, WhatIsNoMapIsAFault) {
  EXPECT_EQ(fault("5"), "parameters must be a map of names to values");
  EXPECT_EQ(fault("[1, 2]"), "parameters must be a map of names to values");
}

std::vector<std::string> faults_in(const std::string& yaml, const std::string& source, const std::string& path) {
  Example example;
  ParameterReader reader(YAML::Load(yaml), source, path);
  return reader.read(example).finish();
}

TEST(Parameters, FaultSaysFileLineAndPath) {
  const auto faults = faults_in(
      "gate_probability: 0.5\n\nmass_kg: -1\nparticle_count: few\ncolour: green\noffset: [1,\n  .nan]\n"
      "wings: 2\n[1]: 2\n",
      "city.yaml", "receiver.");
  ASSERT_EQ(faults.size(), 6u);
  EXPECT_EQ(faults[0], "city.yaml:3: receiver.mass_kg = -1: must be a finite number greater than 0");
  EXPECT_EQ(faults[1], "city.yaml:4: receiver.particle_count = few: must be a whole number");
  EXPECT_EQ(faults[2], "city.yaml:5: receiver.colour = green: must be one of red, blue");
  EXPECT_EQ(faults[3], "city.yaml:6: receiver.offset = [1, .nan]: must be finite numbers");
  EXPECT_EQ(faults[4], "city.yaml:8: receiver.wings: no such parameter");
  EXPECT_EQ(faults[5], "city.yaml:9: a parameter's name must be a text");
}

TEST(Parameters, FaultBetweenFieldsHasTheLineOfTheFirstName) {
  const auto faults = faults_in("\nparticle_count: 5\nmass_kg: 200\n", "a.yaml", "");
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_EQ(faults[0], "a.yaml:3: mass_kg: too heavy for so few particles");
}

TEST(Parameters, PathWithoutSourceAndSourceWithoutLine) {
  EXPECT_EQ(faults_in("{mass_kg: 0}", "", "x.").at(0), "x.mass_kg = 0: must be a finite number greater than 0");
  EXPECT_EQ(faults_in("7", "a.yaml", "list[2].").at(0), "a.yaml:1: list[2] must be a map of names to values");
  YAML::Node made;
  made["mass_kg"] = 0;
  Example example;
  ParameterReader reader(made, "a.yaml");
  EXPECT_EQ(reader.read(example).finish().at(0), "a.yaml: mass_kg = 0: must be a finite number greater than 0");
}

TEST(Parameters, ChildIsReadByTheCallerAndKnown) {
  ParameterReader reader(YAML::Load("inner:\n  mass_kg: 0\nlist: [1, 2]\n"), "a.yaml");
  Example example;
  EXPECT_TRUE(reader.has("inner"));
  EXPECT_FALSE(reader.has("outer"));
  EXPECT_TRUE(reader.child("outer").IsNull());
  ParameterReader inner(reader.child("inner"), reader.source(), "inner.");
  reader.add(inner.read(example).finish());
  const YAML::Node list = reader.child("list");
  reader.fault(list[1], "list[1]", "is no good");
  reader.fault("list", "has two");
  reader.fault("outer", "is missing");
  const auto faults = reader.finish();
  ASSERT_EQ(faults.size(), 4u);
  EXPECT_EQ(faults[0], "a.yaml:2: inner.mass_kg = 0: must be a finite number greater than 0");
  EXPECT_EQ(faults[1], "a.yaml:3: list[1]: is no good");
  EXPECT_EQ(faults[2], "a.yaml:3: list: has two");
  EXPECT_EQ(faults[3], "a.yaml:1: outer: is missing");
}

TEST(Parameters, ChildOfWhatIsNoMapIsNull) {
  ParameterReader reader(YAML::Load("[1, 2]"));
  EXPECT_TRUE(reader.child("inner").IsNull());
  EXPECT_EQ(reader.finish().size(), 1u);
}

TEST(Parameters, SeveralStructsShareOneMap) {
  struct Other {
    double height_m{1.0};
    void visit(ParameterVisitor& v) { v("height_m", height_m, positive(), "m", "of the robot"); }
  } other;
  Example example;
  ParameterReader reader(YAML::Load("{height_m: 2.5, mass_kg: 4}"));
  EXPECT_TRUE(reader.read(example).read(other).finish().empty());
  EXPECT_EQ(other.height_m, 2.5);
  EXPECT_EQ(example.mass_kg, 4.0);
}

TEST(Parameters, WhatIsWrittenReadsBackTheSame) {
  Example written;
  written.mass_kg = 0.1 + 0.2;
  written.colour = Colour::kRed;
  written.offset = {1.0 / 3.0};
  YAML::Emitter text;
  text << ParameterList().add(written).values(Layout::kFlat);
  const auto [parameters, faults] = read(text.c_str());
  EXPECT_TRUE(faults.empty());
  EXPECT_EQ(parameters.mass_kg, written.mass_kg);
  EXPECT_EQ(parameters.colour, written.colour);
  EXPECT_EQ(parameters.offset, written.offset);
  EXPECT_EQ(parameters.frame, written.frame);
}

struct Station {
  double height_m{2.0};
  Example robot;

  void visit(ParameterVisitor& v) {
    v.basic()("height_m", height_m, positive(), "m", "of the mast");
    v.group("robot", robot, "that stands beside it");
  }
};

std::vector<std::string> faults_in_tiers(const std::string& yaml, Station* read = nullptr) {
  Station station;
  ParameterReader reader(YAML::Load(yaml), "a.yaml", "", Layout::kTiered);
  const auto faults = reader.read(station).finish();
  if (read != nullptr) *read = station;
  return faults;
}

TEST(TieredParameters, TierOneStandsAtTheTopAndTheRestBelowExpert) {
  Station station;
  EXPECT_TRUE(faults_in_tiers("{height_m: 3, expert: {robot: {mass_kg: 4, colour: red}}}", &station).empty());
  EXPECT_EQ(station.height_m, 3.0);
  EXPECT_EQ(station.robot.mass_kg, 4.0);
  EXPECT_EQ(station.robot.colour, Colour::kRed);
}

TEST(TieredParameters, FlatNameIsRefusedWithTheNewPlace) {
  EXPECT_EQ(faults_in_tiers("mass_kg: 4").at(0), "a.yaml:1: mass_kg: no such parameter; it is expert.robot.mass_kg");
  EXPECT_EQ(faults_in_tiers("robot: {mass_kg: 4}").at(0), "a.yaml:1: robot: no such parameter; it is expert.robot");
  EXPECT_EQ(faults_in_tiers("expert: {height_m: 4}").at(0),
            "a.yaml:1: expert.height_m: no such parameter; it is height_m");
  EXPECT_EQ(faults_in_tiers("expert: {robot: {mas_kg: 4}}").at(0),
            "a.yaml:1: expert.robot.mas_kg: no such parameter; did you mean expert.robot.mass_kg?");
}

TEST(TieredParameters, FormerNameIsRefusedWithTheNewOne) {
  struct Odometry {
    double speed_scale_sigma{0.02};
    void visit(ParameterVisitor& v) { v("speed_scale_sigma", speed_scale_sigma, non_negative(), "", "of the wheels"); }
  } odometry;
  ParameterReader reader(YAML::Load("odom_scale_sigma: 0.1"), "", "", Layout::kTiered);
  EXPECT_EQ(reader.read(odometry).finish().at(0),
            "odom_scale_sigma: no such parameter; it is now expert.speed_scale_sigma");
}

TEST(TieredParameters, FaultsNameThePlace) {
  EXPECT_EQ(faults_in_tiers("\nexpert:\n  robot:\n    mass_kg: -4").at(0),
            "a.yaml:4: expert.robot.mass_kg = -4: must be a finite number greater than 0");
  EXPECT_EQ(faults_in_tiers("expert: {robot: {mass_kg: 200, particle_count: 5}}").at(0),
            "a.yaml:1: expert.robot.mass_kg: too heavy for so few particles");
  EXPECT_EQ(faults_in_tiers("expert: {robot: 7}").at(0), "a.yaml:1: expert.robot: must be a map of names to values");
  EXPECT_EQ(faults_in_tiers("expert: 7").at(0), "a.yaml:1: expert: must be a map of names to values");
  EXPECT_TRUE(faults_in_tiers("expert:").empty());
}

TEST(TieredParameters, WhatIsWrittenReadsBackTheSame) {
  Station written;
  written.height_m = 0.1 + 0.2;
  written.robot.mass_kg = 1e-5;
  std::ostringstream text;
  write_yaml(text, "A station.", ParameterList().add(written));
  Station station;
  EXPECT_TRUE(faults_in_tiers(text.str(), &station).empty()) << text.str();
  EXPECT_EQ(station.height_m, written.height_m);
  EXPECT_EQ(station.robot.mass_kg, written.robot.mass_kg);
  EXPECT_NE(text.str().find("mass_kg: 1.0e-05"), std::string::npos) << "YAML 1.1 reads 1e-05 as a text";
  EXPECT_NE(text.str().find("# m, of the mast"), std::string::npos);
}

TEST(TieredParameters, DocumentationHasEveryParameter) {
  std::ostringstream text;
  write_markdown(text, ParameterList().add(Station()));
  EXPECT_NE(text.str().find("| `height_m` | `2.0` | m | a finite number greater than 0 | of the mast |"),
            std::string::npos)
      << text.str();
  EXPECT_NE(text.str().find("| `expert.robot.colour` | `blue` |  | red, blue | of the robot |"), std::string::npos);
}

TEST(Parameters, ErrorListsEveryFault) {
  const ParameterError one("node", {"a"});
  EXPECT_STREQ(one.what(), "node: 1 bad parameter\n  - a");
  const ParameterError two("node", {"a", "b"});
  EXPECT_STREQ(two.what(), "node: 2 bad parameters\n  - a\n  - b");
}

}  // namespace
}  // namespace urban_gnss
