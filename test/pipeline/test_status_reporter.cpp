#include <cmath>

#include "pipeline_rig.hpp"
#include "urban_gnss_localization/pipeline/status_reporter.hpp"

namespace urban_gnss {
namespace {

FixOutcome outcome(FixDecision decision, double time, bool of_ranges = false) {
  FixOutcome outcome;
  outcome.decision = decision;
  outcome.stamp = from_seconds(time);
  outcome.of_ranges = of_ranges;
  return outcome;
}

/// A localizer that is well, ten seconds after its start, with a fix just now.
struct Well {
  StatusReporter reporter{StatusParameters{}, 2.0};
  PipelineStatus status;
  FakeLocalizer localizer;

  Well() {
    localizer.initialize(pose_with_sigma({}, 0.5, 0.1));
    status.last_odometry = status.last_fix = from_seconds(110.0);
    status.has_datum = status.has_started = true;
    reporter.count(outcome(FixDecision::kAccepted, 110.0));
  }
  LocalizationReport report() const { return reporter.report(status, localizer); }
};

TEST(StatusReporter, CountsWhatBecameOfTheFixes) {
  StatusReporter reporter({}, 2.0);
  reporter.note_start_fix(outcome(FixDecision::kNotExamined, 1.0), false);
  EXPECT_EQ(reporter.report({}, FakeLocalizer()).last_fix.stamp, from_seconds(1.0));
  reporter.count(outcome(FixDecision::kAccepted, 2.0));
  reporter.count(outcome(FixDecision::kInflated, 3.0, true));
  reporter.count(outcome(FixDecision::kRejectedGate, 4.0, true));
  reporter.count_velocity();
  const LocalizationReport report = reporter.report({}, FakeLocalizer());
  EXPECT_EQ(report.fixes_used, 2u);
  EXPECT_EQ(report.fixes_with_ranges, 1u);
  EXPECT_EQ(report.fixes_rejected, 1u);
  EXPECT_EQ(report.velocities_used, 1u);
  EXPECT_EQ(report.last_fix.decision, FixDecision::kRejectedGate);
  reporter.reset();
  EXPECT_EQ(reporter.report({}, FakeLocalizer()).fixes_used, 0u);
}

TEST(StatusReporter, FixAgeIsThatOfTheLastOneUsed) {
  Well well;
  const auto age_s = [&] { return well.report().fix_age_s; };
  well.status.last_odometry = from_seconds(113.0);
  EXPECT_NEAR(age_s(), 3.0, 1e-9);
  well.reporter.count(outcome(FixDecision::kRejectedGate, 112.0));
  well.reporter.note_start_fix(outcome(FixDecision::kNotExamined, 112.0), false);
  EXPECT_NEAR(age_s(), 3.0, 1e-9);
  well.reporter.note_start_fix(outcome(FixDecision::kNotExamined, 112.0), true);
  EXPECT_NEAR(age_s(), 1.0, 1e-9);
}

TEST(StatusReporter, BeforeTheStartTheStateIsWhatIsMissing) {
  PipelineStatus status;
  status.waiting_for = "something";
  const StatusReporter reporter({}, 2.0);
  const auto state = [&] { return reporter.report(status, FakeLocalizer()).state; };
  EXPECT_EQ(state(), LocalizationState::kWaitingForOdometry);
  status.last_odometry = from_seconds(1.0);
  EXPECT_EQ(state(), LocalizationState::kWaitingForDatum);
  status.has_datum = true;
  EXPECT_EQ(state(), LocalizationState::kWaitingForFix);
  status.last_fix = from_seconds(1.0);
  EXPECT_EQ(state(), LocalizationState::kInitializing);
  status.is_lost = true;
  EXPECT_EQ(state(), LocalizationState::kLost);
  EXPECT_EQ(reporter.report(status, FakeLocalizer()).reason, "waiting for something");
}

TEST(StatusReporter, AMistakeOfTheReceiverIsSaidWhereAllElseIsWell) {
  Well well;
  well.status.receiver_note = "gps/fix has HDOP^2 as variance";
  EXPECT_TRUE(well.report().healthy);
  EXPECT_EQ(well.report().reason, "gps/fix has HDOP^2 as variance");
  EXPECT_EQ(well.report().receiver_note, "gps/fix has HDOP^2 as variance");
  well.localizer.state.covariance(2, 2) = 0.16;
  EXPECT_FALSE(well.report().healthy);
  EXPECT_EQ(well.report().reason, "heading not known yet");
  EXPECT_EQ(well.report().receiver_note, "gps/fix has HDOP^2 as variance");
}

TEST(StatusReporter, BiasRadiusIsNoNumberWhereNoneIsKnown) {
  Well well;
  EXPECT_TRUE(std::isnan(well.report().bias_radius_m));
  EXPECT_TRUE(std::isnan(StatusReporter({}, 2.0).report({}, FakeLocalizer()).bias_radius_m)) << "before the start";
  well.status.bias_radius_m = 3.0;
  EXPECT_EQ(well.report().bias_radius_m, 3.0);
}

TEST(StatusReporter, AnInertGateIsSaidOfALocalizerThatHasOne) {
  Well well;
  FixOutcome outcome;
  outcome.decision = FixDecision::kBiasCompensated;
  outcome.nis = 0.01;
  outcome.stamp = from_seconds(110.0);
  well.localizer.gated = true;
  for (int k = 0; k < 100; ++k) well.reporter.count(outcome);
  EXPECT_FALSE(well.report().is_gate_inert) << "the NIS is that of a bias that was estimated";
  outcome.decision = FixDecision::kAccepted;
  for (int k = 0; k < 100; ++k) well.reporter.count(outcome);
  EXPECT_TRUE(well.report().is_gate_inert);
  EXPECT_TRUE(well.report().healthy);
  EXPECT_NE(well.report().reason.find("gate inert"), std::string::npos) << well.report().reason;
  well.localizer.gated = false;
  EXPECT_FALSE(well.report().is_gate_inert);
  EXPECT_EQ(well.report().reason, "");
}

TEST(StatusReporter, ParticlesThatDisagreeAreNotWell) {
  Well well;
  well.localizer.mass = 0.6;
  EXPECT_TRUE(well.report().healthy);
  well.localizer.mass = 0.4;
  EXPECT_FALSE(well.report().healthy);
  EXPECT_NE(well.report().reason.find("particles disagree"), std::string::npos) << well.report().reason;
}

TEST(StatusReporter, HealthNamesWhatIsWrongFirst) {
  Well well;
  EXPECT_TRUE(well.report().healthy) << well.report().reason;
  EXPECT_EQ(well.report().state, LocalizationState::kTracking);
  EXPECT_NEAR(well.report().position_sigma_m, 0.5, 1e-12);
  const auto expect_complaint = [&](const std::string& text) {
    const LocalizationReport report = well.report();
    EXPECT_FALSE(report.healthy);
    EXPECT_NE(report.reason.find(text), std::string::npos) << report.reason;
  };
  well.localizer.state.covariance(2, 2) = 0.16;
  expect_complaint("heading not known");
  well.status.last_fix = from_seconds(112.5);
  expect_complaint("no odometry for 2.5 s");
  well.status.last_odometry = from_seconds(120.5);
  expect_complaint("no fix was used for 10.5 s");
  EXPECT_EQ(well.report().state, LocalizationState::kDeadReckoning);
  well.status.is_lost = true;
  expect_complaint("max_bias_radius");
  EXPECT_EQ(well.report().state, LocalizationState::kLost);
  well.status.is_lost = false;
  well.reporter.reset();
  expect_complaint("no fix was used yet");
}

}  // namespace
}  // namespace urban_gnss
