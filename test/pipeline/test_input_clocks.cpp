#include <gtest/gtest.h>

#include "urban_gnss_localization/pipeline/input_clocks.hpp"

namespace urban_gnss {
namespace {

struct Clocks {
  InputClocks clocks;
  std::vector<std::string> resets;

  explicit Clocks(bool reset_on_time_jump = true) : clocks({2.0, 1.0, reset_on_time_jump}) {}
  bool accept(InputStream stream, double time) {
    return clocks.accept(stream, from_seconds(time), [this](const std::string& why) { resets.push_back(why); });
  }
};

TEST(InputClocks, StampsAscendInEachStreamByItself) {
  Clocks clocks;
  EXPECT_TRUE(clocks.accept(InputStream::kOdometry, 10.0));
  EXPECT_FALSE(clocks.accept(InputStream::kOdometry, 10.0));
  EXPECT_FALSE(clocks.accept(InputStream::kOdometry, 9.0)) << "late";
  EXPECT_TRUE(clocks.accept(InputStream::kFixes, 5.0)) << "another stream";
  EXPECT_TRUE(clocks.accept(InputStream::kOdometry, 10.1));
  EXPECT_TRUE(clocks.resets.empty());
}

TEST(InputClocks, OneThatWasSetBackStartsAllAnew) {
  Clocks clocks;
  for (const InputStream stream : {InputStream::kOdometry, InputStream::kFixes, InputStream::kImu}) {
    EXPECT_TRUE(clocks.accept(stream, 100.0));
  }
  EXPECT_TRUE(clocks.accept(InputStream::kFixes, 95.5));
  ASSERT_EQ(clocks.resets.size(), 1u);
  EXPECT_EQ(clocks.resets[0], "the clock of the fixes jumped back by 4.5 s");
  EXPECT_TRUE(clocks.accept(InputStream::kOdometry, 95.0)) << "no second reset";
  EXPECT_TRUE(clocks.accept(InputStream::kImu, 95.0));
  EXPECT_FALSE(clocks.accept(InputStream::kFixes, 95.5)) << "the message that showed the jump counts";
  EXPECT_EQ(clocks.resets.size(), 1u);
}

TEST(InputClocks, JumpIsNotFollowedWhereThatIsNotWanted) {
  Clocks clocks(false);
  EXPECT_TRUE(clocks.accept(InputStream::kImu, 100.0));
  EXPECT_FALSE(clocks.accept(InputStream::kImu, 50.0));
  EXPECT_TRUE(clocks.accept(InputStream::kImu, 100.1));
  EXPECT_TRUE(clocks.resets.empty());
}

}  // namespace
}  // namespace urban_gnss
