#include <cmath>
#include <functional>

#include "pipeline_rig.hpp"
#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/pipeline/fix_delay.hpp"

namespace urban_gnss {
namespace {

/// A robot that winds its way for `duration_s`, whose wheels are 7 % too large, with fixes at 1 Hz that are older than
/// their stamps. Their errors last 20 s, but for white noise.
struct Winding {
  double delay_s{0.0};
  double duration_s{600.0};
  double white_m{0.3};
  double lasting_m{5.0};
  double speed_mps{1.3};
  bool is_straight{false};
  std::uint64_t seed{101};
};

FixDelayEstimator estimator_after(const Winding& d, const std::string& fix_delay = "auto") {
  FixDelayEstimator estimator({fix_delay});
  RandomEngine engine = make_engine(d.seed);
  OdometryHistory history(10.0);
  OdometryHistory truth(10.0);
  Eigen::Vector2d lasting = Eigen::Vector2d::Zero();
  const double kept = std::exp(-1.0 / 20.0);
  for (int k = 0; k < 10.0 * d.duration_s; ++k) {
    const Stamp stamp = from_seconds(100.0 + 0.1 * k);
    const double turn = d.is_straight ? 0.0 : 0.4 * std::sin(0.03 * k) + 0.2 * std::sin(0.011 * k);
    truth.add(stamp, {d.speed_mps, turn});
    history.add(stamp, {1.07 * d.speed_mps, turn + 0.01 * draw_normal(engine)});
    if (k < 100 || k % 10 != 0) continue;
    const double spread_m = d.lasting_m * std::sqrt(1.0 - kept * kept);
    lasting = kept * lasting + spread_m * Eigen::Vector2d(draw_normal(engine), draw_normal(engine));
    const Eigen::Vector2d white(d.white_m * draw_normal(engine), d.white_m * draw_normal(engine));
    const Pose2 then = *truth.pose_at(stamp - from_seconds(d.delay_s));
    estimator.add(stamp, transform_point(then, {0.4, 0.1}) + 0.1 * lasting + white, history, {0.4, 0.1});
  }
  return estimator;
}

TEST(FixDelay, IsFoundFromTheMotion) {
  for (const double delay_s : {0.5, 1.0, 1.6}) {
    for (std::uint64_t seed = 101; seed < 106; ++seed) {
      Winding d;
      d.delay_s = delay_s;
      d.seed = seed;
      FixDelayEstimator estimator = estimator_after(d);
      EXPECT_NEAR(estimator.delay_s(), delay_s, 0.25) << seed;
      const auto news = estimator.take_news();
      ASSERT_TRUE(news);
      EXPECT_NE(news->find("fixes come"), std::string::npos) << *news;
      EXPECT_FALSE(estimator.take_news()) << "told once";
    }
  }
}

TEST(FixDelay, NoneIsFoundWhereThereIsNone) {
  for (std::uint64_t seed = 101; seed < 121; ++seed) {
    Winding d;
    d.seed = seed;
    EXPECT_EQ(estimator_after(d).delay_s(), 0.0) << seed;
    d.white_m = 3.0;
    EXPECT_EQ(estimator_after(d).delay_s(), 0.0) << seed << ": fixes that say nothing";
  }
}

TEST(FixDelay, StraightWayAndSteadySpeedSayNothing) {
  Winding d;
  d.delay_s = 1.0;
  d.is_straight = true;
  EXPECT_EQ(estimator_after(d).delay_s(), 0.0);
}

TEST(FixDelay, OneThatIsGivenIsUsed) {
  Winding d;
  d.delay_s = 1.6;
  EXPECT_EQ(estimator_after(d, "0.7").delay_s(), 0.7);
  EXPECT_EQ(estimator_after(d, "0").delay_s(), 0.0);
}

TEST(FixDelay, BadParameterIsNamed) {
  for (const char* good : {"auto", "0", "0.0", "1.6", "5"}) {
    std::vector<std::string> faults;
    FixDelayParameters{good}.check(faults);
    EXPECT_TRUE(faults.empty()) << good;
  }
  for (const char* bad : {"", "soon", "-0.1", "5.1", "1.6 s", "nan", "inf"}) {
    std::vector<std::string> faults;
    FixDelayParameters{bad}.check(faults);
    ASSERT_EQ(faults.size(), 1u) << bad;
    EXPECT_EQ(faults[0].rfind("fix_delay", 0), 0u) << faults[0];
  }
}

// The robot of the rig drives an arc; its fixes are 0.8 s old.
TEST(FixDelay, FixIsComparedWithWhereTheRobotWasThen) {
  Rig rig("{datum: [33.0, 130.0, 20.0], initial_pose: [0.0, 0.0, 0.0], fix_delay: 0.8}");
  for (int k = 0; k <= 100; ++k) {
    rig.drive(0.1 * k);
    if (k >= 20 && k % 10 == 0) rig.pipeline.add_fix(raw_fix(Rig::at(0.1 * k), Rig::truth(0.1 * k - 0.8).position()));
  }
  ASSERT_FALSE(rig.fake->fixes.empty());
  for (const FixMeasurement& fix : rig.fake->fixes) {
    const Pose2 now = Rig::truth(fix.time_s - 1000.0);
    EXPECT_LT((transform_point(now, fix.antenna_in_body) - fix.position).norm(), 0.01) << fix.time_s;
  }
  EXPECT_EQ(rig.pipeline.report().fix_delay_s, 0.8);
}

}  // namespace
}  // namespace urban_gnss
