#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <cstdint>
#include <string>

#include "matchers.hpp"
#include "urban_gnss_localization/pipeline/integrity_monitor.hpp"

namespace urban_gnss {
namespace {

/// Fixes each second with sigmas of 4 m, beside an estimate of 3 m: 5 m are claimed.
struct Fixes {
  IntegrityMonitor monitor{IntegrityParameters()};
  double interval_s{1.0};
  double time_s{0.0};  ///< of the last one
  double fix_sigma_m{4.0};

  bool add(const Eigen::Vector2d& offset) {
    time_s += interval_s;
    monitor.add({from_seconds(time_s), offset, isotropic(fix_sigma_m), isotropic(3.0)});
    return monitor.contradiction().has_value();
  }
  bool add(int count, const Eigen::Vector2d& offset) {
    for (int k = 1; k < count; ++k) add(offset);
    return add(offset);
  }
  /// Adds fixes until there is a contradiction, or none; their number, at most 1000.
  int add_until(bool contradicts, const Eigen::Vector2d& offset) {
    int count = 1;
    while (add(offset) != contradicts && count < 1000) ++count;
    return count;
  }
};

const Eigen::Vector2d kNone(0.0, 0.0);
const Eigen::Vector2d kFar(18.0, 24.0);  // 30 m

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(IntegrityMonitor, ErrorsOfTheDeclaredSizeAreNoContradiction) {
  Eigen::Matrix2d fix;
  fix << 25.0, 12.0, 12.0, 16.0;
  const Eigen::Matrix2d estimate = Eigen::Vector2d(1.0, 4.0).asDiagonal();
  const Eigen::Matrix2d root = Eigen::Matrix2d(fix + estimate).llt().matrixL();
  for (const double interval_s : {0.2, 1.0, 5.0}) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      IntegrityMonitor monitor{IntegrityParameters()};
      RandomEngine engine = make_engine(seed, 77);
      for (int k = 0; k < 1000; ++k) {
        const double first = draw_normal(engine);
        const double second = draw_normal(engine);
        monitor.add({from_seconds(interval_s * k), root * Eigen::Vector2d(first, second), fix, estimate});
        ASSERT_FALSE(monitor.contradiction()) << "fix " << k << " of seed " << seed << " each " << interval_s << " s";
      }
      EXPECT_TRUE(std::isnan(monitor.time_to_detect_s()));
      EXPECT_TRUE(std::isnan(monitor.time_to_recover_s()));
      EXPECT_FALSE(monitor.is_persistent());
    }
  }
}

TEST(IntegrityMonitor, OffsetIsFoundOnceItIsThatOfHalfTheWindow) {
  for (const Eigen::Vector2d& offset :
       {Eigen::Vector2d(18.0, 24.0), {-18.0, -24.0}, {-24.0, 18.0}, {30.0, 0.0}, {0.0, -30.0}}) {
    Fixes fixes;
    ASSERT_FALSE(fixes.add(60, kNone));
    const int count = fixes.add_until(true, offset);
    EXPECT_LE(count, 20) << offset.transpose();
    EXPECT_GT(count, 10) << offset.transpose() << ": a reflection lasts as long";
    const auto& found = fixes.monitor.contradiction();
    ASSERT_TRUE(found);
    EXPECT_EQ(found->found, from_seconds(fixes.time_s));
    EXPECT_TRUE(found->offset.isApprox(offset, 1e-9)) << found->offset.transpose();
    EXPECT_TRUE(contains(describe(*found), " 30.0 m")) << describe(*found);
    EXPECT_TRUE(contains(describe(*found), " 5.0 m")) << describe(*found);
  }
}

TEST(IntegrityMonitor, OffsetOfNoisyFixesIsFound) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    RandomEngine engine = make_engine(seed, 78);
    Fixes fixes;
    const auto noisy = [&](const Eigen::Vector2d& offset) {
      const double east = 4.0 * draw_normal(engine);
      return Eigen::Vector2d(offset + Eigen::Vector2d(east, 4.0 * draw_normal(engine)));
    };
    for (int k = 0; k < 60; ++k) ASSERT_FALSE(fixes.add(noisy(kNone))) << seed;
    int count = 1;
    while (!fixes.add(noisy(kFar)) && count < 100) ++count;
    EXPECT_LE(count, 20) << seed;
  }
}

// Three sigmas begin a contradiction, two end it.
TEST(IntegrityMonitor, EndsBelowTwoThirdsOfItsLimit) {
  const Eigen::Vector2d between(0.0, 12.5);
  Fixes fixes;
  EXPECT_FALSE(fixes.add(300, between)) << "2.5 sigmas";
  EXPECT_TRUE(fixes.add(60, {0.0, 15.5})) << "3.1 sigmas";
  EXPECT_TRUE(fixes.add(300, between));
  EXPECT_FALSE(fixes.add(60, {0.0, 9.5})) << "1.9 sigmas";
}

