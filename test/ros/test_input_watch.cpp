#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "urban_gnss_localization/ros/input_watch.hpp"

namespace urban_gnss {
namespace {

using testing::HasSubstr;

TEST(InputWatch, AFrameThatChangesIsSaid) {
  EventLog log;
  InputWatch watch(log);
  EXPECT_EQ(watch.fault_of_frame("gps"), "");
  EXPECT_EQ(watch.fault_of_frame("gps"), "");
  EXPECT_THAT(watch.fault_of_frame("antenna"), HasSubstr("from 'gps' to 'antenna'"));
  EXPECT_EQ(watch.fault_of_frame("antenna"), "");
}

TEST(InputWatch, AFrameThatIsNotToldIsNoOther) {
  EventLog log;
  InputWatch watch(log);
  for (const char* frame : {"", "gps", "", "gps"}) EXPECT_EQ(watch.fault_of_frame(frame), "") << "'" << frame << "'";
  EXPECT_NE(watch.fault_of_frame("other"), "");
  EXPECT_EQ(watch.fault_of_frame(""), "");
  EXPECT_NE(watch.fault_of_frame("gps"), "");
}

TEST(InputWatch, TwoPublishersAreSaidOnce) {
  EventLog log;
  InputWatch watch(log);
  for (const std::uint32_t count : {0u, 1u, 1u}) EXPECT_EQ(watch.fault_of_publishers(count), "");
  EXPECT_THAT(watch.fault_of_publishers(2), HasSubstr("2 publishers"));
  EXPECT_EQ(watch.fault_of_publishers(2), "");
  EXPECT_EQ(watch.fault_of_publishers(1), "");
  EXPECT_THAT(watch.fault_of_publishers(3), HasSubstr("3 publishers"));
}

}  // namespace
}  // namespace urban_gnss
