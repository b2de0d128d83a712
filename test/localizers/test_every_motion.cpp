// Whatever way a robot moves, each localizer moves with it.

#include <gtest/gtest.h>

#include "matchers.hpp"
#include "urban_gnss_localization/localizers/registry.hpp"

namespace urban_gnss {
namespace {

struct NamedTwist {
  const char* name;
  Twist2 twist;
};

const NamedTwist kMotions[] = {{"forwards", {1.5, 0.1}},
                               {"backwards", {-1.5, 0.1}},
                               {"on the spot", {0.0, 0.6}},
                               {"to the left", {0.0, 0.1, 1.5}},
                               {"to the right and back", {-0.8, 0.0, -1.2}}};

FixMeasurement fix_at(const Eigen::Vector2d& position, double time_s) {
  FixMeasurement fix;
  fix.position = position;
  fix.covariance = isotropic(1.0);
  fix.time_s = time_s;
  fix.stamp = from_seconds(time_s);
  return fix;
}

TEST(EveryLocalizer, DeadReckonsEveryMotion) {
  const LocalizerRegistry registry = standard_localizers();
  for (const LocalizerEntry& entry : registry.entries()) {
    for (const auto& [name, twist] : kMotions) {
      const auto localizer = entry.settings()->make();
      Pose2 truth{3.0, -4.0, 0.5};
      localizer->initialize(pose_with_sigma(truth, 0.1, 0.01));
      for (int k = 0; k < 200; ++k) {
        localizer->move(twist, 0.1);
        truth = move(truth, twist, 0.1);
      }
      EXPECT_LT((localizer->pose().position() - truth.position()).norm(), 0.6) << entry.name << ' ' << name;
      EXPECT_LT(std::abs(angle_difference(localizer->pose().yaw, truth.yaw)), 0.05) << entry.name << ' ' << name;
    }
  }
}

TEST(EveryLocalizer, StaysOnItsFixesInEveryMotion) {
  const LocalizerRegistry registry = standard_localizers();
  for (const LocalizerEntry& entry : registry.entries()) {
    for (const auto& [name, twist] : kMotions) {
      RandomEngine engine = make_engine(5);
      const auto localizer = entry.settings()->make();
      Pose2 truth{3.0, -4.0, 0.5};
      localizer->initialize(pose_with_sigma(truth, 1.0, 0.1));
      for (int k = 1; k <= 600; ++k) {
        localizer->move(twist, 0.1);
        truth = move(truth, twist, 0.1);
        if (k % 10 != 0) continue;
        const Eigen::Vector2d noise(draw_normal(engine), draw_normal(engine));
        localizer->correct(fix_at(truth.position() + noise, 0.1 * k));
      }
      EXPECT_LT((localizer->pose().position() - truth.position()).norm(), 1.5) << entry.name << ' ' << name;
    }
  }
}

// Rollers that slip are wheels that are too large, forwards and sideways alike.
TEST(EveryLocalizer, ThatLearnsAScaleLearnsItSidewaysToo) {
  const Twist2 told{0.0, 0.05, 1.65};
  const Twist2 true_twist{0.0, 0.05, 1.5};
  for (const char* name : {"imm_ekf", "switching_particle_filter", "ukf", "complementary_ekf"}) {
    RandomEngine engine = make_engine(6);
    const auto localizer = standard_localizers().find(name).settings()->make();
    Pose2 truth{3.0, -4.0, 0.5};
    localizer->initialize(pose_with_sigma(truth, 0.3, 0.02));
    for (int k = 1; k <= 1800; ++k) {
      localizer->move(told, 0.1);
      truth = move(truth, true_twist, 0.1);
      if (k % 10 != 0) continue;
      const Eigen::Vector2d noise(0.3 * draw_normal(engine), 0.3 * draw_normal(engine));
      localizer->correct(fix_at(truth.position() + noise, 0.1 * k));
    }
    const Eigen::Vector2d before = localizer->pose().position() - truth.position();
    for (int k = 0; k < 200; ++k) {
      localizer->move(told, 0.1);
      truth = move(truth, true_twist, 0.1);
    }
    const Eigen::Vector2d after = localizer->pose().position() - truth.position();
    EXPECT_LT((after - before).norm(), 1.0) << name << ": 3 m without a scale";
  }
}

}  // namespace
}  // namespace urban_gnss