TEST(IntegrityMonitor, LastsForThePatience) {
  Fixes fixes;
  fixes.add(60, kNone);
  fixes.add_until(true, kFar);
  EXPECT_FALSE(fixes.monitor.is_persistent());
  fixes.add(19, kFar);
  EXPECT_FALSE(fixes.monitor.is_persistent());
  fixes.add(1, kFar);
  EXPECT_TRUE(fixes.monitor.is_persistent());
  fixes.add(60, kNone);
  EXPECT_FALSE(fixes.monitor.is_persistent());
  fixes.add_until(true, kFar);
  EXPECT_FALSE(fixes.monitor.is_persistent()) << "the next one has its own time";
}

TEST(IntegrityMonitor, EndsWhenFixesAgreeAndTellsItsTimes) {
  Fixes fixes;
  fixes.add(60, kNone);
  fixes.add_until(true, kFar);
  const double found_s = fixes.time_s;
  EXPECT_GT(fixes.monitor.time_to_detect_s(), 0.0);
  EXPECT_LE(fixes.monitor.time_to_detect_s(), IntegrityParameters().integrity_window);
  EXPECT_TRUE(std::isnan(fixes.monitor.time_to_recover_s()));
  fixes.add(40, kFar);
  EXPECT_LE(fixes.add_until(false, kNone), 20);
  EXPECT_NEAR(fixes.monitor.time_to_recover_s(), fixes.time_s - found_s, 1e-9);
  const double detect_s = fixes.monitor.time_to_detect_s();
  const double recover_s = fixes.monitor.time_to_recover_s();
  fixes.add(300, kNone);
  EXPECT_EQ(fixes.monitor.time_to_detect_s(), detect_s) << "of the last one";
  EXPECT_EQ(fixes.monitor.time_to_recover_s(), recover_s);
  fixes.add_until(true, kFar);
  EXPECT_TRUE(std::isnan(fixes.monitor.time_to_recover_s())) << "the next one lasts";
}

TEST(IntegrityMonitor, TimeToDetectIsFromTheFirstFixThatContradicts) {
  Fixes fixes;
  fixes.add(60, kNone);
  const double begin_s = fixes.time_s + 1.0;
  fixes.add_until(true, kFar);
  EXPECT_NEAR(fixes.monitor.time_to_detect_s(), fixes.time_s - begin_s, 1.01);
}

TEST(IntegrityMonitor, BothNumbersAreAsTheyStand) {
  Fixes fixes;
  fixes.add_until(true, kFar);
  fixes.fix_sigma_m = std::sqrt(40.0);  // with the estimate's: 7 m
  ASSERT_TRUE(fixes.add(60, 2.0 * kFar));
  EXPECT_NEAR(fixes.monitor.contradiction()->offset.norm(), 60.0, 1e-9);
  EXPECT_NEAR(fixes.monitor.contradiction()->sigma_m, 7.0, 1e-9);
}

TEST(IntegrityMonitor, RestartKeepsTheTimesAndForgetsTheFixes) {
  Fixes fixes;
  fixes.add(60, kNone);
  fixes.add_until(true, kFar);
  const double detect_s = fixes.monitor.time_to_detect_s();
  fixes.add(25, kFar);
  ASSERT_TRUE(fixes.monitor.is_persistent());
  fixes.monitor.restart(false);
  EXPECT_FALSE(fixes.monitor.contradiction());
  EXPECT_FALSE(fixes.monitor.is_persistent());
  EXPECT_EQ(fixes.monitor.time_to_detect_s(), detect_s);
  EXPECT_NEAR(fixes.monitor.time_to_recover_s(), 25.0, 1e-9);
  fixes.monitor.restart(false);
  EXPECT_EQ(fixes.monitor.time_to_detect_s(), detect_s);
  EXPECT_NEAR(fixes.monitor.time_to_recover_s(), 25.0, 1e-9);
  EXPECT_FALSE(fixes.add(15, kFar)) << "14 s are less than half of the window";
  EXPECT_TRUE(fixes.add(1, kFar));

  fixes.monitor.reset();
  EXPECT_FALSE(fixes.monitor.contradiction());
  EXPECT_TRUE(std::isnan(fixes.monitor.time_to_detect_s()));
  EXPECT_TRUE(std::isnan(fixes.monitor.time_to_recover_s()));
}

