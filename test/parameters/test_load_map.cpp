#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "urban_gnss_localization/parameters/assignment.hpp"

namespace urban_gnss {
namespace {

/// What load_map says of a file with this text; empty where it takes it.
std::string fault_of(const std::string& text) {
  const std::string path = (std::filesystem::path(::testing::TempDir()) / "urban_gnss_load_map.yaml").string();
  std::ofstream(path) << text;
  std::string fault;
  try {
    load_map(path);
  } catch (const std::runtime_error& error) {
    fault = error.what();
    EXPECT_EQ(fault.compare(0, path.size(), path), 0) << fault;
  }
  std::filesystem::remove(path);
  return fault;
}

TEST(LoadMap, TakesMapsWithAliases) {
  EXPECT_EQ(fault_of(""), "");
  EXPECT_EQ(fault_of("a: &x {b: [1, 2]}\nc: *x\n"), "");
}

TEST(LoadMap, NamesTheFileOfWhatIsNone) {
  EXPECT_NE(fault_of("a: [1\n"), "");
  EXPECT_NE(fault_of("text\n"), "");
  EXPECT_NE(fault_of("a: *unknown\n"), "");
  EXPECT_NE(fault_of(std::string(20000, '[')), "");
}

TEST(LoadMap, RefusesWhatHasNoEnd) {
  EXPECT_NE(fault_of("a: &x [*x]\n").find("nested"), std::string::npos);
  EXPECT_NE(fault_of("a: &x {b: *x}\n").find("nested"), std::string::npos);
  std::string laughs = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n";
  for (int i = 1; i < 9; ++i) {
    const std::string below = "*a" + std::to_string(i - 1);
    laughs += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [" + below;
    for (int k = 1; k < 10; ++k) laughs += ", " + below;
    laughs += "]\n";
  }
  EXPECT_NE(fault_of(laughs).find("without end"), std::string::npos);
}

}  // namespace
}  // namespace urban_gnss
