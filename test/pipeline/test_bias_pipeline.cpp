#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "matchers.hpp"
#include "urban_gnss_localization/pipeline/bias_pipeline.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
const GeodeticPosition kDatum{33.0, 130.0, 20.0};

/// A robot on an arc at 2 m/s and 0.1 rad/s, with the localizer's estimate given by the test.
struct Rig {
  static constexpr Twist2 kTwist{2.0, 0.1};
  BiasPipeline pipeline;

  explicit Rig(const std::string& yaml = "{}", bool with_datum = true)
      : pipeline(with(BiasPipelineParameters{}, yaml)) {
    if (with_datum) pipeline.set_datum(kDatum);
  }
  static Stamp at(double time) { return from_seconds(1000.0 + time); }
  static Pose2 truth(double time) { return move({}, kTwist, time); }
  void drive(double time) { pipeline.add_odometry({at(time), {}, kTwist}); }
  void estimate(double time) { pipeline.add_estimate(at(time), truth(time)); }
  void fix(double time, const Eigen::Vector2d& bias = {0.0, 0.0}, const Eigen::Vector2d& antenna = {0.0, 0.0}) {
    pipeline.add_fix(raw(time, transform_point(truth(time), antenna) + bias));
  }
  static RawFix raw(double time, const Eigen::Vector2d& position) {
    static const LocalFrame frame(kDatum);
    RawFix fix;
    fix.stamp = at(time);
    fix.position = frame.to_geodetic({position.x(), position.y(), 0.0});
    fix.covariance = Eigen::Matrix3d::Identity();
    fix.covariance_type = CovarianceType::kKnown;
    return fix;
  }
  std::vector<BiasEstimate> take() { return pipeline.take_estimates(); }
};

TEST(BiasPipeline, FixIsComparedWithTheLastEstimateBeforeItCarriedOnByOdometry) {
  Rig rig("antenna_offset: [0.4, -0.3]");
  for (int k = 0; k <= 20; ++k) rig.drive(0.1 * k);
  rig.estimate(1.0);
  rig.fix(1.234, {1.0, -0.5}, {0.4, -0.3});
  auto estimates = rig.take();  // odometry is 0.77 s ahead: it has waited long enough
  ASSERT_EQ(estimates.size(), 1u);
  EXPECT_EQ(estimates[0].stamp, Rig::at(1.234));
  // The first residual is halved: noise and start have the same variance.
  EXPECT_LT((estimates[0].bias - Eigen::Vector2d(0.5, -0.25)).norm(), 1e-6);

  // An estimate from after the fix may contain it already: the one before is carried on, not the other back.
  rig.pipeline.add_estimate(Rig::at(1.9), {500.0, 500.0, 0.0});
  rig.fix(1.6, {1.0, -0.5}, {0.4, -0.3});
  estimates = rig.take();
  ASSERT_EQ(estimates.size(), 1u);
  EXPECT_LT((estimates[0].predicted_antenna_position - transform_point(Rig::truth(1.6), {0.4, -0.3})).norm(), 1e-9);
}

TEST(BiasPipeline, FixWaitsForTheEstimateOrItsTimeout) {
  Rig rig;
  rig.drive(0.0);
  rig.estimate(0.0);
  rig.fix(0.5);
  EXPECT_TRUE(rig.take().empty());
  rig.drive(0.5);
  EXPECT_TRUE(rig.take().empty());
  rig.drive(0.69);
  EXPECT_TRUE(rig.take().empty());
  rig.drive(0.7);
  EXPECT_EQ(rig.take().size(), 1u);
  rig.fix(0.8);
  rig.drive(0.8);
  EXPECT_TRUE(rig.take().empty());
  rig.estimate(0.8);
  EXPECT_EQ(rig.take().size(), 1u);
}

TEST(BiasPipeline, TracksABiasThatGrows) {
  Rig rig("shadow_sigma: 1.0");
  for (int k = 0; k <= 400; ++k) {
    rig.drive(0.1 * k);
    rig.estimate(0.1 * k);
    if (k % 2 == 0) rig.fix(0.1 * k, {0.0, -std::max(0.0, 0.04 * k - 4.0)});
  }
  const auto estimates = rig.take();
  ASSERT_EQ(estimates.size(), 201u);
  EXPECT_FALSE(estimates[45].in_shadow);
  EXPECT_TRUE(estimates[200].in_shadow);
  EXPECT_NEAR(estimates[200].radius_m, 12.0, 0.05);  // a ramp is the filter's own model
  EXPECT_NEAR(estimates[200].bias.y(), -12.0, 0.05);
  EXPECT_EQ(rig.pipeline.waiting_for(), "");
}

