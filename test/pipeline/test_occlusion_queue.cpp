// A robot that stands south of a wall, whose clouds, fixes, satellites and transforms come in every order.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <set>
#include <stdexcept>

#include "satellite_sky.hpp"
#include "synthetic_walls.hpp"
#include "urban_gnss_localization/pipeline/occlusion_queue.hpp"

namespace urban_gnss {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;

constexpr double kLidarHeight_m = 2.0;

Stamp at(double seconds) { return from_seconds(1000.0 + seconds); }

Eigen::Isometry3d lifted(double height_m) { return Eigen::Isometry3d(Eigen::Translation3d(0.0, 0.0, height_m)); }

/// Transforms of pairs of frames, known from the first stamp to the last that was told.
class ToldFrames : public FrameSource {
 public:
  void tell_always(const std::string& parent, const std::string& child, const Eigen::Isometry3d& pose) {
    fixed_[{parent, child}] = pose;
  }
  void tell(const std::string& parent, const std::string& child, Stamp stamp) {
    moving_[{parent, child}].insert(stamp);
  }

  std::optional<Eigen::Isometry3d> find(const std::string& parent, const std::string& child, Stamp stamp) override {
    const auto fixed = fixed_.find({parent, child});
    if (fixed != fixed_.end()) return fixed->second;
    const std::set<Stamp>& stamps = moving_[{parent, child}];
    if (!stamps.empty() && stamp >= *stamps.begin() && stamp <= *stamps.rbegin()) return Eigen::Isometry3d::Identity();
    fault_ = child + " is not known in " + parent;
    return std::nullopt;
  }
  std::optional<Transform> newest(const std::string& parent, const std::string& child) override {
    const auto fixed = fixed_.find({parent, child});
    if (fixed != fixed_.end()) return Transform{Stamp(0), fixed->second};
    const std::set<Stamp>& stamps = moving_[{parent, child}];
    if (stamps.empty()) return std::nullopt;
    return Transform{*stamps.rbegin(), Eigen::Isometry3d::Identity()};
  }
  void forget() override { moving_.clear(); }
  const std::string& fault() const override { return fault_; }

 private:
  using Pair = std::pair<std::string, std::string>;
  std::map<Pair, Eigen::Isometry3d> fixed_;
  std::map<Pair, std::set<Stamp>> moving_;
  std::string fault_;
};

PointCloud wall_in_base() { return sampled({wall({-40.0, 10.0}, {40.0, 10.0}, 0.0, 20.0)}, 0.4); }

/// The first satellite is behind the wall.
Sky sky() {
  Sky satellites{satellite(1, 0, 30), satellite(2, 90, 40), satellite(3, 180, 30), satellite(4, 270, 45),
                 satellite(5, 135, 60)};
  for (auto& each : satellites) each.cn0_dbhz = 44.0;
  return satellites;
}

struct Settled {
  Stamp stamp;
  bool was_weighed;
  std::string missing;
  double first_blocked;  ///< share of the rays to the first satellite; NaN without map or satellites
};

class OcclusionQueueTest : public testing::Test {
 protected:
  OcclusionQueueTest() : OcclusionQueueTest(OcclusionQueueParameters()) {}
  explicit OcclusionQueueTest(const OcclusionQueueParameters& parameters)
      : queue(OcclusionPipelineParameters(), parameters, OcclusionFrames(), frames) {
    frames.tell_always("base_link", "lidar", lifted(kLidarHeight_m));
    frames.tell_always("base_link", "gps", lifted(kLidarHeight_m));
    frames.tell_always("map", "odom", Eigen::Isometry3d::Identity());
  }

