#include <gtest/gtest.h>

#include "urban_gnss_localization/pipeline/stream_offsets.hpp"

namespace urban_gnss {
namespace {

Stamp at(double time_s) { return from_seconds(1e9 + time_s); }

/// A minute of odometry at `odometry_hz`, beside it a stream whose stamps are ahead and which comes late.
std::vector<PipelineEvent> run(InputStream stream, double ahead_s, double late_s, double odometry_hz, double stream_hz,
                               StreamOffsets& offsets) {
  std::vector<PipelineEvent> events;
  double next_s = 0.0;
  for (int k = 0; k < 60.0 * odometry_hz; ++k) {
    const double now_s = k / odometry_hz;
    for (; next_s + late_s <= now_s; next_s += 1.0 / stream_hz) offsets.add(stream, at(next_s + ahead_s));
    offsets.add_odometry(at(now_s), events);
  }
  return events;
}

TEST(StreamOffsets, SaysNothingOfClocksThatAgree) {
  for (const double odometry_hz : {1.0, 20.0, 200.0}) {
    for (const auto& [stream, late_s, stream_hz] : {std::tuple{InputStream::kImu, 0.01, 100.0},
                                                    {InputStream::kImu, 0.2, 10.0},
                                                    {InputStream::kImu, 0.0, 1.0},
                                                    {InputStream::kFixes, 1.5, 1.0},
                                                    {InputStream::kFixes, 0.0, 10.0},
                                                    {InputStream::kVelocities, 0.8, 5.0}}) {
      StreamOffsets offsets;
      EXPECT_TRUE(run(stream, 0.0, late_s, odometry_hz, stream_hz, offsets).empty()) << odometry_hz;
      EXPECT_FALSE(offsets.offset_s(stream));
    }
  }
}

TEST(StreamOffsets, NamesStreamAndOffsetOnce) {
  const struct {
    InputStream stream;
    double ahead_s, late_s, stream_hz;
    const char* text;
  } cases[] = {
      {InputStream::kImu, 1.0, 0.01, 100.0, "IMU are 1.0 s ahead"},
      {InputStream::kImu, -3.1, 0.01, 100.0, "IMU are 3.1 s behind"},
      {InputStream::kFixes, 3.0, 0.1, 1.0, "fixes are 2.9 s ahead"},
      {InputStream::kFixes, 18.0, 0.1, 1.0, "GPS time in place of UTC"},
      {InputStream::kFixes, -37.0, 0.1, 1.0, "TAI"},
      {InputStream::kVelocities, 7200.0, 0.0, 5.0, "a time zone"},
      {InputStream::kImu, -9.9e8, 0.0, 100.0, "time since the start"},
  };
  for (const auto& each : cases) {
    for (const double odometry_hz : {2.0, 20.0, 100.0}) {
      StreamOffsets offsets;
      const auto events = run(each.stream, each.ahead_s, each.late_s, odometry_hz, each.stream_hz, offsets);
      ASSERT_EQ(events.size(), 1u) << each.text << ' ' << odometry_hz;
      EXPECT_EQ(events[0].level, PipelineEvent::Level::kWarn);
      const bool is_coarse = odometry_hz < 10.0 && std::string(each.text).find(" s ") != std::string::npos;
      if (!is_coarse) {
        EXPECT_NE(events[0].text.find(each.text), std::string::npos) << events[0].text;
      }
      EXPECT_NEAR(*offsets.offset_s(each.stream), each.ahead_s, 0.6);
    }
  }
}

TEST(StreamOffsets, OdometryThatPausesIsNoOffset) {
  StreamOffsets offsets;
  std::vector<PipelineEvent> events;
  for (int k = 0; k < 3000; ++k) {
    offsets.add(InputStream::kImu, at(0.01 * k));
    const bool pauses = k / 300 % 2 == 1;
    if (!pauses && k % 5 == 0) offsets.add_odometry(at(0.01 * k), events);
  }
  EXPECT_TRUE(events.empty());
}

}  // namespace
}  // namespace urban_gnss