TEST(BiasPipeline, NothingBeforeTheDatum) {
  Rig rig("{}", false);
  EXPECT_EQ(rig.pipeline.waiting_for(), "gps/datum");
  rig.drive(0.0);
  rig.estimate(0.0);
  rig.fix(0.0);
  rig.drive(1.0);
  EXPECT_TRUE(rig.take().empty());
  EXPECT_THROW(rig.pipeline.set_datum({kNaN, 0.0, 0.0}), std::invalid_argument);
  rig.pipeline.set_datum(kDatum);
  rig.fix(1.0);
  rig.estimate(1.0);
  EXPECT_EQ(rig.take().size(), 1u);
  rig.pipeline.set_datum(kDatum);  // the same: nothing is forgotten
  rig.fix(1.5);
  rig.drive(2.0);
  EXPECT_EQ(rig.take().size(), 1u);
  rig.pipeline.set_datum({33.1, 130.0, 20.0});
  EXPECT_EQ(rig.pipeline.waiting_for(), "odometry/filtered");
}

TEST(BiasPipeline, RejectedFixSaysSoAndKeepsTheBias) {
  Rig rig;
  for (int k = 0; k <= 10; ++k) {
    rig.drive(k);
    rig.estimate(k);
    rig.fix(k, {1.0, 0.0});
  }
  const BiasEstimate before = rig.take().back();
  RawFix bad = Rig::raw(11.0, {0.0, 0.0});
  bad.has_fix = false;
  rig.pipeline.add_fix(bad);
  rig.fix(10.0);
  const auto estimates = rig.take();
  ASSERT_EQ(estimates.size(), 2u);
  EXPECT_EQ(estimates[0].outcome.decision, FixDecision::kRejectedStatus);
  EXPECT_EQ(estimates[0].stamp, Rig::at(11.0));
  EXPECT_EQ(estimates[1].outcome.decision, FixDecision::kRejectedStale);
  for (const BiasEstimate& e : estimates) EXPECT_EQ(e.bias, before.bias);
}

TEST(BiasPipeline, WithoutOdometryBetweenEstimateAndFixItIsNotExamined) {
  Rig rig;
  rig.estimate(0.0);
  for (int k = 50; k <= 60; ++k) rig.drive(0.1 * k);
  rig.fix(5.5);
  const auto estimates = rig.take();
  ASSERT_EQ(estimates.size(), 1u);
  EXPECT_EQ(estimates[0].outcome.decision, FixDecision::kNotExamined);
  EXPECT_EQ(estimates[0].radius_m, 0.0);
}

std::vector<BiasEstimate> ordinary_run(Rig& rig, bool with_bad_ones) {
  for (int k = 0; k <= 100; ++k) {
    if (with_bad_ones) {
      for (const double bad : {kNaN, 1.0 / 0.0, 1e300}) {
        rig.pipeline.add_odometry({Rig::at(0.1 * k), {}, {bad, 0.1}});
        rig.pipeline.add_odometry({Rig::at(0.1 * k), {bad, 0.0, 0.0}, Rig::kTwist});
        if (!std::isfinite(bad)) rig.pipeline.add_estimate(Rig::at(0.1 * k), {0.0, bad, 0.0});
        RawFix fix = Rig::raw(0.1 * k, {0.0, 0.0});
        fix.position.latitude_deg = bad;
        rig.pipeline.add_fix(fix);
      }
      RawFix empty;  // stamp 0, place 0, as receivers send before they know
      empty.has_fix = false;
      rig.pipeline.add_fix(empty);
    }
    rig.drive(0.1 * k);
    rig.drive(0.1 * k);
    rig.estimate(0.1 * k);
    if (k % 5 == 0) rig.fix(0.1 * k, {0.02 * k, 0.0});
  }
  std::vector<BiasEstimate> used;
  for (const BiasEstimate& e : rig.take()) {
    if (!is_rejected(e.outcome.decision)) used.push_back(e);
  }
  return used;
}

void expect_equal(const std::vector<BiasEstimate>& a, const std::vector<BiasEstimate>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].stamp, b[i].stamp);
    ASSERT_EQ(a[i].bias, b[i].bias);
    ASSERT_EQ(a[i].covariance, b[i].covariance);
  }
}