  void tell_pose(double seconds) { frames.tell("odom", "base_link", at(seconds)); }
  void add_cloud(double seconds, const std::string& frame = "lidar") {
    queue.add_cloud({at(seconds), frame, [] { return transformed(wall_in_base(), lifted(-kLidarHeight_m)); }});
  }
  void add_satellites(double seconds) { queue.add_satellites({at(seconds), sky(), 0.0}); }
  void add_fix(double seconds, bool has_position = true) {
    const Stamp stamp = at(seconds);
    queue.add_fix({stamp, "gps", has_position, Eigen::Matrix2d(4.0 * Eigen::Matrix2d::Identity()),
                   [this, stamp](const FixAssessment* fix) {
                     const bool is_judged = fix != nullptr && !fix->satellites.empty() && fix->has_map;
                     settled.push_back({stamp, fix != nullptr, fix != nullptr ? fix->missing : "",
                                        is_judged ? fix->satellites.front().blocked_fraction
                                                  : std::numeric_limits<double>::quiet_NaN()});
                   }});
  }
  void work() {
    while (queue.work()) {
    }
  }
  /// An epoch with all that belongs to it.
  void epoch(double seconds) {
    tell_pose(seconds);
    add_cloud(seconds);
    add_satellites(seconds);
    add_fix(seconds);
    work();
  }
  std::string said() {
    std::string text;
    for (const PipelineEvent& event : queue.take_events()) text += event.text + "\n";
    return text;
  }