TEST(IntegrityMonitor, OutlierDoesNothing) {
  Fixes fixes;
  fixes.add(60, kNone);
  EXPECT_FALSE(fixes.add({1000.0, 0.0}));
  for (int k = 0; k < 60; ++k) EXPECT_FALSE(fixes.add(kNone)) << k;

  fixes.add_until(true, kFar);
  fixes.add(30, kFar);
  EXPECT_TRUE(fixes.add(kNone)) << "one that agrees ends nothing";
  EXPECT_TRUE(fixes.add({-1000.0, 0.0}));
  EXPECT_TRUE(fixes.add(20, kFar));
}

TEST(IntegrityMonitor, FewerThanThreeFixesSayNothing) {
  Fixes two;
  two.interval_s = 20.0;  // two in 30 s
  EXPECT_FALSE(two.add(100, {1000.0, 0.0}));
  Fixes three;
  three.interval_s = 10.0;
  EXPECT_FALSE(three.add(2, {1000.0, 0.0}));
  EXPECT_TRUE(three.add({1000.0, 0.0}));
}

TEST(IntegrityMonitor, FirstFixContradictsAPoseThatWasSet) {
  Fixes fixes;
  fixes.add(60, kNone);
  fixes.monitor.restart(true);
  EXPECT_TRUE(fixes.monitor.is_unconfirmed());
  EXPECT_TRUE(fixes.add(kFar));
  EXPECT_EQ(fixes.monitor.time_to_detect_s(), 0.0);
  fixes.add(19, kFar);
  EXPECT_FALSE(fixes.monitor.is_persistent());
  fixes.add(kFar);
  EXPECT_TRUE(fixes.monitor.is_persistent()) << "20 s later";
}

TEST(IntegrityMonitor, FixesThatAgreeConfirmAPoseThatWasSet) {
  Fixes fixes;
  fixes.monitor.restart(true);
  EXPECT_FALSE(fixes.add({3.0, 0.0}));
  EXPECT_FALSE(fixes.monitor.is_unconfirmed());
  EXPECT_FALSE(fixes.add(10, kFar)) << "from then on it is an estimate like others";
  fixes.monitor.restart(true);
  ASSERT_TRUE(fixes.add(kFar)) << "a reflection";
  EXPECT_LE(fixes.add_until(false, kNone), 3);
  EXPECT_FALSE(fixes.monitor.is_unconfirmed());
}

TEST(IntegrityMonitor, FixesThatComeBackLeaveNoDoubt) {
  Fixes fixes;
  fixes.add(40, kNone);
  fixes.add_until(true, kFar);
  fixes.add(5, kFar);
  fixes.add_until(false, kNone);
  EXPECT_EQ(fixes.monitor.covariance(), Eigen::Matrix2d(Eigen::Matrix2d::Zero()));
}

TEST(IntegrityMonitor, AnEstimateThatGivesWayIsDoubtedForAWhile) {
  Fixes fixes;
  fixes.add(40, kNone);
  const Eigen::Vector2d first = 2.0 * kFar;
  Eigen::Vector2d offset = first;
  bool was_contradicted = false;
  while (!was_contradicted || fixes.monitor.contradiction()) {  // each fix moves it a metre
    was_contradicted = fixes.add(offset) || was_contradicted;
    fixes.monitor.note_correction(offset.normalized());
    offset -= offset.normalized();
    ASSERT_LT(fixes.time_s, 200.0);
  }
  const double way_m = (first - offset).norm();
  ASSERT_GT(way_m, 40.0);
  const double sigma_m = std::sqrt(fixes.monitor.covariance().trace());
  EXPECT_NEAR(sigma_m, way_m, 1.5);
  EXPECT_NEAR(fixes.monitor.covariance().determinant(), 0.0, 1e-6);  // along the way alone
  fixes.add(60, kNone);
  EXPECT_NEAR(std::sqrt(fixes.monitor.covariance().trace()), sigma_m * std::exp(-0.3), 0.5);
  EXPECT_FALSE(fixes.monitor.contradiction());
}

TEST(IntegrityMonitor, ANewStartIsDoubtedByHowFarItIsAndAPoseThatWasSetIsNot) {
  Fixes fixes;
  fixes.add(40, kNone);
  fixes.monitor.restart(false, kFar);
  EXPECT_NEAR(std::sqrt(fixes.monitor.covariance().trace()), 30.0, 1e-9);
  fixes.monitor.restart(true);
  EXPECT_EQ(fixes.monitor.covariance(), Eigen::Matrix2d(Eigen::Matrix2d::Zero()));
}

}  // namespace
}  // namespace urban_gnss