TEST(BiasPipeline, NonFiniteMessagesChangeNothing) {
  Rig clean, dirty;
  const auto expected = ordinary_run(clean, false);
  EXPECT_EQ(expected.size(), 21u);
  expect_equal(ordinary_run(dirty, true), expected);
}

TEST(BiasPipeline, ClockSetBackGivesTheSameRunAgain) {
  Rig rig;
  const auto first = ordinary_run(rig, false);
  expect_equal(ordinary_run(rig, false), first);
  bool said = false;
  for (const PipelineEvent& event : rig.pipeline.take_events()) {
    said = said || event.text.find("jumped back") != std::string::npos;
  }
  EXPECT_TRUE(said);
}

TEST(BiasPipeline, AnOdometryGapStartsTheBiasAnew) {
  Rig rig("{odometry_gap: 2.0}");
  const Eigen::Vector2d bias(6.0, 0.0);
  const auto run = [&](double from_s, double to_s) {
    std::vector<BiasEstimate> all;
    for (double t = from_s; t <= to_s; t += 0.1) {
      rig.drive(t);
      rig.estimate(t);
      rig.pipeline.add_fix(Rig::raw(t, Rig::truth(t).position() + bias));
      for (const BiasEstimate& e : rig.take()) all.push_back(e);
    }
    return all;
  };
  const BiasEstimate before = run(0.0, 10.0).back();
  EXPECT_NEAR(before.bias.x(), bias.x(), 1.0);
  const BiasEstimate after =
      run(15.0, 15.25).front();  // the first fix after the gap meets a filter that knows of no bias
  EXPECT_GT(after.covariance(0, 0), 2.0 * before.covariance(0, 0));
}

TEST(BiasPipeline, EveryParameterHasAnEffect) {
  const auto trace = [](const std::string& yaml) {
    Rig rig(yaml);
    std::ostringstream out;
    for (int k = 0; k <= 300; ++k) {
      rig.drive(0.1 * k);
      if (k % 7 == 0) rig.estimate(0.1 * k);
      if (k % 5 == 0) {
        const double extra = k == 60 ? 6.0 : 0.0;
        const Eigen::Vector2d bias = k > 200 ? Eigen::Vector2d(80.0, 0.0) : Eigen::Vector2d(0.03 * k + extra, 1.0);
        RawFix fix = Rig::raw(0.1 * k, Rig::truth(0.1 * k).position() + bias);
        fix.covariance *= k == 100 ? 1e6 : k == 110 ? 1e-6 : 1.0;
        if (k == 120) fix.covariance.setZero();
        if (k == 130) fix = Rig::raw(0.1 * k, {3000.0, 0.0});
        rig.pipeline.add_fix(fix);
      }
      if (k == 150) rig.pipeline.add_odometry({Rig::at(0.1 * k - 0.7), {}, {}});
      for (const BiasEstimate& e : rig.take()) {
        out << k << ' ' << e.radius_m << ' ' << e.shadow_threshold << ' ' << int(e.outcome.decision) << e.outcome.reason
            << '\n';
      }
    }
    for (const double time : {0.0, 0.1, 0.2}) rig.drive(time);
    for (const PipelineEvent& event : rig.pipeline.take_events()) out << event.text << '\n';
    return out.str();
  };
  const std::map<std::string, std::string> changes = {{"mode", "literal"},
                                                      {"antenna_offset", "[1.0, 0.0]"},
                                                      {"estimate_timeout", "0.35"},
                                                      {"time_jump", "0.5"},
                                                      {"reset_on_time_jump", "false"},
                                                      {"fix_sigma_default", "7.0"},
                                                      {"fix_sigma_floor", "0.5"},
                                                      {"fix_sigma_ceiling", "100.0"},
                                                      {"fix_covariance_scale", "2.0"},
                                                      {"max_distance_from_datum", "1000.0"},
                                                      {"bias_input", "position"},
                                                      {"shadow_sigma", "2.0"},
                                                      {"bias_acceleration_density", "1.0"},
                                                      {"bias_rate_sigma", "1.0"},
                                                      {"gate_probability", "0.5"},
                                                      {"gate_timeout", "2.0"},
                                                      {"shadow_probability", "0.9"},
                                                      {"odometry_gap", "0.05"}};
  const std::string plain = trace("{}");
  for (const std::string& name : parameter_names(BiasPipelineParameters{})) {
    ASSERT_EQ(changes.count(name), 1u) << name << " is not examined";
    EXPECT_NE(trace(name + ": " + changes.at(name)), plain) << name;
  }
}

}  // namespace
}  // namespace urban_gnss