  ToldFrames frames;
  OcclusionQueue queue;
  std::vector<Settled> settled;
};

TEST_F(OcclusionQueueTest, AFixIsWeighedByMapAndSatellites) {
  epoch(0.0);
  ASSERT_EQ(settled.size(), 1U);
  EXPECT_EQ(settled[0].missing, "");
  EXPECT_EQ(settled[0].first_blocked, 1.0);
  EXPECT_EQ(queue.source(), VisibilitySource::kLidarAndSatellites);
  EXPECT_THAT(said(), HasSubstr("antenna at"));
  EXPECT_EQ(queue.tally().clouds_in_map, 1U);
  EXPECT_EQ(queue.tally().fixes_weighed, 1U);
}

TEST_F(OcclusionQueueTest, CloudAndFixWaitForTheirTransform) {
  tell_pose(0.0);
  EXPECT_FALSE(queue.has_waiting());
  add_cloud(0.3);
  EXPECT_TRUE(queue.has_waiting());
  add_satellites(0.3);
  add_fix(0.3);
  work();
  EXPECT_THAT(settled, IsEmpty());
  EXPECT_EQ(queue.tally().clouds_in_map, 0U);
  EXPECT_TRUE(queue.has_waiting());
  tell_pose(0.4);
  work();
  EXPECT_FALSE(queue.has_waiting());
  ASSERT_EQ(settled.size(), 1U);
  EXPECT_EQ(settled[0].first_blocked, 1.0) << "the cloud goes in first";
}

TEST_F(OcclusionQueueTest, AFixThatIsSettledAloneDoesNotWaitForTheCloudsBeforeIt) {
  epoch(1.0);
  tell_pose(1.2);
  add_cloud(1.1);
  add_cloud(1.2);
  add_satellites(1.2);
  add_fix(1.2);
  queue.settle_fixes();
  EXPECT_EQ(settled.size(), 2u);
  EXPECT_TRUE(queue.has_waiting()) << "two clouds";
  EXPECT_EQ(queue.tally().clouds_in_map, 1u) << "that of the epoch before";
  work();
  EXPECT_EQ(queue.tally().clouds_in_map, 3u);
}

TEST_F(OcclusionQueueTest, NothingWaitsForATransformThatDoesNotCome) {
  tell_pose(0.0);
  add_cloud(0.2);
  add_fix(0.2);
  add_fix(0.6);
  work();
  EXPECT_THAT(settled, IsEmpty());
  add_fix(0.8);  // tf_timeout is 0.5 s by the fixes' stamps
  work();
  ASSERT_EQ(settled.size(), 1U);
  EXPECT_THAT(settled[0].missing, HasSubstr("the robot's pose in the odometry frame"));
  EXPECT_THAT(queue.tally().clouds_left_out, ElementsAre(Pair("no transform at its stamp", 1U)));
  EXPECT_THAT(said(), HasSubstr("base_link is not known in odom"));
}

TEST_F(OcclusionQueueTest, WithoutAnyTransformAFixDoesNotWait) {
  add_fix(0.0);
  work();
  ASSERT_EQ(settled.size(), 1U);
  EXPECT_THAT(queue.tally().fixes_without, ElementsAre(Pair(settled[0].missing, 1U)));
}

TEST_F(OcclusionQueueTest, AFixWaitsForItsSatellitesUntilTheNext) {
  epoch(0.0);
  for (const double seconds : {0.2, 0.4}) tell_pose(seconds);
  add_fix(0.2);
  work();
  EXPECT_EQ(settled.size(), 1U) << "the one before had its own";
  add_satellites(0.2);
  work();
  EXPECT_EQ(settled.size(), 2U);
  add_fix(0.4);
  work();
  EXPECT_EQ(settled.size(), 2U);
  tell_pose(0.6);
  add_fix(0.6);
  work();
  EXPECT_EQ(settled.size(), 4U) << "0.4 had none, so that 0.6 does not wait for any";
}

TEST_F(OcclusionQueueTest, OfTooManyCloudsTheOldestIsDroppedAndCounted) {
  for (int i = 0; i < 8; ++i) add_cloud(0.1 * i);
  EXPECT_THAT(queue.tally().clouds_left_out, ElementsAre(Pair("too many wait", 3U)));
  EXPECT_THAT(said(), HasSubstr("1 of 6 clouds dropped"));
  tell_pose(0.0);
  tell_pose(0.7);
  work();
  EXPECT_EQ(queue.tally().clouds_in_map, 5U);
  EXPECT_EQ(queue.tally().clouds, 8U);
}

TEST_F(OcclusionQueueTest, ACloudThatCannotBeReadIsLeftOutAndCounted) {
  tell_pose(0.0);
  queue.add_cloud({at(0.0), "lidar", []() -> PointCloud { throw std::invalid_argument("no field z"); }});
  add_cloud(0.0);
  add_cloud(0.0);  // not newer
  work();
  EXPECT_EQ(queue.tally().clouds_in_map, 1U);
  EXPECT_THAT(queue.tally().clouds_left_out,
              ElementsAre(Pair("no field z", 1U), Pair("not newer than the cloud before it", 1U)));
  EXPECT_EQ(queue.tally().all_clouds_left_out(), 2U);
  EXPECT_THAT(said(), HasSubstr("cloud left out, no field z"));
}

TEST_F(OcclusionQueueTest, AFixWithoutPositionKeepsItsTurn) {
  tell_pose(0.0);
  add_fix(0.1);  // waits
  add_fix(0.2, false);
  work();
  EXPECT_THAT(settled, IsEmpty());
  tell_pose(0.2);
  work();
  ASSERT_EQ(settled.size(), 2U);
  EXPECT_TRUE(settled[0].was_weighed);
  EXPECT_FALSE(settled[1].was_weighed);
  EXPECT_EQ(queue.tally().fixes_without_position, 1U);
}

TEST_F(OcclusionQueueTest, AFixThatIsNotNewerIsLeftOutAndCounted) {
  tell_pose(0.0);
  tell_pose(1.0);
  for (const double seconds : {0.6, 0.6, 0.4}) add_fix(seconds);
  work();
  EXPECT_EQ(settled.size(), 1U);
  EXPECT_EQ(queue.tally().fixes_left_out, 2U);
  EXPECT_THAT(said(), HasSubstr("not newer than the one before"));
}

TEST_F(OcclusionQueueTest, AClockThatIsSetBackStartsAnew) {
  epoch(500.0);
  for (const double seconds : {0.0, 0.2}) add_fix(seconds);  // two that may have wrong stamps
  EXPECT_THAT(said(), HasSubstr("fix held back"));
  add_fix(0.4);
  EXPECT_THAT(said(), HasSubstr("the clock was set back by 499.6 s"));
  // A transform of the former clock that comes late is forgotten again.
  frames.tell("odom", "base_link", at(500.1));
  add_fix(0.6);
  EXPECT_FALSE(frames.newest("odom", "base_link"));
  for (double seconds = 0.8; seconds < 1.9; seconds += 0.2) epoch(seconds);
  ASSERT_GT(settled.size(), 5U);
  EXPECT_EQ(settled[1].stamp, at(0.0)) << "those that were held back are weighed, too";
  EXPECT_THAT(settled[1].missing, HasSubstr("pose")) << "nothing is known of them any more";
  EXPECT_EQ(settled.back().first_blocked, 1.0);
  EXPECT_EQ(queue.tally().fixes_left_out, 0U);
}

TEST_F(OcclusionQueueTest, OneOddStampStartsNothingAnew) {
  double base_s = 0.0;
  for (const double odd_s : {-100.0, 30.0, 3600.0, 4e9}) {
    for (double seconds = 0.0; seconds < 1.9; seconds += 0.2) epoch(base_s + seconds);
    add_fix(base_s + 2.0 + odd_s);
    add_cloud(base_s + 2.0 + odd_s);
    for (double seconds = 2.0; seconds < 3.9; seconds += 0.2) epoch(base_s + seconds);
    EXPECT_EQ(settled.back().first_blocked, 1.0) << odd_s;
    base_s += 4.0;
  }
  EXPECT_EQ(queue.tally().fixes_left_out, 4U);
  EXPECT_EQ(queue.tally().clouds_left_out.at("its stamp is odd"), 4U);
  EXPECT_THAT(said(), testing::Not(HasSubstr("started anew")));
}

TEST_F(OcclusionQueueTest, TheEndSettlesAllThatWaits) {
  epoch(0.0);
  add_cloud(0.3);
  add_fix(0.2);
  add_fix(0.3);
  work();
  EXPECT_EQ(settled.size(), 1U);
  queue.finish();
  EXPECT_EQ(settled.size(), 3U);
  EXPECT_EQ(queue.tally().clouds, queue.tally().clouds_in_map + queue.tally().all_clouds_left_out());
}

TEST_F(OcclusionQueueTest, APriorMapComesWithTheFirstHeadingAndStays) {
  queue.set_prior_map(wall_in_base());
  EXPECT_EQ(queue.pipeline().local_map().map().size(), 0U);
  work();
  const std::size_t whole = queue.pipeline().local_map().map().size();
  EXPECT_GT(whole, 100U);
  queue.clear_map();
  EXPECT_EQ(queue.pipeline().local_map().map().size(), 0U);
  work();
  EXPECT_EQ(queue.pipeline().local_map().map().size(), whole);
}

TEST_F(OcclusionQueueTest, AHeadingThatIsNotKnownIsMissing) {
  queue.set_yaw_variance(-1.0);
  epoch(0.0);
  ASSERT_EQ(settled.size(), 1U);
  EXPECT_EQ(settled[0].missing, "a heading");
}

TEST_F(OcclusionQueueTest, TheSameIsSaidOnceInTenSeconds) {
  int count = 0;
  for (int i = 0; i < 30; ++i) {
    add_fix(i);
    work();
    for (const PipelineEvent& event : queue.take_events()) count += event.text.rfind("without ", 0) == 0 ? 1 : 0;
  }
  EXPECT_EQ(count, 3);
}

struct OfTwo : OcclusionQueueTest {
  OfTwo()
      : OcclusionQueueTest([] {
          OcclusionQueueParameters parameters;
          parameters.cloud_queue = 2;
          parameters.tf_timeout = 0.1;
          parameters.time_jump = 0.1;
          return parameters;
        }()) {}
};

TEST_F(OfTwo, ItsParametersHaveAnEffect) {
  tell_pose(-1.0);
  for (int i = 0; i < 3; ++i) add_cloud(0.1 * i);
  EXPECT_EQ(queue.tally().all_clouds_left_out(), 1U);
  for (const double seconds : {0.0, 0.09, 0.18}) add_fix(seconds);
  work();
  EXPECT_EQ(settled.size(), 1U) << "tf_timeout";
  for (const double seconds : {0.05, 0.06, 0.07}) add_fix(seconds);
  EXPECT_THAT(said(), HasSubstr("the clock was set back")) << "time_jump";
}

}  // namespace
}  // namespace urban_gnss
