#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>

#include "urban_gnss_localization/evaluation/stamp_text.hpp"
#include "urban_gnss_localization/evaluation/tum.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"

namespace {

using urban_gnss::angle_difference;
using urban_gnss::format_stamp;
using urban_gnss::kPi;
using urban_gnss::parse_stamp;
using urban_gnss::read_tum;
using urban_gnss::Stamp;
using urban_gnss::TimedPose;
using urban_gnss::Trajectory;
using urban_gnss::write_tum;

std::string error_of(const std::string& text) {
  std::istringstream in(text);
  try {
    read_tum(in);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TimedPose timed_pose(Stamp stamp, double x, double y, double yaw) {
  TimedPose pose;
  pose.stamp = stamp;
  pose.pose = {x, y, yaw};
  return pose;
}

TEST(StampText, KeepsEveryNanosecond) {
  // As a double this is 1432235498.0393476486, 52 ns off.
  EXPECT_EQ(parse_stamp("1432235498.039347700"), Stamp(1432235498039347700));
  EXPECT_EQ(parse_stamp("457633.000"), Stamp(457633000000000));
  EXPECT_EQ(parse_stamp("5"), Stamp(5000000000));
  EXPECT_EQ(parse_stamp(".5"), Stamp(500000000));
  EXPECT_EQ(parse_stamp("0.000000001"), Stamp(1));
  EXPECT_EQ(parse_stamp("-1.25"), Stamp(-1250000000));
}

TEST(StampText, ReadsPowersOfTen) {
  EXPECT_EQ(parse_stamp("1.432235498039347700e+09"), Stamp(1432235498039347700));
  EXPECT_EQ(parse_stamp("125E-2"), Stamp(1250000000));
  EXPECT_EQ(parse_stamp("1e-12"), Stamp(0));
}

TEST(StampText, RoundsBeyondTheNanosecond) {
  EXPECT_EQ(parse_stamp("0.0000000014"), Stamp(1));
  EXPECT_EQ(parse_stamp("0.0000000015"), Stamp(2));
  EXPECT_EQ(parse_stamp("0.9999999999"), Stamp(1000000000));
  EXPECT_EQ(parse_stamp("5e-10"), Stamp(1));
}

TEST(StampText, RefusesWhatIsNoStamp) {
  for (const char* text : {"", ".", "-", "abc", "1.0x", " 1", "1 ", "nan", "inf", "1e", "1e999999999999", "0x10",
                           "99999999999999999999", "1e12"}) {
    EXPECT_FALSE(parse_stamp(text).has_value()) << "'" << text << "'";
  }
}

TEST(StampText, WritesWhatItReads) {
  std::mt19937_64 generator(3);
  std::uniform_int_distribution<Stamp::rep> uniform(-2000000000000000000, 2000000000000000000);
  for (int i = 0; i < 1000; ++i) {
    const Stamp stamp(uniform(generator));
    EXPECT_EQ(parse_stamp(format_stamp(stamp)), stamp) << format_stamp(stamp);
  }
  EXPECT_EQ(format_stamp(Stamp(457633000000000)), "457633.000000000");
  EXPECT_EQ(format_stamp(Stamp(-1)), "-0.000000001");
}

TEST(Tum, WritesTheDocumentedText) {
  std::ostringstream out;
  write_tum(out, {timed_pose(Stamp(1432235498039347700), 1.5, -2.25, 0.0),
                  timed_pose(Stamp(1432235499000000000), -0.0, 1e-12, kPi)});
  EXPECT_EQ(out.str(),
            "1432235498.039347700 1.500000000 -2.250000000 0.000000000 "
            "0.000000000 0.000000000 0.000000000 1.000000000\n"
            "1432235499.000000000 0.000000000 0.000000000 0.000000000 "
            "0.000000000 0.000000000 1.000000000 0.000000000\n");
}

TEST(Tum, ReadsBackWhatItWrote) {
  std::mt19937_64 generator(11);
  std::uniform_real_distribution<double> metres(-5000.0, 5000.0);
  std::uniform_real_distribution<double> radians(-kPi, kPi);
  Trajectory written;
  for (int i = 0; i < 200; ++i) {
    written.push_back(timed_pose(Stamp(1432235498039347700) + i * Stamp(99999999), metres(generator), metres(generator),
                                 radians(generator)));
  }
  std::ostringstream out;
  write_tum(out, written);
  std::istringstream in(out.str());
  const Trajectory read = read_tum(in);
  ASSERT_EQ(read.size(), written.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].stamp, written[i].stamp);
    EXPECT_NEAR(read[i].pose.x, written[i].pose.x, 1e-9);
    EXPECT_NEAR(read[i].pose.y, written[i].pose.y, 1e-9);
    EXPECT_NEAR(angle_difference(read[i].pose.yaw, written[i].pose.yaw), 0.0, 4e-9);
  }
  std::ostringstream again;
  write_tum(again, written);
  EXPECT_EQ(again.str(), out.str());
}

TEST(Tum, ReadsOthersFiles) {
  std::istringstream in(
      "# stamp tx ty tz qx qy qz qw\r\n\r\n"
      "2.0 1 2 3 0 0 -2 2\r\n"                                               // not normalised: a quarter turn clockwise
      "1.0 4 5 6 0.6532814824 0.2705980501 0.2705980501 0.6532814824\r\n");  // yaw 45°, then a roll of 90°
  const Trajectory trajectory = read_tum(in);
  ASSERT_EQ(trajectory.size(), 2u);
  EXPECT_EQ(trajectory[0].stamp, Stamp(1000000000));
  EXPECT_EQ(trajectory[0].pose.x, 4.0);
  EXPECT_NEAR(trajectory[0].pose.yaw, 0.25 * kPi, 1e-9);
  EXPECT_EQ(trajectory[1].pose.y, 2.0);
  EXPECT_NEAR(trajectory[1].pose.yaw, -0.5 * kPi, 1e-12);
}

TEST(Tum, TakesAQuaternionOfAnyLength) {
  for (const char* length : {"1e200", "1e-200", "1.7e308", "5e-324"}) {
    std::istringstream in("1 0 0 0 0 0 " + std::string(length) + " " + length + "\n");
    EXPECT_NEAR(read_tum(in).at(0).pose.yaw, 0.5 * kPi, 1e-12) << length;
  }
}

TEST(Tum, NamesTheFaultyLine) {
  EXPECT_EQ(error_of("# comment\n1 0 0 0 0 0 0\n"), "line 2: fewer than eight numbers");
  EXPECT_EQ(error_of("1 0 0 0 0 0 0 1 7\n"), "line 1: more than eight numbers");
  EXPECT_EQ(error_of("1 0 x 0 0 0 0 1\n"), "line 1: 'x' is not a finite number");
  EXPECT_EQ(error_of("1 0 nan 0 0 0 0 1\n"), "line 1: 'nan' is not a finite number");
  EXPECT_EQ(error_of("now 0 0 0 0 0 0 1\n"), "line 1: 'now' is not a stamp");
  EXPECT_EQ(error_of("1 0 0 0 0 0 0 0\n"), "line 1: the quaternion is zero");
}

TEST(Tum, RefusesToWriteNaN) {
  std::ostringstream out;
  EXPECT_THROW(write_tum(out, {timed_pose(Stamp(1), std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0)}),
               std::invalid_argument);
}

}  // namespace
